"""Plotly's JSON of a figure: Plotly's own package takes it, and it shows the values that the figure has."""

import json

import numpy as np
import pytest
from test_control_pictures import BODY as control_body

from nanobench_tools.pages import control_pictures, estimate_figures, overview_pictures, recording
from nanobench_tools.pages.figure import Axis, Choice, Figure, Mark, Panel, before_and_after, intervals
from nanobench_tools.pages.plotly_json import spec


def plain(part):
    """As the page draws it: with the colours of a theme."""
    if isinstance(part, dict):
        return {key: plain(value) for key, value in part.items()}
    if isinstance(part, (list, tuple)):
        return [plain(one) for one in part]
    return "#123456" if isinstance(part, str) and part.startswith("var(--") else part


def drawn(*marks, **panel):
    x, y = panel.pop("x", Axis("x", "s")), panel.pop("y", Axis("y", "m"))
    return plain(json.loads(json.dumps(spec(Figure("a", "", [Panel(x, y, marks, **panel)])), allow_nan=False)))


@pytest.fixture
def all_drawings(make, flights, results):
    found = [overview_pictures.flights(results["audit"]), overview_pictures.task1(results["sysid"], True),
             overview_pictures.by_speed(results["estimate"]), overview_pictures.progress(results["estimate"]),
             overview_pictures.clocks(results["audit"]),
             *estimate_figures.pictures(results["estimate"]).values(),
             *control_pictures.pictures(control_body).values(),
             recording.figure(flights[0], make.entry(flights[0]), None),
             Figure("", "", [intervals("error", "m", ["a", "b"], {"one": ([1.0, 2.0], [0.5, 1.0], [1.5, 3.0])}),
                             before_and_after("error", "m", ["a"], ("then", [1.0]), ("now", [0.5]))])]
    return [one for drawing in found if drawing is not None
            for one in (drawing.figures.values() if isinstance(drawing, Choice) else [drawing])]


def test_plotly_knows_every_word_of_every_picture(all_drawings):
    import plotly.graph_objects as graph_objects
    assert len(all_drawings) > 10
    for drawing in all_drawings:
        found = plain(json.loads(json.dumps(spec(drawing), allow_nan=False)))
        graph_objects.Figure({"data": found["data"], "layout": found["layout"]})  # refuses what it does not know


def test_an_interval_reaches_from_its_low_to_its_high_end():
    (trace,) = drawn(Mark("a", [1.0, 2.0, 3.0], [4.0, 5.0, None], low=[3.5, None, 1.0], high=[4.25, 6.0, 2.0]))["data"]
    assert trace["y"] == [4.0, 5.0, None]
    assert trace["error_y"]["array"] == [0.25, 1.0, 0.0]
    assert trace["error_y"]["arrayminus"] == [0.5, 0.0, 0.0]
    (trace,) = drawn(Mark("a", [2.0], [0.0], low=[1.0], high=[5.0], across=True))["data"]
    assert (trace["error_x"]["array"], trace["error_x"]["arrayminus"]) == ([3.0], [1.0])


def test_an_area_is_closed_around_its_ends_and_skips_gaps():
    t = np.array([0.0, 1.0, 2.0])
    band, line = drawn(Mark("a", t, [5.0, 5.0, 5.0], "area", low=[4.0, None, 3.0], high=[6.0, 6.0, 7.0]))["data"]
    assert list(zip(band["x"], band["y"], strict=True)) == [(0.0, 6.0), (2.0, 7.0), (2.0, 3.0), (0.0, 4.0)]
    assert (band["fill"], line["x"]) == ("toself", [0.0, 1.0, 2.0])


def test_a_bar_lies_from_its_start_to_its_end():
    found = drawn(Mark("a<b", [2.0], [0.0], "bars", high=[5.0]), y=Axis(rows=["x" * 60]))
    (trace,) = found["data"]
    assert (trace["base"], trace["x"], trace["orientation"]) == ([2.0], [3.0], "h")
    assert (trace["meta"], trace["name"]) == ("a<b", "a&lt;b")
    assert [len(text) for text in (*found["layout"]["yaxis"]["ticktext"], *found["panels"][0]["short"])] == [40, 18]


@pytest.mark.parametrize(("values", "ticks"), [([1.0, 1.5], None), ([1.0, 40.0], "D2"), ([1e-3, 9.0], 1)])
def test_a_logarithmic_axis_has_ticks_by_its_decades(values, ticks):
    axis = drawn(Mark("a", [1.0, 2.0], values), y=Axis("y", log=True, range=(0.1, 100.0)))["layout"]["yaxis"]
    assert (axis["type"], axis.get("dtick"), axis["range"]) == ("log", ticks, [-1.0, 2.0])


def test_panels_over_time_zoom_together_and_paths_keep_their_shape():
    t = [0.0, 0.5, 1.0]
    timed = Panel(Axis("time", "s"), Axis("z", "m"), [Mark("a", t, [1.0, 2.0, 3.0])], timed=True)
    path = Panel(Axis("x", "m"), Axis("y", "m"), [Mark("a", [0.0, 4.0], [0.0, 1.0], t=[0.0, 1.0])], equal=True)
    rows = Panel(Axis("time", "s"), Axis(rows=["a name of a row"]), [], timed=True)
    found = plain(spec(Figure("", "", [timed, path, rows])))
    assert (found["layout"]["xaxis3"]["matches"], "matches" in found["layout"]["xaxis"]) == ("x", False)
    assert (found["layout"]["yaxis2"]["scaleanchor"], found["panels"][1]["aspect"]) == ("x2", 0.25)
    assert found["panels"][0]["left"] == found["panels"][2]["left"] > 62.0  # one time axis above the other
    assert found["data"][1]["customdata"] == [0.0, 1.0]
