"""A recording whose link was lost in flight shows whether the vehicle landed or fell; a busy computer is no clock."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.auditing.audit_verdict import verdict_of
from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.cli.flights.recorded_flight import load_line
from nanobench_tools.flight import Fault, Flight, Provenance, make_stream
from nanobench_tools.radio.record_export import lost_link

TIME_S = np.arange(0.0, 6.0, 0.01)
LOST_S = 3.0


def ended(height_m, roll_rad=0.0, logged_s: float = LOST_S, until_s: float = 6.0) -> dict:
    """Of a flight at 1 m that goes on with ``height_m(seconds after the loss)``, with noise of a tracker."""
    t = TIME_S[until_s >= TIME_S]
    after = np.maximum(t - LOST_S, 0.0)
    z = np.where(t < 1.0, t, np.maximum(np.array([height_m(s) for s in after]), 0.0))
    place = np.column_stack([0.1 * t, 0.0 * t, z]) + 2e-4 * np.random.default_rng(0).normal(size=(len(t), 3))
    turn = so3.from_euler_zyx(np.where(after > 1.0, roll_rad, 0.0), 0.0 * t, 0.0 * t)
    return lost_link(t, place, turn, logged_s)


def test_a_slow_descent_is_a_landing_and_a_fast_one_a_fall():
    landed = ended(lambda s: 1.0 - 0.5 * s)
    assert landed == {"how": "landed", "height_m": pytest.approx(1.0, abs=0.01),
                      "sank_m_s": pytest.approx(0.5, abs=0.05)}
    fell = ended(lambda s: 1.0 - 4.9 * max(s - 1.0, 0.0)**2)
    assert fell["how"] == "fell"
    assert 3.0 < fell["sank_m_s"] < 4.6
    assert ended(lambda s: 1.0 - 0.5 * s, roll_rad=2.0)["how"] == "fell"


def test_an_end_that_nobody_saw_is_unknown_and_a_landing_before_the_end_of_the_log_is_no_loss():
    assert ended(lambda s: 1.0)["how"] == "unknown"
    assert ended(lambda s: 1.0, until_s=LOST_S - 0.001)["why"] == "no poses after it"
    assert ended(lambda s: 1.0 - 0.5 * s, logged_s=5.8) == {}
    assert lost_link(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 4)), 1.0) == {}


def small(sheet: dict) -> Flight:
    t = np.arange(0.0, 3.0, 0.01)
    z = np.minimum(t, 1.0)
    stream = make_stream("estimator", t, np.column_stack([0.0 * t, 0.0 * t, z]), ("x", "y", "z"), ("x", "y", "z"))
    return Flight("f", {"estimator": stream}, sheet, Provenance("f", "", "radio"))


@pytest.mark.parametrize(("found", "words"), [
    ({"how": "fell", "height_m": 1.02, "sank_m_s": 4.1},
     "lost 1.02 m above the ground, and the vehicle fell with 4.1 m/s"),
    ({"how": "landed", "height_m": 1.0, "sank_m_s": 0.6}, "and the vehicle landed with 0.6 m/s at most"),
    ({"how": "unknown", "height_m": 1.0, "why": "no poses after it"}, "its end is unknown (no poses after it)"),
    ({"how": "fell"}, "lost an unknown height above the ground, and the vehicle fell"),
    ("odd", ""), (None, "")])
def test_the_verdict_has_the_end_of_the_flight(found, words):
    sheet = {} if found is None else {"recorder": {"lost_link": found}}
    recording = audit(small(sheet))
    judged = verdict_of(recording)
    assert ("above the ground" in judged.sentence) == bool(words)
    assert words in judged.sentence
    assert Audit.from_json(recording.to_json()).lost_link == recording.lost_link
    fine = replace(recording, faults=(), clean=(recording.span,))
    assert verdict_of(fine).severity == ("minor" if words else "fine")


@pytest.mark.parametrize(("late_ms", "words"), [(0.2, "is not the load of this"), (12.0, "may be the load of")])
def test_a_clock_error_is_compared_with_the_lateness_of_the_loop(late_ms, words):
    sheet = {"recorder": {"loop": {"late_p99_ms": late_ms, "late_most_ms": 2.0 * late_ms}}}
    found = audit(small(sheet))
    assert load_line(sheet, found) == ""
    wander = Fault("clock_wander", "imu", (), 0.0, 3.0, 0.020, "s", "moves", 0.004)
    moving = replace(found, faults=(*found.faults, wander))
    assert words in load_line(sheet, moving)
    assert "20.0 ms" in load_line(sheet, moving)
    assert load_line({}, moving) == ""
