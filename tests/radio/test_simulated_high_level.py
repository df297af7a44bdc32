"""The high-level commander: boundary conditions of its polynomials, and its rules."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from still_vehicle import StillVehicle

from nanobench_tools.radio.crtp import Packet
from nanobench_tools.radio.simulated.high_level import Plan
from nanobench_tools.radio.simulated.onboard_services import Onboard
from nanobench_tools.radio.simulated.polynomial import Path, Point, at_rest, seventh_order, turn_to

NUMBER = st.floats(-5.0, 5.0)


@given(st.lists(NUMBER, min_size=6, max_size=6), st.floats(0.3, 8.0))
def test_the_polynomial_meets_both_ends_and_has_no_jerk_there(ends: list[float], duration_s: float) -> None:
    start, end = np.array(ends[:3]), np.array(ends[3:])
    p = np.polynomial.Polynomial(seventh_order(start, end, duration_s))
    scale = np.abs(ends).max() * max(1.0, duration_s**-3) + 1.0
    for t, wanted in ((0.0, start), (duration_s, end)):
        got = [p(t), p.deriv(1)(t), p.deriv(2)(t), p.deriv(3)(t)]
        assert got == pytest.approx([*wanted, 0.0], abs=1e-7 * scale)


def test_derivatives_of_a_path_are_those_of_finite_differences() -> None:
    still = np.zeros(3)
    start = Point(np.array([0.0, 1.0, 0.5]), 0.3, np.array([0.4, 0.0, -0.2]), np.array([0.1, 0.2, 0.0]), still, 0.1)
    path = Path.between(start, at_rest(np.array([1.0, -1.0, 1.5]), 2.0), 3.0)
    h = 1e-4
    for t in (0.4, 1.5, 2.7):
        before, here, after = path.at(t - h), path.at(t), path.at(t + h)
        assert (after.position_m - before.position_m) / (2 * h) == pytest.approx(here.velocity_m_s, abs=1e-6)
        assert (after.velocity_m_s - before.velocity_m_s) / (2 * h) == pytest.approx(here.acceleration_m_s2, abs=1e-6)
        assert (after.acceleration_m_s2 - before.acceleration_m_s2) / (2 * h) == pytest.approx(here.jerk_m_s3, abs=1e-5)
        assert (after.yaw_rad - before.yaw_rad) / (2 * h) == pytest.approx(here.yaw_rate_rad_s, abs=1e-6)
    assert path.at(99.0).velocity_m_s.tolist() == [0.0, 0.0, 0.0]


def test_backwards_and_stretched_paths() -> None:
    path = Path.between(at_rest(np.zeros(3), 0.0), at_rest(np.array([1.0, 0.0, 0.0]), 0.0), 2.0)
    slow = Path(path.pieces, path.durations_s, timescale=2.0)
    back = Path(path.pieces, path.durations_s, backwards=True)
    assert slow.duration_s == 4.0
    assert slow.at(2.0).position_m == pytest.approx(path.at(1.0).position_m)
    assert slow.at(2.0).velocity_m_s == pytest.approx(0.5 * path.at(1.0).velocity_m_s)
    assert back.at(0.0).position_m == pytest.approx([1.0, 0.0, 0.0])
    assert back.at(0.5).velocity_m_s == pytest.approx(-path.at(1.5).velocity_m_s)


@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
def test_yaw_turns_the_short_way(start: float, end: float) -> None:
    first, last = turn_to(start, end)
    assert abs(last - first) <= math.pi + 1e-9
    assert math.remainder(first - start, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert math.remainder(last - end, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.fixture
def onboard() -> Onboard:
    made = Onboard(StillVehicle())
    made.vehicle.turning = True
    made.vehicle.stabilizer.loop["estimate"]["position_m"][0] = (0.2, -0.3, 0.1)
    made.advance(1200)
    return made


def command(onboard: Onboard, form: str, *values) -> int:
    """Sends a command; the error in the answer."""
    data = struct.pack(form, *values)
    answer = onboard.receive(Packet(8, 0, data))[0].data
    assert len(answer) == 4
    assert answer[0] == data[0]
    return answer[3]


def target(onboard: Onboard) -> np.ndarray:
    return onboard.commander.setpoint["position_m"][0].astype(float)


def test_take_off_go_to_and_land(onboard: Onboard) -> None:
    assert command(onboard, "<BBff?f", 7, 0, 1.0, 0.0, True, 2.0) == 0
    onboard.advance(onboard.tick_ms + 1010)
    assert target(onboard) == pytest.approx((0.2, -0.3, 0.55), abs=0.02)
    onboard.advance(onboard.tick_ms + 1500)
    assert target(onboard) == pytest.approx((0.2, -0.3, 1.0), abs=1e-6)
    assert command(onboard, "<BBff?f", 7, 0, 1.0, 0.0, True, 2.0) == 1
    assert command(onboard, "<BB?fffff", 4, 0, True, 1.0, 0.0, 0.0, 1.0, 2.0) == 0
    onboard.advance(onboard.tick_ms + 2100)
    assert target(onboard) == pytest.approx((1.2, -0.3, 1.0), abs=1e-6)
    assert command(onboard, "<BBff?f", 8, 0, 0.0, 0.0, True, 1.0) == 0
    assert onboard.high_level.plan == Plan.LANDING
    onboard.advance(onboard.tick_ms + 1100)
    assert onboard.high_level.plan == Plan.IDLE
    assert onboard.commander.setpoint["mode_x"][0] == 0


def test_speeds_straight_lines_groups_and_stop(onboard: Onboard) -> None:
    assert command(onboard, "<BBf?f?f", 9, 0, 1.0, True, 0.0, True, 0.5) == 0
    onboard.advance(onboard.tick_ms + 2050)
    assert target(onboard)[2] == pytest.approx(1.1, abs=1e-6)
    assert command(onboard, "<BB??fffff", 12, 0, False, True, 2.2, -0.3, 1.1, 0.0, 2.0) == 0
    onboard.advance(onboard.tick_ms + 1010)
    assert onboard.commander.setpoint["velocity_m_s"][0, 0] == pytest.approx(1.0)
    assert command(onboard, "<BB", 0, 4) == 0
    assert command(onboard, "<BBff?f", 8, 2, 0.0, 0.0, True, 1.0) == 0
    assert onboard.high_level.plan == Plan.FLYING
    assert command(onboard, "<BB", 3, 0) == 0
    assert onboard.high_level.plan == Plan.IDLE
    assert command(onboard, "<BBff?f", 7, 0, math.nan, 0.0, True, 2.0) == 8
    assert command(onboard, "<B", 99) == 8


def test_a_stored_trajectory_is_flown_from_where_it_is(onboard: Onboard) -> None:
    piece = np.zeros((4, 8), "<f4")
    piece[0, 1], piece[2, 0] = 0.5, 1.0  # x = 0.5 t, z = 1
    raw = piece.tobytes() + struct.pack("<f", 2.0)
    for at in range(0, len(raw), 24):
        onboard.receive(Packet(4, 2, struct.pack("<BI", 0, at) + raw[at:at + 24]))
    assert command(onboard, "<BBBBIB", 6, 1, 1, 0, 0, 1) == 0
    assert command(onboard, "<BBBBIB", 6, 1, 1, 0, 4000, 1) == 8
    assert command(onboard, "<BB??Bf", 5, 0, True, False, 7, 1.0) == 8
    assert command(onboard, "<BB??Bf", 5, 0, True, False, 1, 2.0) == 0
    onboard.advance(onboard.tick_ms + 2010)
    assert target(onboard) == pytest.approx((0.7, -0.3, 0.1), abs=0.01)
    assert onboard.commander.setpoint["velocity_m_s"][0, 0] == pytest.approx(0.25)


def test_nothing_is_planned_while_motors_must_not_turn() -> None:
    made = Onboard(StillVehicle())
    made.supervisor.stop()
    made.advance(1500)
    assert command(made, "<BBff?f", 7, 0, 1.0, 0.0, True, 2.0) == 16


def test_a_setpoint_from_the_radio_ends_the_plan(onboard: Onboard) -> None:
    assert command(onboard, "<BBff?f", 7, 0, 1.0, 0.0, True, 2.0) == 0
    onboard.receive(Packet(7, 0, struct.pack("<B4f", 7, 0.0, 0.0, 1.0, 0.0)))
    assert onboard.high_level.plan == Plan.IDLE
