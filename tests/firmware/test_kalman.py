"""The Kalman filter where no numbers of the firmware's are at hand: a textbook's filter, and what it must survive."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from nanobench_tools.firmware import kalman
from nanobench_tools.firmware.kalman_task import MEASUREMENT, RUN, TASK, run_task

UP = np.array([0.0, 0.0, 9.81])


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def some_core(rng):
    """A state and a covariance as they are in flight."""
    core = np.zeros(1, kalman.CORE)
    turn = Rotation.from_rotvec(rng.normal(0.0, 0.5, 3))
    core["state"][0, :6] = rng.normal(0.0, 1.0, 6)
    core["quaternion"], core["rotation"] = turn.as_quat()[[3, 0, 1, 2]], turn.as_matrix()
    half = rng.normal(0.0, 0.03, (9, 9))
    core["covariance"] = half @ half.T + 1e-4 * np.eye(9)
    core["initial"][0, 0] = 1.0
    return core


def done(core, kind, values, t_ms=0, flying=1, parameters=None):
    calls = np.zeros(1, kalman.OPERATION)
    calls["kind"], calls["t_ms"], calls["flying"] = kind, t_ms, flying
    calls["value"][0, :len(values)] = values
    after = core.copy()
    kalman.run_operations(calls, kalman.defaults() if parameters is None else parameters, after,
                          np.zeros(1, kalman.CORE))
    return after


def moved(position, velocity, turn, acc, rate, dt):
    """The motion that the filter believes in, first order in dt, double precision."""
    world = turn.apply(velocity * dt + 0.5 * acc * dt**2) - 0.5 * UP * dt**2
    body = velocity + dt * (acc - np.cross(rate, velocity) - turn.inv().apply(UP))
    return position + world, body, turn * Rotation.from_rotvec(rate * dt)


@pytest.mark.parametrize("seed", range(5))
def test_prediction_and_its_covariance_against_finite_differences(seed):
    rng = np.random.default_rng(seed)
    core = some_core(rng)
    acc, rate, dt = np.array([0.0, 0.0, 9.0 + rng.normal()]), rng.normal(0.0, 1.0, 3), 0.01
    after = done(core, kalman.PREDICT, [*rng.normal(0.0, 1.0, 2), acc[2], *rate], t_ms=10)
    x, v = core["state"][0, :3].astype(float), core["state"][0, 3:6].astype(float)
    turn = Rotation.from_quat(core["quaternion"][0, [1, 2, 3, 0]].astype(float))

    def step(error):
        p, b, q = moved(x + error[:3], v + error[3:6], turn * Rotation.from_rotvec(error[6:]), acc, rate, dt)
        return p, b, q

    p0, v0, q0 = step(np.zeros(9))
    assert np.allclose(after["state"][0, :6], [*p0, *v0], atol=2e-6)
    assert (q0.inv() * Rotation.from_quat(after["quaternion"][0, [1, 2, 3, 0]])).magnitude() < 5e-6
    slope, h = np.zeros((9, 9)), 1e-5
    for k in range(9):
        p, b, q = step(np.eye(9)[k] * h)
        slope[:, k] = np.concatenate([p - p0, b - v0, (q0.inv() * q).as_rotvec()]) / h
    # the filter leaves out terms of second order in dt and takes half of the turn of attitude errors
    slope[6:, 6:] = expm(-skew(rate * dt / 2.0))
    wanted = slope @ core["covariance"][0].astype(float) @ slope.T
    assert np.abs(after["covariance"][0] - wanted).max() < 2e-3 * np.abs(wanted).max()


def with_drag(drag_1_s, pressure_m=(0.0, 0.0, 0.0)):
    found = kalman.defaults()
    found["drag_1_s"], found["pressure_m"] = drag_1_s, pressure_m
    return found


def test_a_step_with_drag_by_hand():
    """Level, 2, -1, 0.5 m/s, hovering, b = 0.5, 0.25, 1: dv = -0.01 b v; a yaw rate of 2 rad/s about a centre of
    pressure 0.1 m ahead moves it at 0.2 m/s to the left, which the firmware adds: +0.01 * 0.25 * 0.2."""
    core = np.zeros(1, kalman.CORE)
    core["quaternion"][0, 0], core["rotation"][0] = 1.0, np.eye(3)
    core["state"][0, 3:6] = 2.0, -1.0, 0.5
    core["covariance"][0] = np.eye(9)
    hover = [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]
    after = done(core, kalman.PREDICT, hover, t_ms=10, parameters=with_drag([0.5, 0.25, 1.0]))
    assert after["state"][0, 3:6] == pytest.approx([1.99, -0.9975, 0.495], abs=1e-6)
    assert after["state"][0, :3] == pytest.approx([0.02, -0.01, 0.005], abs=1e-6)
    tilted = [9.81 * 0.01] * 2
    assert np.diag(after["covariance"][0])[3:6] == pytest.approx(
        [0.995**2 + tilted[0] ** 2, 0.9975**2 + tilted[1] ** 2, 0.99**2], abs=1e-5)
    turning = [0.0, 0.0, 9.81, 0.0, 0.0, 2.0]
    after = done(core, kalman.PREDICT, turning, t_ms=10, parameters=with_drag([0.5, 0.25, 1.0], [0.1, 0.0, 0.0]))
    assert after["state"][0, 3:6] == pytest.approx([1.99 - 0.02, -0.9975 - 0.04 + 0.0005, 0.495], abs=1e-6)


@pytest.mark.parametrize("flying", [0, 1])
def test_drag_acts_digit_by_digit_in_flight_alone(flying):
    """In single precision, in the firmware's order of operations; on the ground the covariance alone has it."""
    rng = np.random.default_rng(3)
    core, f = some_core(rng), np.float32
    told = rng.normal(0.0, 1.0, 6).astype(f)
    b, c = rng.uniform(0.1, 4.0, 3).astype(f), rng.normal(0.0, 0.05, 3).astype(f)
    after = done(core, kalman.PREDICT, told, t_ms=10, flying=flying, parameters=with_drag(b, c))
    plain = done(core, kalman.PREDICT, told, t_ms=10, flying=flying)
    assert np.array_equal(after["state"][0, :3], plain["state"][0, :3])
    if not flying:
        assert np.array_equal(after["state"], plain["state"])
        assert not np.array_equal(after["covariance"], plain["covariance"])
        return
    v, g, r, dt, (wx, wy, wz) = core["state"][0, 3:6], f(9.81), core["rotation"][0], f(10) / f(1000), told[3:]
    wanted = np.array([
        v[0] + dt * (wz * v[1] - wy * v[2] - g * r[2, 0] - b[0] * v[0] + b[0] * (wy * c[2] - wz * c[1])),
        v[1] + dt * (-wz * v[0] + wx * v[2] - g * r[2, 1] - b[1] * v[1] + b[1] * (wz * c[0] - wx * c[2])),
        v[2] + dt * (told[2] + wy * v[0] - wx * v[1] - g * r[2, 2] - b[2] * v[2] + b[2] * (wx * c[1] - wy * c[0]))])
    assert wanted.dtype == f
    assert np.array_equal(after["state"][0, 3:6], wanted)


@pytest.mark.parametrize("seed", range(5))
def test_a_position_against_the_textbook(seed):
    """Three scalar measurements in turn are one of three rows."""
    rng = np.random.default_rng(100 + seed)
    core, place = some_core(rng), rng.normal(0.0, 1.0, 3)
    after = done(core, kalman.POSITION, [*place, 0, 0, 0, 0, 0.05])
    c, h = core["covariance"][0].astype(float), np.eye(9)[:3]
    gain = c @ h.T @ np.linalg.inv(h @ c @ h.T + 0.05**2 * np.eye(3))
    assert np.allclose(after["state"][0], core["state"][0] + gain @ (place - core["state"][0, :3]), atol=2e-5)
    assert np.allclose(after["covariance"][0], (np.eye(9) - gain @ h) @ c, atol=2e-7)


def test_a_pose_turns_the_estimate_towards_it():
    rng = np.random.default_rng(7)
    core = some_core(rng)
    core["covariance"] = np.diag([1e-4] * 9)
    core["state"][0, 6:] = 0.0
    turn = Rotation.from_quat(core["quaternion"][0, [1, 2, 3, 0]])
    told = turn * Rotation.from_rotvec([0.02, -0.01, 0.03])
    for sign, length in ((1.0, 1.0), (-1.0, 1.05)):
        pose = [*core["state"][0, :3], *(sign * length * told.as_quat()), 0.01, 0.0045]
        after = done(done(core, kalman.POSE, pose), kalman.FINALIZE, [])
        left = (Rotation.from_quat(after["quaternion"][0, [1, 2, 3, 0]]).inv() * told).as_rotvec()
        assert np.allclose(left, np.array([0.02, -0.01, 0.03]) * 0.0045**2 / (1e-4 + 0.0045**2), atol=3e-5)
        assert np.array_equal(after["state"][0, 6:], np.zeros(3))


def flown(runs, poses, rows=None):
    """(task, cores after the runs ``rows``, by default all)."""
    rows = np.arange(len(runs)) if rows is None else rows
    task, out = np.zeros(1, TASK), np.zeros(len(rows), kalman.CORE)
    run_task(runs, poses, kalman.defaults(), task, rows, out)
    return task[0], out


def hovering(n, rng, every=10):
    """n runs above one place with noise of the sensors, and a pose every so many."""
    runs = np.zeros(n, RUN)
    runs["t_ms"], runs["flying"] = np.arange(n), 1
    runs["acc_g"], runs["gyro_deg_s"] = rng.normal([0.0, 0.0, 1.0], 0.05, (n, 3)), rng.normal(0.0, 3.0, (n, 3))
    poses = np.zeros(n // every, MEASUREMENT)
    poses["t_ms"], poses["attitude"] = np.arange(len(poses)) * every, 1
    poses["position_m"] = rng.normal([0.3, -0.2, 1.0], 0.001, (len(poses), 3))
    poses["quaternion"] = Rotation.from_rotvec(rng.normal(0.0, 0.002, (len(poses), 3))).as_quat()
    poses["position_sd_m"], poses["attitude_sd_rad"] = kalman.POSITION_SD_M, kalman.ATTITUDE_SD_RAD
    return runs, poses


def test_the_covariance_stays_one():
    """1e5 runs of a rough flight; poses come at random, with holes of up to 2 s."""
    rng = np.random.default_rng(11)
    runs, poses = hovering(100_000, rng)
    runs["gyro_deg_s"] += np.repeat(rng.normal(0.0, 150.0, (1000, 3)), 100, axis=0)
    runs["acc_g"][:, 2] += np.repeat(rng.normal(0.0, 0.3, 1000), 100)
    given = rng.random(len(poses)) < 0.5
    for hole in rng.integers(1000, len(poses) - 200, 15):
        given[hole:hole + rng.integers(20, 200)] = False
    attitude = Rotation.identity()
    turns = Rotation.from_rotvec(np.radians(runs["gyro_deg_s"].reshape(-1, 10, 3).mean(axis=1)) * 0.01)
    for k in range(len(poses)):
        poses["quaternion"][k] = attitude.as_quat()
        attitude = attitude * turns[k]
    _, out = flown(runs, poses[given], np.arange(20, len(runs), 7))
    covariance = out["covariance"].astype(float)
    assert np.array_equal(covariance, covariance.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    assert np.all(np.diagonal(covariance, axis1=1, axis2=2) >= np.float32(1e-6))
    assert np.isfinite(out["state"]).all()
    assert np.abs(np.linalg.norm(out["quaternion"], axis=1) - 1.0).max() < 1e-5


def test_what_comes_later_changes_nothing_before():
    rng = np.random.default_rng(12)
    runs, poses = hovering(3000, rng)
    _, plain = flown(runs, poses)
    bent, other = runs.copy(), poses.copy()
    bent["acc_g"][1500:] = rng.normal(0.0, 3.0, (1500, 3))
    bent["flying"][1500:] = 0
    other["position_m"][150:] = rng.normal(0.0, 5.0, (150, 3))
    _, after = flown(bent, other)
    assert plain[:1500].tobytes() == after[:1500].tobytes()
    assert np.abs(plain["state"][1500:] - after["state"][1500:]).max() > 1.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_no_number_is_as_good_as_none(bad):
    rng = np.random.default_rng(13)
    runs, poses = hovering(2000, rng)
    hit = np.arange(20, 200, 7)
    sick = poses.copy()
    sick["position_m"][hit[::2], 1] = bad
    sick["quaternion"][hit[1::2], 3] = bad
    task, found = flown(runs, sick)
    assert task["refused"] == len(hit)
    assert found.tobytes() == flown(runs, np.delete(poses, hit))[1].tobytes()


def test_samples_that_are_no_numbers_did_not_arrive():
    """Averages are over those that came; without any the last average goes on."""
    runs = np.zeros(60, RUN)
    runs["t_ms"], runs["acc_g"][:, 2] = np.arange(60), 1.0
    runs["acc_g"][:, 0] = np.arange(60)
    runs["acc_g"][11:15, 1], runs["gyro_deg_s"][20:50, 2] = np.nan, np.nan
    task = np.zeros(1, TASK)
    seen = []
    for k in range(0, 60, 10):
        run_task(runs[k:k + 10], np.zeros(0, MEASUREMENT), kalman.defaults(), task, np.zeros(0, np.int64),
                 np.zeros(0, kalman.CORE))
        seen.append(task["mean"][0, 0] / 9.81)
    # the prediction at 20 ms has the samples of 10 to 19 without 11 to 14
    assert seen == pytest.approx([0.0, 4.5, (10 + 15 + 16 + 17 + 18 + 19) / 6, *[16.0 - 1 / 6] * 3], abs=0.01)


def test_out_of_bounds_begins_anew():
    runs, poses = hovering(400, np.random.default_rng(14))
    poses["position_m"][20] = [9e3, 0.0, 0.0]
    task, found = flown(runs, poses)
    assert abs(found["state"][200, 0]) > 100.0
    assert np.array_equal(found["state"][201, :6], np.zeros(6))
    assert task["resets"] >= 1
    assert np.abs(found["state"][399, :3] - [0.3, -0.2, 1.0]).max() < 0.02


def test_half_a_turn_away_says_nothing():
    """The residual of the attitude would be infinite."""
    core = some_core(np.random.default_rng(15))
    core["quaternion"] = [1.0, 0.0, 0.0, 0.0]
    after = done(core, kalman.POSE, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.01, 0.0045])
    assert np.isfinite(after["state"]).all()
    assert np.isfinite(done(after, kalman.FINALIZE, [])["quaternion"]).all()
