"""Tables in README.md and docs/*.md come from stored results; the tool that writes them does what it says."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.figures import collect, numbers, tables, text
from tools.figures.__main__ import check, main, pages
from tools.figures.store import ROOT, FigureError, Store

STORE = Store(
    {
        "estimate": {
            "command": "nanobench run",
            "data": "Real: some flights",
            "version": "9.9",
            "date": "2031-02-03",
            "figures": {"clean": {"retimed": {"n": 1067, "ate": {"mean": 0.0125, "ci95": [0.0113, 0.0138]}}}},
        },
        "old": {
            "command": "slow command",
            "data": "SYNTHETIC",
            "version": "0.1.0",
            "date": "2030-01-02",
            "figures": {"share": 0.5, "votes": ["gyro", "accelerometer"], "none": None, "word": "unknown"},
        },
    },
    {
        "estimate": {
            "tables": {
                "clocks": {
                    "header": ["clock", "ATE mm"],
                    "cells": ["{ate mm.1} ({ate.ci95 mm.1})"],
                    "rows": [["re-timed", "clean.retimed"], ["joint", "clean.joint?"]],
                    "note": "{clean.retimed.n} flights",
                },
                "limits": {"header": ["", "m/s²"], "rows": [["g", "{code:scipy.constants:g .2}"]], "note": "Of nature"},
            }
        }
    },
)


# -- the pages of this project


@pytest.mark.parametrize("page", pages(), ids=lambda p: p.name)
def test_a_page_says_what_the_stored_figures_say(page: Path) -> None:
    assert check(page, Store.load()) == []


def test_every_stored_source_is_quoted() -> None:
    quoted = {name for page in pages() for name in text.used(page.read_text())}
    store = Store.load()
    for layout in store.layouts.values():
        quoted |= set(re.findall(r"[\"{ ]([A-Za-z]\w*)/", json.dumps(layout.get("tables", {}))))
    assert set(store.sources) - quoted - {"published"} == set()


def test_every_source_says_what_was_measured() -> None:
    for name, source in Store.load().sources.items():
        if name != "published":
            assert re.match(r"(Real|SYNTHETIC): \w", source["data"]), name
            assert source["command"], name
            assert source["version"], name
            assert re.fullmatch(r"\d{4}-\d{2}-\d{2}", source["date"]), name
            assert "/tmp/" not in json.dumps(source), name


def test_settings_that_pages_name_exist() -> None:
    from nanobench_tools.settings import areas

    named = {a for page in pages() for a in re.findall(r"`nanobench settings (\w+)`", page.read_text())}
    assert named == set(areas())


# -- marks


def test_a_constant_is_read_from_the_code() -> None:
    page = text.render("<!-- table: estimate/limits -->\n<!-- /table -->", Store({}, STORE.layouts))
    assert "| g | 9.81 |\n\n*Of nature.*\n" in page


@pytest.mark.parametrize(
    ("value", "form", "shown"),
    [
        (0.0125, "mm.1", "12.5"),
        (-0.001, "+ms.0", "-1"),
        (0.004, "+ms.0", "+4"),
        (0.873, "%.0", "87"),
        (1234.5, ".1", "1,234.5"),
        (15263, None, "15,263"),
        ([0.0113, 0.0138], "mm.1", "11.3 .. 13.8"),
        ([0.1, 0.2], ".1,", "0.1, 0.2"),
        (["gyro", "accelerometer"], None, "gyro, accelerometer"),
        (None, "mm.1", "–"),
    ],
)
def test_formats(value: object, form: str | None, shown: str) -> None:
    assert text.show(value, form) == shown


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("{clean.retimed.ape mm.1}", "no 'ape'"),
        ("{nothing/here .1}", "no docs/figures/nothing.json"),
        ("{clean.retimed.ate}", "needs a format"),
        ("{clean.retimed.ate miles.1}", "no format 'miles.1'"),
        ("{clean.retimed mm.1}", "say which"),
        ("{code:no.such.module:g .1}", "No module"),
        ("{code:scipy.constants:ggg .1}", "no 'ggg'"),
    ],
)
def test_a_wrong_cell_is_refused_by_name(cell: str, said: str) -> None:
    with pytest.raises(FigureError, match=re.escape(said)):
        text.fill(cell, STORE, "estimate")


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("x <!-- fig: estimate/clean.retimed.n -->1<!-- /fig -->", "not a mark"),
        ("x\n<!-- table: estimate/clocks -->\n| a |", "not a mark"),
        ("<!-- holds: old/share -->", "not a mark"),
        ("<!-- table: estimate/absent -->\n<!-- /table -->", "not in docs/figures/estimate.toml"),
    ],
)
def test_a_wrong_mark_is_refused_by_name(page: str, said: str) -> None:
    with pytest.raises(FigureError, match=re.escape(said)):
        text.render(page, STORE)


def test_a_table_of_a_layout() -> None:
    page = text.render("<!-- table: estimate/clocks -->\nold\n<!-- /table -->", STORE)
    assert "| re-timed | 12.5 (11.3 .. 13.8) |" in page
    assert "joint" not in page
    assert "old" not in page
    assert "*1,067 flights. Real: some flights; `nanobench run`, version 9.9, 2031-02-03.*" in page
    assert text.render(page, STORE) == page


def test_marks_in_code_are_code() -> None:
    page = "```\n<!-- table: no/such -->\n1<!-- /table -->\n```\n"
    assert text.render(page, STORE) == page
    assert text.used(page) == []


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(FigureError, match="'x' has 1 cells"):
        tables.markdown(["a", "b"], [["x"]])


def test_what_is_not_stored_may_be_left_out() -> None:
    said = text.fill("n = {n}[? of {sessions} days][?: {ate mm.1}]", STORE, "estimate/clean.retimed")
    assert said == "n = 1,067: 12.5"
    assert text.fill("all[?, {none .1}]", STORE, "old") == "all"
    assert text.fill("[none? lost][none! {share .1}] [share? {share .2}][share! none]", STORE, "old") == "0.5 0.50"


@pytest.mark.parametrize("claim", ["old/share < 0.6", "old/share > 0.4", "old/share = 0.5", "old/word = unknown"])
def test_a_claim_that_holds(claim: str) -> None:
    assert text.broken_claims(f"<!-- holds: {claim} -->", STORE) == []


@pytest.mark.parametrize(
    "claim", ["old/share > estimate/clean.retimed.n", "old/share < 0.5", "old/word = none", "old/none < 1"]
)
def test_a_claim_that_fails_is_found(claim: str) -> None:
    (said,) = text.broken_claims(f"<!-- holds: {claim} -->", STORE)
    assert said.startswith(claim)


# -- numbers without a table

TABLE = "<!-- table: k -->\n\n| a |\n|---|\n| 12.5 (1,067) |\n\n*n = 3*\n\n<!-- /table -->\n\n"


@pytest.mark.parametrize(
    "page",
    [
        "The error is 12.5 mm.",
        "## 3 flights",
        "| a |\n|---|\n| 7 |",
        "- off by .05 m",
        TABLE + "as 12.5 and 2",
        TABLE + "as 12",
        TABLE + "## Next\n\n12.5 mm",
        "12.5 mm\n\n## Next\n\n" + TABLE,
        "x 95 % of flights",
        "a 20-s window",
        "1.2 <!-- holds: a/b < 1 -->",
        "<b>4</b> m",
        "<div>4 m</div>",
    ],
)
def test_a_number_in_the_text_is_found(page: str) -> None:
    assert len(numbers.without_table(page)) == 1


@pytest.mark.parametrize(
    "page",
    [
        TABLE + "12.5 mm, 1,067 rows of n = 3",
        "before it: 12.5\n\n" + TABLE,
        "`--seed 3` and\n\n```sh\nseq 5\n```\n\n    indented 4\n",
        "Task 1, ROS 1 and 2, PX4, p99, BSD-3-Clause, GPL-3.0, Python 3.11, 2026-11-23, m/s^2, a 95 % interval, 3-D",
        "[page](https://a.b/9)",
        "1. first\n2. second",
    ],
)
def test_numbers_of_a_table_code_and_harmless_kinds_are_left_alone(page: str) -> None:
    assert numbers.without_table(page) == []


@given(st.integers(0, 99999), st.sampled_from(["mm", "m", "%", "flights"]))
def test_any_number_of_flights_or_millimetres_is_found(value: int, unit: str) -> None:
    assert numbers.without_table(f"It was {value} {unit}.") != []


# -- results to stored figures

SPEC = {
    "command": "nanobench x",
    "data": "Real: made up",
    "result": "x.json",
    "picks": [
        {
            "key": "clean.{clock}",
            "each": {"clock": ["as-recorded", "joint"]},
            "from": "rows",
            "where": {"clock": "{clock}", "group": "all"},
            "take": {"ate": "metrics.ate", "count": "flights#", "votes": "clock_evidence?"},
            "optional": True,
        }
    ],
}
ROW = {"clock": "as-recorded", "group": "all", "metrics": {"ate": {"mean": 0.123456789}}, "flights": ["a", "b"]}


def test_results_become_stored_figures() -> None:
    result = {"version": "1.0", "manifest": {"started": "2031-02-03T04:05"}, "rows": [ROW, {**ROW, "group": "slow"}]}
    stored = collect.collect("x", SPEC, result)
    assert stored["figures"] == {"clean": {"as-recorded": {"ate": {"mean": 0.123457}, "count": 2, "votes": None}}}
    assert stored["date"] == "2031-02-03"


def test_a_pick_that_is_not_unique_is_refused() -> None:
    with pytest.raises(FigureError, match=r"x/clean\.as-recorded: 2 items of 'rows'"):
        collect.collect("x", SPEC, {"rows": [ROW, ROW]})


def test_a_missing_pick_is_refused_unless_optional() -> None:
    needed = {**SPEC, "picks": [{**SPEC["picks"][0], "optional": False}]}
    with pytest.raises(FigureError, match="0 items"):
        collect.collect("x", needed, {"rows": [ROW]})


def test_the_worst_of_several_items() -> None:
    rows = [{**ROW, "metrics": {"ate": {"mean": value}}, "v 0.5": value} for value in (0.1, 0.3, 0.2)]
    pick = {**SPEC["picks"][0], "worst": "metrics.ate.mean", "take": {"ate": "metrics.ate.mean", "v": "v 0.5"}}
    found = collect.collect("x", {**SPEC, "picks": [pick]}, {"rows": rows})["figures"]
    assert found["clean"]["as-recorded"] == {"ate": 0.3, "v": 0.3}


def test_a_condition_may_hold_for_items_that_do_not_say() -> None:
    pick = {**SPEC["picks"][0], "where": {"clock": "{clock}", "group": "all", "start?": "centred"}}
    rows = [{**ROW, "start": "past"}, ROW]
    found = collect.collect("x", {**SPEC, "picks": [pick]}, {"rows": rows})["figures"]
    assert found["clean"]["as-recorded"]["count"] == 2
    both = [ROW, {**ROW, "start": "centred"}]
    with pytest.raises(FigureError, match="2 items"):
        collect.collect("x", {**SPEC, "picks": [pick]}, {"rows": both})


def test_a_file_changes_only_with_its_figures(tmp_path: Path) -> None:
    stored = collect.collect("x", SPEC, {"version": "1.0", "manifest": {"started": "2031-02-03"}, "rows": [ROW]})
    assert collect.save("x", stored, tmp_path)
    assert not collect.save("x", {**stored, "date": "2032-01-01"}, tmp_path)
    assert json.loads((tmp_path / "x.json").read_text())["date"] == "2031-02-03"
    assert collect.save("x", {**stored, "version": "1.1"}, tmp_path)


def test_layouts_and_picks_are_well_formed() -> None:
    for name, spec in collect.specs().items():
        assert {"command", "result", "run", "data", "picks"} <= set(spec), name


def test_the_command_checks_and_names_what_is_wrong(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["--check"]) == 0
    assert main(["--only", "nonsense"]) == 1
    assert "no source nonsense" in capsys.readouterr().err
    assert main(["--results", str(tmp_path)]) == 1
    assert "holds none of" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_runs_from_a_shell() -> None:
    ended = subprocess.run([sys.executable, "-m", "tools.figures", "--check"], cwd=ROOT, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout.strip()) == (0, ""), ended.stderr
