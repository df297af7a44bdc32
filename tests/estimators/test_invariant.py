"""The invariant filter against plain matrices, the group's exponential, and runs it is told the truth about."""

from typing import ClassVar

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from estimators import invariant_ekf
from estimators.inertial_core import SETTINGS
from estimators.invariant_ekf import InvariantEkf
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.metrics.consistency import normalised_squared
from nanobench_tools.units import GRAVITY_M_S2

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
GRAVITY = np.array([0.0, 0.0, -GRAVITY_M_S2])
HZ = 100.0


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def test_the_compiled_step_against_plain_matrices():
    rng = np.random.default_rng(2)
    a = rng.normal(size=(18, 18))
    cov, dt, rot = a @ a.T, 0.013, Rotation.random(rng=rng).as_matrix()
    v, p = rng.normal(size=(2, 3))
    adjoint = np.block([[rot, np.zeros((3, 3))], [skew(v) @ rot, rot], [skew(p) @ rot, np.zeros((3, 3))]])
    step = np.eye(18)
    step[3:6, 0:3] = skew(GRAVITY) * dt
    step[6:9, 0:3] = 0.5 * skew(GRAVITY) * dt**2
    step[6:9, 3:6] = dt * np.eye(3)
    step[0:9, 9:15] = -adjoint * dt
    half, full = np.empty((18, 18)), np.empty((18, 18))
    invariant_ekf._transition(cov, half, dt, rot, skew(v) @ rot, skew(p) @ rot)
    invariant_ekf._transition(half, full, dt, rot, skew(v) @ rot, skew(p) @ rot)
    assert np.allclose(full, step @ cov @ step.T, atol=1e-9)
    invariant_ekf._noise(full, 0.3, 0.2, 0.7, rot, skew(v) @ rot, skew(p) @ rot)
    noise = np.zeros((18, 18))
    noise[:9, :9] = adjoint @ np.diag([0.3, 0.3, 0.3, 0.2, 0.2, 0.7]) @ adjoint.T
    assert np.allclose(full, step @ cov @ step.T + noise, atol=1e-9)


@pytest.mark.slow
def test_what_is_given_out_is_the_spread_of_drawn_states():
    """Errors of SE_2(3) drawn, put on by the group's exponential: position, velocity and body attitude scatter so."""
    rng = np.random.default_rng(3)
    a = 0.002 * rng.normal(size=(9, 9))
    cov = np.zeros((18, 18))
    cov[:9, :9] = a @ a.T
    rotation = Rotation.from_rotvec([0.4, -0.3, 1.1])
    v, p = np.array([1.0, -0.5, 0.3]), np.array([2.0, -1.0, 1.5])
    state = np.eye(5)
    state[:3, :3], state[:3, 3], state[:3, 4] = rotation.as_matrix(), v, p
    found = []
    for xi in rng.multivariate_normal(np.zeros(9), cov[:9, :9], 4_000):
        algebra = np.zeros((5, 5))
        algebra[:3, :3], algebra[:3, 3], algebra[:3, 4] = skew(xi[:3]), xi[3:6], xi[6:9]
        moved = expm(algebra) @ state
        turn = rotation.inv() * Rotation.from_matrix(moved[:3, :3])
        found.append(np.concatenate([moved[:3, 4] - p, moved[:3, 3] - v, turn.as_rotvec()]))
    half, out = np.empty((9, 9)), np.empty((9, 9))
    invariant_ekf._given_out(cov, half, p, v, rotation.as_matrix())
    invariant_ekf._given_out(half, out, p, v, rotation.as_matrix())
    drawn = np.cov(np.array(found).T)
    size = np.sqrt(np.diag(out))
    assert np.abs((drawn - out) / np.outer(size, size)).max() < 0.08


class Told(InvariantEkf):
    """Told the noise of the runs below."""

    name = "told"
    settings: ClassVar = {**SETTINGS, "gyro_noise": 0.01, "acc_noise": 0.05, "vertical_noise": 0.05, "gyro_walk": 1e-4,
                          "acc_walk": 1e-3, "position_sd": 0.01, "roll_pitch_sd": 0.02, "pitch_sd": 0.02,
                          "yaw_sd": 0.02, "drag": 0.0, "stamp": 0.0, "acc_bias_sd": 0.1, "acc_bias_z_sd": 0.1,
                          "gyro_bias_sd": 0.01, "mount_sd": 1e-6, "start_tilt_sd": 0.02, "start_velocity_sd": 0.5}


def run(seed, seconds=20.0):
    """A path of sines, its IMU and poses with the noise of ``Told``, and the true positions: poses ten times a second
    for three quarters of the time, none afterwards."""
    rng, s = np.random.default_rng(seed), Told.settings
    t = np.arange(0.0, seconds, 1.0 / HZ)
    w = np.array([0.9, 0.7, 0.5])
    p = np.sin(np.outer(t, w)) * [1.0, 1.5, 0.4] + [0.0, 0.0, 2.0]
    acceleration = -(w**2) * (np.sin(np.outer(t, w)) * [1.0, 1.5, 0.4])
    turns = Rotation.from_rotvec(np.stack([0.2 * np.sin(t), 0.15 * np.cos(0.8 * t), 0.5 * t], axis=1))
    rate = (turns[:-1].inv() * turns[1:]).as_rotvec() * HZ
    rate = np.vstack([rate, rate[-1:]])
    gyro = np.vstack([rate[:1], 0.5 * (rate[1:] + rate[:-1])])
    force = turns.inv().apply(acceleration - GRAVITY)
    for signal, name in ((force, "acc"), (gyro, "gyro")):
        walk = np.cumsum(rng.normal(0.0, s[f"{name}_walk"] / np.sqrt(HZ), p.shape), axis=0)
        signal += rng.normal(0.0, s[f"{name}_bias_sd"], 3) + walk
        signal += rng.normal(0.0, s[f"{name}_noise"] * np.sqrt(HZ), p.shape)
    rows = np.arange(0, int(0.75 * len(t)), 10)
    seen = (turns[rows] * Rotation.from_rotvec(rng.normal(0.0, s["yaw_sd"], (len(rows), 3)))).as_quat()
    poses = np.column_stack([p[rows] + rng.normal(0.0, s["position_sd"], (len(rows), 3)), seen])
    streams = {"mocap": make_stream("mocap", t[rows], poses, POSE),
               "imu": make_stream("imu", t, np.column_stack([force, gyro]), IMU)}
    return Flight("made", streams, {}, Provenance("made", "", "test", synthetic=True)), p


@pytest.mark.parametrize("second", [pytest.param(8.0, marks=pytest.mark.slow), 14.9,
                                    pytest.param(16.0, marks=pytest.mark.slow), 19.9])
def test_a_filter_told_the_truth_states_its_error(second):
    """Mean over runs of the normalised squared error of the position: 3, in its chi-square band for 40 runs, while
    poses come and after the last one."""
    row, values = round(second * HZ), []
    for seed in range(40):
        flight, p = run(seed)
        made = Told().estimate(flight)
        assert np.linalg.eigvalsh(made.covariance[row]).min() > 0.0
        values.append(normalised_squared(made.position_m[[row]] - p[[row]], made.covariance[[row], :3, :3])[0])
    assert 2.1 < np.mean(values) < 4.1


def test_a_pose_that_comes_late_counts_at_its_time():
    """Poses that come 80 ms late are worth nearly as much as punctual ones to a filter that is told."""
    flight, p = run(1)
    imu_s = flight["imu"].time_s

    def off(late_s, told_s):
        mocap = make_stream("mocap", flight["mocap"].time_s + late_s, flight["mocap"].values, POSE)
        given = Flight("made", {**flight.streams, "mocap": mocap}, {"pose_delay_s": told_s}, flight.provenance)
        made = Told().estimate(given)
        rows = (made.time_s > 5.0) & (made.time_s < 14.0)
        true = np.stack([np.interp(made.time_s[rows], imu_s, column) for column in p.T], axis=1)
        return np.sqrt(np.mean(np.sum((made.position_m[rows] - true) ** 2, axis=1)))

    assert off(0.08, 0.08) < 1.3 * off(0.0, 0.0)
    assert off(0.08, 0.0) > 2.0 * off(0.08, 0.08)


def test_an_estimate_that_is_lost_ends_there():
    """An accelerometer that shows what no vehicle can, long after the last pose: rows before are as without it."""
    flight, _ = run(2, 40.0)
    imu = flight["imu"]
    values = imu.values.copy()
    odd = imu.time_s > 35.0
    values[odd, :3] = 1e4 * (imu.time_s[odd, None] - 35.0)
    made = Told().estimate(flight.with_streams(imu=make_stream("imu", imu.time_s, values, IMU)))
    whole = Told().estimate(flight)
    assert 35.0 < made.time_s[-1] < 39.0
    assert len(made.time_s) == len(made.position_m) == len(made.covariance) < len(whole.time_s)
    assert np.isfinite(made.position_m).all()
    before = made.time_s < 35.0
    assert np.array_equal(made.position_m[before], whole.position_m[: before.sum()])
