"""Cells of the tables at a terminal: nothing is said to scatter by nothing."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from nanobench_tools.metrics.statistics import summary
from nanobench_tools.protocols.published import MeanStd
from nanobench_tools.steps.options import Options
from nanobench_tools.steps.show import interval_text, ratio_text, say_reasons, score_text, sessions_text


@pytest.mark.parametrize(("values", "text"), [
    ([0.0188], "18.8"), ([0.0188, 0.0188, 0.0188], "18.8"), ([0.01, 0.03], "20.0 ± 10.0"),
    ([0.0188, 0.0188004], "18.8 ± 0.0002"), ([float("nan")], "-")])
def test_a_deviation_is_never_shown_as_zero(values, text):
    assert score_text(summary(values), 1e3, 1) == text


def test_a_published_value_keeps_its_deviation():
    assert score_text(MeanStd(0.02, 0.003), 1e3, 1) == "20.0 ± 3.0"
    assert score_text(MeanStd(0.02), 1e3, 1) == "20.0"


def test_what_has_no_interval_shows_none():
    assert interval_text(summary([1.0]), 1.0, 1) == "-"
    assert interval_text(summary([1.0, 2.0, 3.0], sessions=[4, 4, 4]), 1.0, 1) == "-"
    assert interval_text(replace(summary([1.0]), ci95=(1.0, 2.0)), 1.0, 1) == "1.0 .. 2.0"
    assert [sessions_text(n) for n in (4, None)] == ["4", "?"]
    assert ratio_text(0.93, [0.88, 0.99]) == "0.930 (0.880 .. 0.990)"
    assert [ratio_text(0.93, None), ratio_text(None, None)] == ["0.930", "-"]


@pytest.mark.parametrize(("verbose", "said"), [
    (True, ["left out: a: x", "left out: b: y", "left out: c: z"]),
    (False, ["left out: a: x", "left out: b: y", "left out: 1 more recording: --verbose"])])
def test_reasons_fit_a_screen(verbose, said):
    lines: list[str] = []
    say_reasons(SimpleNamespace(verbose=verbose, say=lines.append), [("a", "x"), ("b", "y"), ("c", "z")])
    assert lines == said


@pytest.mark.parametrize(("verbose", "lines"), [(False, 4), (True, 20)])
def test_many_failures_fit_a_screen(verbose, lines):
    options = Options(verbose=verbose, failed=[
        {"item": "read", "file": f"{k}.csv", "error": f"{k}.csv: not a recording; draft a map"} for k in range(20)])
    found = options.failures()
    assert len(found) == lines
    assert ("draft a map" in found[0]) is verbose
    assert verbose or found[-1] == "failed: 17 more; --verbose shows each, and what to do"
