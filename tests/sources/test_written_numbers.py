"""How numbers of a table are written: thousands separators, minus signs, decimal marks, order of the rows."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import flown

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

NAMES = ("t_ms", "px[mm]", "py[mm]", "pz[mm]")


def written(folder, cell, delimiter=";", order=None):
    """A flight in ms and mm, with 5 m added, its cells written by ``cell``."""
    t, p, *_ = flown()
    rows = np.column_stack([1e3 * t, 1e3 * p + [5000.0, 0.0, 0.0]])[slice(None) if order is None else order]
    lines = [delimiter.join(NAMES), *(delimiter.join(map(cell, row)) for row in rows)]
    path = folder / "flight.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("cell", [
    lambda c: f"{c:,.3f}", lambda c: f"{c:,.0f}", lambda c: f"{c:,.0f}".replace(",", "."),
    lambda c: f"{c:,.0f}".replace(",", "'"), lambda c: f"{c:,.0f}".replace(",", "\N{NO-BREAK SPACE}"),
    lambda c: f"{c:,.1f}".replace(",", "\N{THIN SPACE}"), lambda c: f"{c:,.1f}".replace(",", "\u2019"),
    lambda c: f"{c:,.1f}".replace(",", "_").replace(".", ",").replace("_", ".")],
    ids=["1,234.567", "1,234", "1.234", "1'234", "1 234", "thin space", "1’234.5", "1.234,5"])
def test_thousands_separators_are_refused(tmp_path, cell):
    with pytest.raises(InputError, match=r"column t_ms: .* has a thousands separator"):
        draft_columns(written(tmp_path, cell))


@pytest.mark.parametrize("cell", [
    lambda c: f"{c:.3f}", lambda c: f"{c:.3g}" if abs(c) < 1000.0 else f"{c:.0f}",
    lambda c: f"{c:.3f}".replace(".", ","), lambda c: f"{c:.3f}".replace("-", "\N{MINUS SIGN}")],
                         ids=["1234.567", "digits", "1234,567", "minus sign"])
@pytest.mark.parametrize("delimiter", [";", "\t", " "])
def test_other_numbers_are_read(tmp_path, cell, delimiter):
    path = written(tmp_path, cell, delimiter)
    draft = draft_columns(path)
    assert draft.mapped["mocap", "py"] == ("py[mm]", "mm")
    (tmp_path / "map.toml").write_text(draft.text)
    (flight,) = load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["py"], flown()[1][:, 1], atol=6e-3)


@pytest.mark.parametrize("order", [np.s_[::-1], np.random.default_rng(5).permutation(len(flown()[0]))],
                         ids=["reversed", "shuffled"])
def test_rows_out_of_order_are_refused(tmp_path, order):
    with pytest.raises(InputError, match="out of order"):
        draft_columns(written(tmp_path, lambda c: f"{c:.3f}", order=order))


def test_two_sessions_in_one_file_are_drafted(tmp_path):
    n = len(flown()[0])
    draft = draft_columns(written(tmp_path, lambda c: f"{c:.3f}", order=np.r_[0:n // 2, 0:n // 2]))
    assert draft.mapped["", "time"] == ("t_ms", "ms")
