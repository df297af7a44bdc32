"""Error since the poses stopped, as it is drawn."""

import pytest

from nanobench_tools.pages import overview_pictures


def window(method, h, error, clock="as-recorded"):
    return {"flight": "a", "method": method, "clock": clock, "t0_s": 5.0, "h_s": h, "error_m": error,
            "horizontal_m": 0.6 * error, "vertical_m": 0.8 * error}


def test_median_and_quartiles_per_method():
    made = [window("one", h, h * k) for h in (1.0, 5.0) for k in (0.1, 0.2, 0.3, 0.4, 0.5)]
    windows = [*made, window("two", 1.0, 2.0), window("one", 1.0, 99.0, "retimed")]
    found = overview_pictures.blackout({"windows": windows}).panels
    assert [p.y.title for p in found] == ["3-D error", "horizontal error", "vertical error"]
    line = found[0].marks[0]
    assert (line.name, line.x) == ("one", [1.0, 5.0])
    assert line.y == pytest.approx([0.3, 1.5])
    assert (line.low, line.high) == (pytest.approx([0.2, 1.0]), pytest.approx([0.4, 2.0]))
    assert found[2].marks[0].y == pytest.approx([0.24, 1.2])
    assert found[0].x.log
    assert found[0].y.log


def test_drift_and_consistency_have_a_panel_each():
    made = [{**window("one", 1.0, 0.1), "drift_percent": d, "inside_3_sigma": i}
            for d, i in ((2.0, True), (6.0, False))]
    found = overview_pictures.blackout({"windows": [*made, {**window("two", 1.0, 0.1), "inside_3_sigma": None}]})
    drift, inside = found.panels[3:]
    assert (drift.y.unit, drift.marks[0].y) == ("%", [4.0])
    assert [(mark.name, mark.y) for mark in inside.marks] == [("one", [50.0])]


def test_without_windows_there_is_nothing_to_draw():
    assert overview_pictures.blackout(None) is None
    assert overview_pictures.blackout({"windows": []}) is None
