"""Dead reckoning against trajectories whose IMU is known in closed form, and what it may not know."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators.error_state_ekf import ErrorStateEkf, Strapdown
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.protocols import blackout, task3

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
UP = np.array([0.0, 0.0, 9.81])
IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")


def turning_circle(seconds=12.0, rate_hz=200.0, radius_m=1.0, speed_rad_s=0.8):
    """A level circle flown nose first: pose, and the specific force and rate an ideal IMU would show."""
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    a = speed_rad_s * t
    p = np.stack([radius_m * np.cos(a), radius_m * np.sin(a), np.ones_like(t)], axis=1)
    rotation = Rotation.from_rotvec(np.outer(a + np.pi / 2, [0.0, 0.0, 1.0]))
    acceleration = -speed_rad_s**2 * np.stack([p[:, 0], p[:, 1], np.zeros_like(t)], axis=1)
    force = rotation.inv().apply(acceleration + UP)
    gyro = np.tile([0.0, 0.0, speed_rad_s], (len(t), 1))
    return t, p, rotation.as_quat(), force, gyro


def made(t, p, q, force, gyro, until_s):
    early = t <= until_s
    streams = {"mocap": make_stream("mocap", t[early], np.column_stack([p, q])[early], POSE),
               "imu": make_stream("imu", t, np.column_stack([force, gyro]), IMU)}
    return Flight("made", streams, {}, Provenance("made", "", "test", synthetic=True))


def test_strapdown_follows_a_circle():
    t, p, q, force, gyro = turning_circle()
    estimate = Strapdown().estimate(made(t, p, q, force, gyro, 6.0))
    assert np.linalg.norm(estimate.position_m - p, axis=1)[t < 6.0].max() < 0.05
    assert np.linalg.norm(estimate.position_m[-1] - p[-1]) < 0.05
    assert np.allclose(np.linalg.norm(estimate.quaternion, axis=1), 1.0)


def test_drag_says_the_velocity_that_a_wrong_start_does_not_know():
    """An ideal accelerometer shows -k v: six seconds without poses stay bounded although the gyro drifts."""
    t, p, q, _, _ = turning_circle()
    velocity = np.gradient(p, t, axis=0)
    # the path is held against drag: thrust along body z does it, and x and y show drag alone
    lean = Rotation.from_quat(q)
    acceleration = np.gradient(velocity, t, axis=0)
    up = acceleration + UP + ErrorStateEkf.settings["drag"] * velocity
    thrust = np.linalg.norm(up, axis=1)
    z = up / thrust[:, None]
    x = lean.apply([1.0, 0.0, 0.0])
    x = x - z * np.sum(x * z, axis=1, keepdims=True)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    tilted = Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=2))
    body_v = tilted.inv().apply(velocity)
    force = -ErrorStateEkf.settings["drag"] * body_v
    force[:, 2] += thrust
    step = (tilted[:-1].inv() * tilted[1:]).as_rotvec() * 200.0
    gyro = np.vstack([step, step[-1:]]) + np.array([0.01, -0.01, 0.0])
    flight = made(t, p, tilted.as_quat(), force, gyro, 5.0)
    aided, plain = ErrorStateEkf().estimate(flight), Strapdown().estimate(flight)
    late = t > 10.0
    error = [np.linalg.norm(e.position_m - p, axis=1)[late].max() for e in (aided, plain)]
    assert error[0] < 0.4
    assert error[0] < error[1]


def test_turning_the_world_turns_the_estimate():
    t, p, q, force, gyro = turning_circle()
    turn = Rotation.from_rotvec([0.0, 0.0, 1.1])
    plain = ErrorStateEkf().estimate(made(t, p, q, force, gyro, 6.0))
    other = made(t, turn.apply(p), (turn * Rotation.from_quat(q)).as_quat(), force, gyro, 6.0)
    turned = ErrorStateEkf().estimate(other)
    assert np.allclose(turned.position_m, turn.apply(plain.position_m), atol=1e-6)


@pytest.fixture(scope="module")
def flight(crowd):
    return crowd.flight("slow trefoil")


def test_nothing_later_leaks(flight):
    """What comes after t, on any stream, changes nothing before t."""
    rng = np.random.default_rng(3)
    given = blackout.given_until(flight, 9.0)
    imu = given["imu"]
    noise = imu.values.copy()
    noise[imu.time_s > 12.0] = rng.normal(0.0, 5.0, (np.sum(imu.time_s > 12.0), imu.values.shape[1]))
    for method in (ErrorStateEkf(), Strapdown()):
        whole = method.estimate(given)
        bent = method.estimate(given.with_streams(imu=replace(imu, values=noise)))
        before = whole.time_s <= 12.0
        assert np.array_equal(whole.position_m[before], bent.position_m[before])


@pytest.fixture(scope="module")
def case(flight, audited):
    return task3.select([flight], {flight.name: audited(flight)}, "clean")[0]


def test_blackout_gives_poses_until_t0_and_no_longer(flight, case):
    seen = []

    class Watching(ErrorStateEkf):
        name = "watching"

        def estimate(self, given):
            seen.append(given["mocap"].time_s[-1])
            return super().estimate(given)

    value = blackout.score(case, Watching())
    assert seen == pytest.approx(blackout.starts(case), abs=0.011)
    assert {w.h_s for w in value.windows} >= {1.0, 5.0}
    mocap = flight["mocap"]
    bent = mocap.values.copy()
    bent[mocap.time_s > seen[0], :3] += 5.0
    worse = replace(case, flight=flight.with_streams(mocap=replace(mocap, values=bent)))
    first, other = (blackout.score(c, ErrorStateEkf()).windows[0] for c in (case, worse))
    assert first.end_m == pytest.approx(other.end_m, abs=1e-6)
    assert other.error_m > first.error_m + 3.0


def test_hand_worked_end_error(flight, case):
    """An estimator that stands 3 m and 4 m away is 5 m off in every window."""
    mocap = flight["mocap"]

    class Off:
        name, causal = "off", True

        def estimate(self, given):
            from nanobench_tools.methods import Estimate

            return Estimate(mocap.time_s, mocap["px", "py", "pz"] + [3.0, 4.0, 0.0], mocap["qx", "qy", "qz", "qw"])

    value = blackout.score(case, Off())
    assert [w.error_m for w in value.windows] == pytest.approx([5.0] * len(value.windows))
    rows = blackout.tabulate(Off(), [(case, value)])
    assert rows[0].metrics["end_error_1s_m"].mean == pytest.approx(5.0)


@pytest.mark.parametrize(("sd_m", "inside"), [(1.4, True), (1.3, False)])
def test_hand_worked_consistency(flight, case, sd_m, inside):
    """5 m off: within the ellipsoid of 3.76 standard deviations that holds 99.73 % where one is above 1.33 m."""
    mocap = flight["mocap"]

    class Off:
        name, causal = "off", True

        def estimate(self, given):
            from nanobench_tools.methods import Estimate

            said = np.broadcast_to(np.eye(3) * sd_m**2, (len(mocap.time_s), 3, 3))
            return Estimate(mocap.time_s, mocap["px", "py", "pz"] + [3.0, 4.0, 0.0], mocap["qx", "qy", "qz", "qw"],
                            covariance=said)

    scored = blackout.score(case, Off())
    windows = scored.windows
    assert {w.inside_3_sigma for w in windows} == {inside}
    assert [w.nees for w in windows] == pytest.approx([25.0 / sd_m**2] * len(windows))
    assert scored.metrics["nees_0s"] == pytest.approx(25.0 / sd_m**2, rel=1e-6)
    assert scored.metrics["inside_3_sigma_0s_percent"] == 100.0 * inside
    window = windows[0]
    inside_it = (mocap.time_s >= window.t0_s) & (mocap.time_s <= window.t0_s + window.h_s)
    path = np.linalg.norm(np.diff(mocap["px", "py", "pz"][inside_it], axis=0), axis=1).sum()
    assert window.drift_percent == pytest.approx(500.0 / path)


def test_an_optimiser_that_gave_up_is_no_result(case):

    class GaveUp(ErrorStateEkf):
        def estimate(self, given):
            return replace(super().estimate(given), converged=False)

    with pytest.raises(InputError, match="did not converge"):
        blackout.score(case, GaveUp())


def test_without_imu_or_poses_it_says_so(flight):
    with pytest.raises(InputError, match="imu"):
        ErrorStateEkf().estimate(flight.without_streams("imu"))
    with pytest.raises(InputError, match="a second of poses"):
        ErrorStateEkf().estimate(blackout.given_until(flight, 0.1))
