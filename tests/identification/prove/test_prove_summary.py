"""Rates over cases: worked by hand on few, and the exact interval against its definition."""

from dataclasses import replace

import pytest
from scipy.stats import binom

from identification.prove.score import CaseScore, EffectScore, FindingScore, IntervalScore
from identification.prove.summary import Share, TermError, calibration, confusion, power_by_term, summarise
from nanobench_tools.results.result import to_json


def case(kind, *effects, outcome="named", findings=(), foreign=(), truth=(), right=True, intervals=(), power=None,
         gained=None):
    """effects: (term, size, by whom named or None, below_power)."""
    return CaseScore(
        "case", kind, "practice", "", tuple(truth), outcome, tuple(term for term, _, _ in findings), None, right,
        any(not ok for _, ok, _ in findings), False, (),
        tuple(EffectScore(t, s, by is not None, by, by == t, 1, quiet) for t, s, by, quiet in effects),
        tuple(foreign), tuple(FindingScore(t, (), c, ok) for t, ok, c in findings), tuple(intervals), None, None,
        {"share_of_achievable": gained}, power or {}, 2.0)


def share(right, n):
    return Share.of(k < right for k in range(n))


CASES = [
    case("null", outcome="none"),
    case("null", findings=[("wind", False, 0.7)], right=False),
    case("single", ("wind", "large", "wind", False), findings=[("wind", True, 0.99)], gained=0.9, intervals=[
        IntervalScore("wind.w_m_s[0]", 1.0, None, 0.9, (0.8, 1.1), True),
        IntervalScore("wind.w_m_s[1]", 0.5, None, 0.8, (0.7, 0.9), False)]),
    case("twin", ("mass", "large", "thrust_scale", False), findings=[("thrust_scale", True, 0.97)], gained=0.7),
    case("single", ("mass", "small", None, True), outcome="none"),
    case("single", ("mass", "small", None, False), outcome="none", right=False),
    case("single", ("motor_lag", "medium", None, False), findings=[("command_delay", False, 0.96)], right=False),
    case("pair", ("wind", "large", "wind", False), ("inflow", "large", None, False),
         findings=[("wind", True, 0.93), ("inertia", False, 0.5), ("yaw_torque", False, 0.5)], right=False),
    case("foreign", outcome="unknown", foreign=["jet"], truth=["jet"]),
    case("foreign", outcome="none", foreign=["jet"], truth=["jet"], right=False),
    case("fault", outcome="data_fault", truth=["spike"])]


def test_rates():
    found = summarise(CASES)
    assert (found.cases, found.right, found.false_names) == (11, 6, 3)
    assert found.false_name_rate == pytest.approx(3 / 11)
    assert found.recall_by_size == {"small": 0.5, "medium": 0.0, "large": 1.0}
    assert found.details.recall_by_size["small"].below_power == 1
    assert found.unknown_on_foreign == 0.5
    assert found.coverage95 == 0.5
    assert found.share_of_achievable == pytest.approx(0.8)
    assert found.pairs.both.right == 0
    assert (found.pairs.one, found.pairs.none) == (1, 0)
    assert found.by_kind["null"].false_names.right == 1
    assert found.by_kind["fault"].outcomes == {"data_fault": 1}
    assert (found.classes.exactly, found.classes.mean_size) == (share(2, 3), 1.0)
    assert found.parameter_error["wind"] == TermError(2, pytest.approx(0.35))
    assert found.abstained.right == 0
    assert found.by_engine["practice"].false_names == share(3, 11)
    assert len(repr(found)) < 400


def test_a_kind_has_the_keys_of_what_it_was_asked():
    kinds = to_json(summarise([*CASES, replace(CASES[0], kind="change", flights_right=True)]))["by_kind"]
    assert list(kinds["change"]) == ["n", "right", "share", "ci95", "false_names", "outcomes", "flights_right"]
    assert list(kinds["null"]) == ["n", "right", "share", "ci95", "false_names", "outcomes"]


def test_confusion_counts_every_effect_and_every_false_name_once():
    assert confusion(CASES) == {
        "fault spike": {"data_fault": 1}, "foreign jet": {"unknown": 1, "none": 1}, "inflow": {"inertia": 1},
        "mass": {"none": 2, "thrust_scale": 1}, "motor_lag": {"command_delay": 1},
        "nothing": {"none": 1, "wind": 1, "yaw_torque": 1}, "wind": {"wind": 2}}


def test_calibration_groups_findings_by_what_they_state():
    assert calibration(CASES) == [(0.5, 0.0, 2), (0.7, 0.0, 1), (0.93, 1.0, 1), (pytest.approx(2.92 / 3), 2 / 3, 3)]


def test_interval_is_where_either_tail_is_a_fortieth():
    found = share(3, 20)
    low, high = found.ci95
    assert binom.sf(2, 20, low) == pytest.approx(0.025, rel=1e-4)
    assert binom.cdf(3, 20, high) == pytest.approx(0.025, rel=1e-4)
    assert share(0, 60).ci95 == (0.0, pytest.approx(1.0 - 0.025 ** (1 / 60)))
    assert share(0, 0) == Share(0, 0, None, None)


def test_power_by_term():
    stated = [{"mass": {"minimum_detectable": x, "unit": "kg"}} for x in (1e-3, 2e-3, None)]
    found = power_by_term([*CASES, *(case("null", outcome="none", power=p) for p in stated)])
    assert found["mass"].minimum_detectable == pytest.approx(1.5e-3)
    assert found["mass"].small.below_power == 1
    assert found["mass"].large.named == 1
    assert list(to_json(found["wind"])) == ["large", "minimum_detectable", "unit"]
    assert found["wind"].minimum_detectable is None


def test_no_case_at_all():
    found = summarise([])
    assert found.false_name_rate is None
    assert found.calibration == []
