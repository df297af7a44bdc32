"""The trim of a flight is found from the rows before the start, and from nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from identification.vehicle.trimmed_predictor import TrimmedPredictor
from nanobench_tools import so3
from nanobench_tools.methods import Past, Windows
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.hover import hover
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.physics.predictor import ModelPredictor
from nanobench_tools.physics.rollout import rollout

MODEL = Model(Vehicle(), {
    "thrust_voltage": {"c": (-0.004, 0.032, -0.0096, 0.0042)}, "motor_imbalance": {"g": (1.0,) * 4},
    "motor_lag": {"tau_up_s": 0.055, "tau_down_s": 0.119}, "command_delay": {"delay_s": 0.004},
    "inertia": {"inertia_kg_m2": (1.7e-5, 1.7e-5, 3.0e-5)}, "yaw_torque": {"k_m": 0.0068},
    "angular_damping": {"d_r": (2.2e-5, 2.2e-5, 3e-5)}, "drag_linear": {"d": (0.015, 0.015, 0.006)},
    "drag_torque": {"c": -6e-4}})
TRIM = np.array([0.05, -0.03, 0.02, -0.04])
PAST, HORIZON, N = 100, 50, 6
FLOWN = MODEL.with_term("motor_imbalance", g=tuple(1.0 + TRIM))


@pytest.fixture(scope="module")
def cut():
    """Windows of a vehicle that hovers with TRIM, and its states (N, PAST + HORIZON + 1, .)."""
    rng = np.random.default_rng(0)
    motor = np.array(hover(FLOWN).motor) + np.repeat(0.003 * rng.standard_normal((N, 15, 4)), 10, axis=1)
    battery = np.full(motor.shape[:2], 3.7)
    start = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (N, 1))
    states = rollout(FLOWN, start, motor, battery, (motor[:, :1], battery[:, :1]), row_hz=100.0)
    flown = states[:, :PAST]
    quaternion = flown[..., QUATERNION]
    force = np.gradient(states[..., VELOCITY], 0.01, axis=1)[:, :PAST] + np.array([0.0, 0.0, 9.81])
    force = so3.rotate_inverse(quaternion.reshape(-1, 4), force.reshape(-1, 3)).reshape(force.shape)
    past = Past(flown[..., POSITION], flown[..., VELOCITY], quaternion, flown[..., RATE], force, motor[:, :PAST],
                battery[:, :PAST], np.full(N, PAST))
    now = states[:, PAST]
    windows = Windows(now[:, POSITION], now[:, VELOCITY], now[:, QUATERNION], now[:, RATE], motor[:, PAST:],
                      battery[:, PAST:], 100.0, motor[:, 50:PAST], battery[:, 50:PAST], past)
    return windows, states


def test_the_trim_is_found(cut):
    found = TrimmedPredictor(MODEL, "trimmed").gains(cut[0])
    np.testing.assert_allclose(found, np.tile(TRIM, (N, 1)), atol=0.008)


def test_with_it_the_vehicle_predicts(cut):
    windows, states = cut
    error = {}
    for predictor in (ModelPredictor(MODEL), TrimmedPredictor(MODEL, "trimmed")):
        found = predictor.predict(windows).rate_rad_s[:, -1]
        error[predictor.name] = np.linalg.norm(found - states[:, -1, RATE], axis=1).mean()
    assert error["trimmed"] < 0.1 * error["physics"]


def test_nothing_later_than_the_start_is_looked_at(cut):
    windows = cut[0]
    predictor = TrimmedPredictor(MODEL, "trimmed")
    later = replace(windows, motor=windows.motor[:, ::-1] * 0.9, battery_V=windows.battery_V - 0.3)
    np.testing.assert_array_equal(predictor.gains(later), predictor.gains(windows))


def test_a_flight_that_had_not_begun_has_no_trim(cut):
    windows = cut[0]
    fresh = replace(windows, past=replace(windows.past, rows=np.zeros(N, int)))
    assert (TrimmedPredictor(MODEL, "trimmed").gains(fresh) == 0.0).all()


def test_a_log_without_an_accelerometer_has_a_trim_too(cut):
    windows = cut[0]
    blind = replace(windows, past=replace(windows.past, specific_force_m_s2=np.full((N, PAST, 3), np.nan)))
    np.testing.assert_allclose(TrimmedPredictor(MODEL, "trimmed").gains(blind), np.tile(TRIM, (N, 1)), atol=0.01)
