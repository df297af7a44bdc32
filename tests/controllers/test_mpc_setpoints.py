"""What a plan says to a vehicle's own loops: units, signs, and that they fly it."""

import numpy as np
import pytest

from controllers.mpc_linear import MpcDaqp
from controllers.mpc_setpoints import OverRadio, Setpoints, records, setpoints
from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.firmware.records import ABSOLUTE, DISABLED, VELOCITY
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.flying import fly
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.timeline import Events

TURN = so3.exp(np.array([[0.0, 0.0, 0.5]]))
FOUND = Setpoints(np.array([[1.0, 2.0, 3.0]]), np.array([[0.1, 0.2, 0.3]]), np.array([[0.4, 0.5, 0.6]]), TURN,
                  np.radians([[10.0, 20.0, 30.0]]), np.full((1, 4), 0.1))


def test_rates_are_in_degrees_with_the_cascades_pitch_and_thrust_in_counts():
    record = records(FOUND, "rates", np.array([40_000.0]))[0]
    np.testing.assert_allclose(record["rate_deg_s"], [10.0, -20.0, 30.0], rtol=1e-6)
    assert record["thrust"] == 40_000.0
    assert (record["mode_roll"], record["mode_yaw"], record["mode_z"]) == (VELOCITY, VELOCITY, DISABLED)


def test_velocities_and_full_states_say_what_is_planned():
    record = records(FOUND, "velocity", np.zeros(1))[0]
    np.testing.assert_allclose(record["velocity_m_s"], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(record["rate_deg_s"][2], 30.0, rtol=1e-6)
    assert record["mode_x"] == VELOCITY
    record = records(FOUND, "full_state", np.zeros(1))[0]
    for name, value in (("position_m", [1.0, 2.0, 3.0]), ("acceleration_m_s2", [0.4, 0.5, 0.6]),
                        ("quaternion", TURN[0]), ("rate_deg_s", [10.0, 20.0, 30.0])):
        np.testing.assert_allclose(record[name], value, rtol=1e-5)
    assert (record["mode_x"], record["mode_quat"]) == (ABSOLUTE, ABSOLUTE)


def test_set_points_are_the_plans_future():
    mpc = MpcDaqp()
    mpc.reset(1)
    zero = np.zeros((1, 3))
    state = VehicleState(zero, zero, np.array([[0.0, 0.0, 0.0, 1.0]]), zero, np.full(1, 3.6))
    mpc.command(0.0, state, Reference(np.array([[0.2, 0.0, 0.1]]), np.zeros(1), zero, zero))
    now, later = setpoints(mpc, 0.0), setpoints(mpc, 0.3)
    np.testing.assert_allclose(now.position_m, 0.0, atol=1e-9)
    assert later.position_m[0, 0] > 0.005
    assert later.velocity_m_s[0, 0] > 0.05
    assert setpoints(mpc, 0.1).rate_rad_s[0, 1] > 0.1  # it tips forward first
    slope = (setpoints(mpc, 0.301).position_m - later.position_m) / 0.001
    np.testing.assert_allclose(slope, later.velocity_m_s, atol=5e-3)


def test_the_firmwares_cascade_flies_rates():
    spec = path_spec("figure_eight", "slow", duration_s=2.5)
    flown = fly(OverRadio("rates"), [spec], seed=3, spread=0.0, events=[Events(0.1, 2.7, 5.2, 5.3, 5.3)])
    ticks = np.arange(400, 450)
    gap = flown.truth["position_m"][ticks, 0] - spec.at(flown.time_s[ticks] - 2.7).position_m
    assert np.sqrt(np.mean(np.sum(gap**2, axis=1))) < 0.1


def test_an_unknown_output_is_refused_in_one_line():
    with pytest.raises(UsageError, match="unknown output 'thrust'; known: rates, velocity"):
        OverRadio("thrust")
