"""The table of kept speeds: what is written comes back, and a loss is said on the same kind of machine alone."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import pytest

SPEED = Path(__file__).parents[2] / "benchmarks" / "speed"


@pytest.fixture(scope="module")
def kept():
    spec = importlib.util.spec_from_file_location("kept", SPEED / "kept.py")
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "kept", module)  # its dataclass asks for it
        spec.loader.exec_module(module)
        yield module


@pytest.fixture
def row(kept):
    return kept.Kept("fit_speed", "scipy / ours, in one", 20.0, 7, 20.0, "2026-01-02", "a processor x 2", "abc")


def test_lines_are_found_among_others(kept, capsys):
    kept.show("peer, one core / ours", 12.3456, 40)
    kept.show("slow", 0.0412, 3, 20.0)
    kept.show("large", 1234.5, 1)
    text = "before: 3\n" + capsys.readouterr().out + "ratio of medians: 4\n"
    assert kept.found_in(text) == [("peer, one core / ours", 12.3, 40, None), ("slow", 0.0412, 3, 20.0),
                                   ("large", 1234.0, 1, None)]


def test_rows_come_back_and_older_ones_stay(kept, row, tmp_path):
    table = tmp_path / "results.csv"
    assert kept.read(table) == []
    kept.add([row], table)
    kept.add([replace(row, ratio=19.0, required=None)], table)
    assert [(found.ratio, found.required) for found in kept.read(table)] == [(20.0, 20.0), (19.0, None)]
    assert kept.read(table)[0] == row


@pytest.mark.parametrize(("now", "said"), [(19.0, 0), (30.0, 0), (15.5, 0), (14.5, 1)])
def test_what_got_clearly_worse_is_said(kept, row, now, said):
    best_of_all = replace(row, ratio=99.0, date="2025-01-01")
    assert len(kept.worse([replace(row, ratio=now)], [best_of_all, row])) == said
    assert kept.worse([replace(row, ratio=now, machine="another")], [row]) == []


def test_a_ratio_below_its_required_one_is_said(kept, row):
    rows = [row, replace(row, ratio=19.9), replace(row, ratio=1.0, required=None)]
    assert kept.short_of(rows) == ["fit_speed, scipy / ours, in one: 19.9, required 20"]


def test_every_script_keeps_a_ratio():
    scripts = [path for path in SPEED.glob("*.py") if path.stem not in ("bench", "kept")]
    assert len(scripts) > 10
    assert [path.name for path in scripts if "show(" not in path.read_text(encoding="utf-8")] == []
