"""What Task 3 gives to an estimator, and to one that was logged in flight."""

from dataclasses import replace

import numpy as np
import pytest
from cases_of_task3 import EKF, one_case, poses
from made_flights import dead, made_flight

from estimators.constant_velocity import ConstantVelocity
from estimators.hold_position import HoldPosition
from estimators.onboard_ekf import OnboardEkf
from nanobench_tools import InputError
from nanobench_tools.flight import Span
from nanobench_tools.protocols import task3


def test_what_an_estimator_is_given():
    flight = made_flight()
    case = one_case(flight, dead("imu", 18.0))
    given = task3.given_to(replace(case, spans=(Span(3.0, 18.0),)))
    assert given["mocap"].quantities == task3.POSE
    assert given["mocap"].span.end_s == pytest.approx(3.5)
    assert given["imu"].span.end_s == pytest.approx(18.0)
    assert given.span.end_s == pytest.approx(18.0)


@pytest.mark.parametrize("method", [HoldPosition(), ConstantVelocity()])
def test_bending_the_truth_after_the_given_part_changes_no_estimate(method):
    flight = made_flight()
    mocap = flight["mocap"]
    bent = mocap.values.copy()
    bent[mocap.time_s > 3.8] += 5.0
    other = flight.with_streams(mocap=replace(mocap, values=bent))
    a, b = (method.estimate(task3.given_to(one_case(f))) for f in (flight, other))
    assert np.array_equal(a.position_m, b.position_m)
    assert np.array_equal(a.quaternion, b.quaternion)


def test_the_floors_do_what_they_say():
    flight = made_flight()
    given = task3.given_to(one_case(flight))
    held, straight = HoldPosition().estimate(given), ConstantVelocity().estimate(given)
    last = given["mocap"].span.end_s
    later = held.time_s > last
    assert np.ptp(held.position_m[later], axis=0) == pytest.approx([0, 0, 0])
    climbing = straight.position_m[later][:, 2]
    assert np.diff(climbing) == pytest.approx(0.005, abs=2e-4)  # it was climbing at 0.5 m/s


class PretendsToBeLogged(OnboardEkf):
    """Gives back whatever motion capture it gets and calls itself logged in flight."""

    def __init__(self):
        self.seen = []

    def estimate(self, flight):
        self.seen.append(flight)
        return poses(flight["mocap"])

    def logged_euler(self, flight):
        self.seen.append(flight)
        return flight["mocap"]["roll", "pitch", "yaw"]


class Watched(OnboardEkf):
    def estimate(self, flight):
        assert "mocap" not in flight
        return super().estimate(flight)

    def logged_euler(self, flight):
        assert "mocap" not in flight
        return super().logged_euler(flight)


@pytest.mark.parametrize("protocol", task3.PROTOCOLS)
def test_who_calls_itself_logged_sees_no_more_than_others(protocol):
    flight = made_flight()
    case = one_case(flight, protocol=protocol)
    cheat = PretendsToBeLogged()
    with pytest.raises(InputError, match=r"covers 0\.0 % of it"):
        task3.score(case, cheat, protocol)
    for seen in cheat.seen:
        assert seen["mocap"].quantities == task3.POSE
        assert seen["mocap"].span.end_s <= case.spans[0].start_s + task3.GIVEN_S
    mocap = flight["mocap"]
    cheat.estimate = lambda given: poses(mocap)
    row = task3.tabulate(protocol, cheat, [(case, task3.score(case, cheat, protocol))])[0]
    assert row.given.startswith(task3.GIVEN)
    assert row.published is None


@pytest.mark.parametrize("protocol", task3.PROTOCOLS)
def test_what_was_logged_is_scored_without_any_motion_capture(protocol, monkeypatch):
    case = one_case(made_flight(), protocol=protocol)
    expected = task3.score(case, EKF, protocol)
    monkeypatch.setattr(task3, "OnboardEkf", Watched)
    found = task3.score(case, Watched(), protocol)
    assert found.metrics == pytest.approx(expected.metrics, nan_ok=True)
    assert found.rows == expected.rows
