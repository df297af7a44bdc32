"""Noise alone is no moving clock: simulated flights with a perfect clock, and with one that moves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.moving.confirm import believed
from nanobench_tools.time_offsets.moving.infer import infer

STEP_S = 0.0025
G = np.array([0.0, 0.0, 9.81])


def flown(rate_hz, seed, gyro_rad_s, wander_s=0.0):
    """Poses and IMU of a figure of 12 s, at one rate, with noise."""
    t = np.arange(0.0, 12.0, STEP_S)
    ramp = np.clip((t - 1.0) / 1.5, 0.0, 1.0) * np.clip((11.0 - t) / 1.5, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    p = np.stack([ramp * np.sin(1.5 * t), 0.7 * ramp * np.sin(2.5 * t), ramp], axis=1)
    up = np.gradient(np.gradient(p, STEP_S, axis=0), STEP_S, axis=0) + G
    force = np.linalg.norm(up, axis=1, keepdims=True)
    left = np.cross(up / force, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up / force), left, up / force], axis=2))
    rate = np.vstack([(turn[:-1].inv() * turn[1:]).as_rotvec() / STEP_S, np.zeros(3)])
    rng, rows = np.random.default_rng(seed), slice(None, None, round(1.0 / rate_hz / STEP_S))
    t, p, q, rate, force = t[rows], p[rows], turn.as_quat()[rows], rate[rows], force[rows]
    poses = np.hstack([p, q]) + np.array([3e-4] * 3 + [7e-4] * 4) * rng.standard_normal((len(t), 7))
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    noise = np.array([gyro_rad_s] * 3 + [0.1] * 3) * rng.standard_normal((len(t), 6))
    imu = np.hstack([rate, np.zeros_like(rate)]) + noise
    imu[:, 5] += force[:, 0]
    late = t + wander_s * np.sin(2.0 * np.pi * t / 1.7)
    inertial = ("gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z")
    return Flight("f", {"mocap": make_stream("mocap", t, poses, ("px", "py", "pz", "qx", "qy", "qz", "qw")),
                        "imu": make_stream("imu", late, imu, inertial)}, {}, None)


@pytest.mark.parametrize("rate_hz", [40.0, 100.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_noisy_gyro_on_a_perfect_clock(rate_hz, seed):
    found = believed(Context(flown(rate_hz, seed, 0.3)), ("gyro", "acceleration"))
    assert found is not None
    assert not found.moving
    assert found.wander_sd_s == 0.0


@pytest.mark.parametrize("bias_rad_s", [0.05, 0.3])
def test_a_gyro_with_a_bias_on_a_perfect_clock(bias_rad_s):
    """The constant error of a gyro that was not calibrated passes for time where it is not removed."""
    flight = flown(100.0, 1, 0.02)
    imu = flight["imu"]
    biased = imu.values + bias_rad_s * np.array([1.0, -0.5, 0.2, 0.0, 0.0, 0.0])
    found = infer(Context(flight.with_streams(imu=replace(imu, values=biased))), ("gyro", "acceleration"))
    assert found.log_ratio < 20.0


def test_the_likelihood_alone_prefers_a_moving_clock():
    """What the test above would miss if the noise were too small to matter."""
    assert max(infer(Context(flown(40.0, seed, 0.3)), ("gyro", "acceleration")).log_ratio for seed in range(3)) > 0.0


def test_a_clock_that_moves_by_30_ms():
    found = believed(Context(flown(100.0, 1, 0.05, 0.03)), ("gyro", "acceleration"))
    assert found.moving
    assert 0.01 < found.wander_sd_s < 0.03
