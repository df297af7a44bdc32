"""Motors against the turning that they cause: their order, a gyro that no attitude judges, and single units."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults import axis_swap, sign, unit
from nanobench_tools.signals.context import Context


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd.log("fast figure_eight")[0].without_streams("mocap")


@pytest.fixture(scope="module")
def alone(flown):
    return flown.without_streams("attitude", "attitude_qw", "pid", "estimator", "estimator_acc")


def _read_as(flight, stream, quantities, change):
    values = flight[stream].values.copy()
    at = [flight[stream].index(q) for q in quantities]
    values[:, at] = change(values[:, at])
    return flight.with_streams(**{stream: replace(flight[stream], values=values)})


def _quantities(fault, flight):
    return tuple(flight[fault.stream].quantities[flight[fault.stream].columns.index(c)] for c in fault.columns)


def test_right_motors_and_gyro_are_no_finding(flown, alone):
    for flight in (flown, alone):
        assert [kind.find(flight, Context(flight)) for kind in (sign, axis_swap, unit)] == [[], [], []]


@pytest.mark.parametrize("pair", [("m1", "m2"), ("m2", "m4")])
def test_motors_that_changed_places(flown, pair):
    bad = _read_as(flown, "motor", pair, lambda v: v[:, ::-1])
    (fault,) = axis_swap.find(bad, Context(bad))
    assert _quantities(fault, bad) == pair


def test_without_attitude_a_negated_gyro_is_found_by_the_motors(alone):
    bad = _read_as(alone, "imu", ["gyro_x"], np.negative)
    (fault,) = sign.find(bad, Context(bad))
    assert _quantities(fault, bad) == ("gyro_x",)
    assert "or the motors are in another order" in fault.evidence


def test_without_attitude_one_axis_of_the_gyro_in_degrees(alone):
    bad = _read_as(alone, "imu", ["gyro_y"], np.rad2deg)
    (fault,) = unit.find(bad, Context(bad))
    assert _quantities(fault, bad) == ("gyro_x", "gyro_y")
    assert "deg" in fault.evidence


@pytest.mark.parametrize("factor", [65535.0, 0.01])
def test_one_motor_in_another_unit_is_named_alone(flown, factor):
    bad = _read_as(flown, "motor", ["m3"], lambda v: factor * v)
    (fault,) = unit.find(bad, Context(bad))
    assert _quantities(fault, bad) == ("m3",)


def test_a_negated_motor(flown):
    bad = _read_as(flown, "motor", ["m2"], np.negative)
    (fault,) = sign.find(bad, Context(bad))
    assert _quantities(fault, bad) == ("m2",)


def test_a_motor_that_a_dead_log_carries_below_zero_is_not_negated(flown):
    """Rows after the last packet run along a straight line."""
    bad = _read_as(flown, "motor", ["m2"], lambda v: np.where(np.arange(len(v))[:, None] < len(v) // 3, v, -np.abs(v)))
    assert "m2 of motor is below 0" not in " ".join(f.evidence for f in sign.find(bad, Context(bad)))
