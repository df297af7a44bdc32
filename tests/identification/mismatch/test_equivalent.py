"""A simulator that is only a callable: its own residual is judged, through terms that give the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MASS_KG, MODEL, C, wrench_of

from identification.mismatch.diagnosis import diagnose_callable
from identification.mismatch.equivalent import along, equivalent, needs_battery
from identification.mismatch.recordings import Recordings
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.physics import Vehicle

INERTIA = np.array([1.8e-5, 1.8e-5, 3.1e-5])
DRAG = np.array([0.016, 0.016, 0.006])
VEHICLE = Vehicle(mass_kg=MASS_KG)


def flown(drag=DRAG, c=C, push=None, tau_s=0.04):
    """MODEL's equations, written once more."""
    def accelerations(at):
        asked = np.sum([c[k] * (at.motor * at.battery_V[:, None]) ** k for k in range(3)], axis=0)
        lift, now = np.empty_like(asked), asked[0]
        for row, goal in enumerate(asked):
            lift[row] = now
            now = goal + (now - goal) * np.exp(-at.row_s / tau_s)
        velocity = np.einsum("nji,nj->ni", at.rotation, at.velocity_m_s)
        force = lift.sum(axis=1)[:, None] * [0.0, 0.0, 1.0] - drag * velocity
        if push is not None:
            force = force + push(at)
        torque = np.stack([0.0325 * lift @ [-1, -1, 1, 1], 0.0325 * lift @ [-1, 1, 1, -1],
                           0.006 * lift @ [-1, 1, -1, 1]], axis=1)
        torque -= np.cross(at.rate_rad_s, INERTIA * at.rate_rad_s)
        return force / MASS_KG, torque / INERTIA

    return accelerations


@pytest.fixture(scope="module")
def recordings():
    tracks = tuple(wrench_of(MODEL, flights=2).tracks)
    flights = tuple(Flight(t.name, {}, {}, Provenance(f"{t.name}.csv", "", "test")) for t in tracks)
    return Recordings(flights, {}, tracks, (), {})


@pytest.mark.slow
def test_a_callable_that_gives_no_turning_is_judged_by_its_force(recordings):
    def lift_and_drag(at, drag=DRAG):
        force, turning = flown(drag)(at)
        return force, np.zeros_like(turning)

    right = diagnose_callable(recordings, lift_and_drag, "mine", vehicle=VEHICLE)
    assert right.body["outcome"] == "none"
    assert {e["term"] for e in right.body["not_asked"]} >= {"inertia", "yaw_torque", "motor_imbalance"}
    assert "the simulator gives no angular acceleration" in right.paragraph
    wrong = diagnose_callable(recordings, lambda at: lift_and_drag(at, 0.0 * DRAG), "mine", vehicle=VEHICLE)
    (found,) = wrong.body["findings"]
    assert "drag_linear" in (found["term"], *found["equivalent"])


def test_a_right_callable_has_no_mismatch(recordings):
    verdict = diagnose_callable(recordings, flown(), "mine", vehicle=VEHICLE)
    assert verdict.body["outcome"] == "none"
    assert verdict.paragraph.startswith("mine was evaluated")
    said = verdict.body["simulator"]
    assert said["alike"]
    assert said["force_share"] < 0.01
    assert said["angular_share"] < 0.05  # commands of these tracks reach above 1, where the equivalent saturates
    assert verdict.believed.parameters["motor_lag.tau_up_s"] == pytest.approx(0.04, rel=0.02)
    assert verdict.believed.parameters["drag_linear.d[0]"] == pytest.approx(0.016, rel=0.02)


@pytest.mark.slow
def test_what_a_callable_lacks_is_named(recordings):
    verdict = diagnose_callable(recordings, flown(drag=0.25 * DRAG), "mine", vehicle=VEHICLE)
    finding, = verdict.body["findings"]
    assert finding["term"] == "drag_linear"
    drag = finding["parameters"]["drag_linear.d[0]"]
    assert drag["believed"] == pytest.approx(0.004, rel=0.05)
    assert drag["value"] == pytest.approx(0.016, rel=0.1)
    assert verdict.believed is not None
    assert verdict.corrected is not None


def test_a_callable_like_no_terms_gets_no_name(recordings):
    swings = flown(push=lambda at: 0.06 * np.sin(3.0 * at.time_s)[:, None] * [1.0, 0.0, 0.0])
    verdict = diagnose_callable(recordings, swings, "mine", vehicle=VEHICLE)
    assert (verdict.body["outcome"], verdict.body["findings"]) == ("unknown", [])
    assert verdict.body["unknown"]["where"]["axes"] == ["force x"]
    assert not verdict.body["simulator"]["alike"]
    assert "no effect can be identified" in verdict.paragraph


def test_too_little_flight_is_not_fitted(recordings):
    short = replace(recordings, tracks=(replace(recordings.tracks[0], counts=np.arange(2000) < 500),))
    assert diagnose_callable(short, lambda at: 1 / 0, "mine").body["outcome"] == "insufficient"


def test_who_looks_at_the_battery(recordings):
    assert not needs_battery(lambda at: flown()(replace(at, battery_V=np.full(len(at), 3.7))),
                             recordings.tracks[0], "m")


def test_a_callable_may_write_into_what_it_is_given(recordings):
    before = recordings.tracks[0].motor.copy()
    along(recordings.tracks[0]).motor[:] = 7.0
    np.testing.assert_array_equal(recordings.tracks[0].motor, before)


@pytest.mark.parametrize(("wrong", "words"), [
    (lambda at, f, t: (f / 9.81, t), "is it in g"),
    (lambda at, f, t: (10.0 * f, t), "another vehicle"),
    (lambda at, f, t: (f * MASS_KG, t), "divide it by the mass"),
    (lambda at, f, t: (-f, t), "is z down"),
    (lambda at, f, t: (so3.rotate(at.quaternion, f) - [0.0, 0.0, 9.81], t), "is gravity in it"),
    (lambda at, f, t: (f, np.degrees(t)), "is it in degrees"),
    (lambda at, f, t: (f, INERTIA * t), "divide it by the inertia"),
    (lambda at, f, t: (f, 0.0 * t), "does it look at the motors"),
    (lambda at, f, t: (f, -t), "turns against what flew"),
])
def test_other_units_and_axes_are_one_line(recordings, wrong, words):
    right = flown()
    with pytest.raises(InputError, match=words):
        equivalent(recordings, lambda at: wrong(at, *right(at)), "mine")
