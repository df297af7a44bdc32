"""Error since the poses stopped, as it is drawn."""

import pytest

from nanobench_tools.report import overview_pictures


def window(method, h, error, clock="as-recorded"):
    return {"flight": "a", "method": method, "clock": clock, "t0_s": 5.0, "h_s": h, "error_m": error,
            "horizontal_m": 0.6 * error, "vertical_m": 0.8 * error}


def test_median_and_quartiles_per_method():
    made = [window("one", h, h * k) for h in (1.0, 5.0) for k in (0.1, 0.2, 0.3, 0.4, 0.5)]
    windows = [*made, window("two", 1.0, 2.0), window("one", 1.0, 99.0, "retimed")]
    found = overview_pictures.blackout({"windows": windows})
    assert [p["title"] for p in found["panels"]] == ["3-D error", "horizontal error", "vertical error"]
    line = found["panels"][0]["lines"][0]
    assert (line["name"], line["x"]) == ("one", [1.0, 5.0])
    assert line["y"] == pytest.approx([0.3, 1.5])
    assert (line["low"], line["high"]) == (pytest.approx([0.2, 1.0]), pytest.approx([0.4, 2.0]))
    assert found["panels"][2]["lines"][0]["y"] == pytest.approx([0.24, 1.2])


def test_drift_and_consistency_have_a_panel_each():
    made = [{**window("one", 1.0, 0.1), "drift_percent": d, "inside_3_sigma": i}
            for d, i in ((2.0, True), (6.0, False))]
    found = overview_pictures.blackout({"windows": [*made, {**window("two", 1.0, 0.1), "inside_3_sigma": None}]})
    drift, inside = found["panels"][3:]
    assert (drift["unit"], drift["lines"][0]["y"]) == ("%", [4.0])
    assert [(line["name"], line["y"]) for line in inside["lines"]] == [("one", [50.0])]


def test_without_windows_it_says_so():
    assert "absent" in overview_pictures.blackout(None)
    assert "absent" in overview_pictures.blackout({"windows": []})
