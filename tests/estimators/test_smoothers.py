"""GTSAM smoothers against motion that is known in closed form, and what they may not know."""

import sys
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators.gtsam.aided_batch import GtsamAided, drag, lift
from estimators.gtsam.batch import GtsamBatch, Poses
from estimators.gtsam.covariance import covariance_of
from estimators.gtsam.factor_graph import LIFT_SD_M_S2, Problem
from estimators.gtsam.fixed_lag import GtsamFixedLag
from estimators.gtsam.smoother_rows import WARMS_M_S3, rows_of, stands
from estimators.gtsam.state_path import Path, State, steps_of
from estimators.imu_noise import ImuNoise
from nanobench_tools.errors import InputError, MissingExtraError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.metrics.consistency import normalised_squared
from nanobench_tools.protocols import aided, blackout

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
UP = np.array([0.0, 0.0, 9.81])


def known_motion(seconds=8.0, rate_hz=100.0, pose_every=10, noise_m=0.0, seed=0):
    """A tilting, turning loop given in closed form: the flight with an ideal IMU (mean over each row's step is what a
    trapezoid of it sees), poses at a tenth of the rate, and the true position and attitude."""
    t = np.arange(0.0, seconds, 1.0 / rate_hz)

    def place(x):
        return np.stack([np.cos(0.9 * x), np.sin(1.1 * x), 1.0 + 0.2 * np.sin(0.7 * x)], axis=1)

    acceleration = np.stack([-0.81 * np.cos(0.9 * t), -1.21 * np.sin(1.1 * t), -0.098 * np.sin(0.7 * t)], axis=1)
    rotation = Rotation.from_euler("ZYX", np.stack([0.3 * t, 0.1 * np.sin(1.3 * t), 0.12 * np.cos(t)], axis=1))
    h = 1e-5
    later = Rotation.from_euler("ZYX", np.stack([0.3 * (t + h), 0.1 * np.sin(1.3 * (t + h)),
                                                 0.12 * np.cos(t + h)], axis=1))
    gyro = (rotation.inv() * later).as_rotvec() / h
    force = rotation.inv().apply(acceleration + UP)
    rng = np.random.default_rng(seed)
    given = slice(None, None, pose_every)
    p, q = place(t), rotation.as_quat()
    noisy = p[given] + noise_m * rng.normal(size=p[given].shape)
    told = {"pose_noise_m": noise_m} if noise_m else {}
    flight = Flight("known", {"mocap": make_stream("mocap", t[given], np.column_stack([noisy, q[given]]), POSE),
                              "imu": make_stream("imu", t, np.column_stack([force, gyro]), IMU)}, told,
                    Provenance("known", "", "test", synthetic=True))
    return flight, t, p, q


class Undragged(GtsamAided):
    """Of a motion that no drag slows."""

    def blocks(self, flight, problem, start):
        return GtsamBatch.blocks(self, flight, problem, start)


def rms(error):
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def test_without_noise_the_path_is_the_true_one():
    flight, t, p, q = known_motion()
    method = GtsamBatch()
    estimate = method.estimate(flight)
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    assert estimate.converged
    assert method.last.converged
    assert rms(estimate.position_m - true) < 1e-3
    last = Rotation.from_quat(estimate.quaternion[400]).inv() * Rotation.from_quat(q[400])
    assert last.magnitude() < 2e-3


def test_smoothing_beats_the_noise_of_the_poses():
    """1 cm of noise on each axis of poses at 10 Hz, an ideal IMU: far below 17 mm, and below 7 mm."""
    flight, t, p, _ = known_motion(noise_m=0.01)
    estimate = GtsamBatch().estimate(flight)
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    assert rms(estimate.position_m - true) < 0.007


def test_a_turned_world_turns_the_path():
    flight, *_ = known_motion(seconds=4.0, noise_m=0.01)
    turn = Rotation.from_rotvec([0.0, 0.0, 0.8])
    mocap = flight["mocap"]
    attitude = turn * Rotation.from_quat(mocap.values[:, 3:])
    values = np.column_stack([turn.apply(mocap.values[:, :3]), attitude.as_quat()])
    plain = GtsamBatch().estimate(flight)
    turned = GtsamBatch().estimate(flight.with_streams(mocap=replace(mocap, values=values)))
    assert np.allclose(turned.position_m, turn.apply(plain.position_m), atol=2e-4)


def test_the_path_from_either_side_of_an_interval_is_the_same_motion():
    """Forward from one state and backward from the next, with states that the IMU itself gives: no difference."""
    flight, *_ = known_motion(seconds=3.0)
    rows = rows_of(flight)
    time_s = stands(rows)
    zero = np.zeros((len(time_s), 3))
    start = State(np.tile(np.eye(3), (len(time_s), 1, 1)), zero, zero, zero, zero, np.zeros((len(time_s), 5)))
    problem = Problem(rows, ImuNoise(), time_s)
    state = problem.carried(State(*(getattr(start, n)[:1] for n in ("rotation", "position", "velocity", "acc_bias",
                                                                   "gyro_bias", "slow"))))
    path = Path(steps_of(rows, time_s), state)
    middle = 0.5 * (time_s[1:] + time_s[:-1]) + 0.003
    owner = np.arange(len(middle))
    ahead, back = path.near(owner, middle), path.near(owner + 1, middle)
    assert np.allclose(ahead.position, back.position, atol=1e-6)
    assert np.allclose(ahead.velocity, back.velocity, atol=1e-6)


def test_states_stand_at_poses_and_not_closer_than_a_tenth_of_a_second():
    flight, t, *_ = known_motion(pose_every=1)
    time_s = stands(rows_of(flight))
    assert np.diff(time_s).min() > 0.045
    assert np.diff(time_s).max() < 0.15
    assert time_s[-1] == t[-1]
    early = flight.with_streams(mocap=flight["mocap"].rows(flight["mocap"].time_s < 3.0))
    later = stands(rows_of(early))
    assert later[-1] == t[-1]
    assert np.isclose(later, early["mocap"].time_s[-1]).any()


def test_the_accelerometers_bias_may_jump_at_lift_off():
    flight, t, *_ = known_motion()
    motors = np.where(t[:, None] < 3.02, 0.0, 0.8) * np.ones(4)
    flight = flight.with_streams(motor=make_stream("motor", t, motors, ("m1", "m2", "m3", "m4")))
    rows = rows_of(flight)
    problem = Problem(rows, ImuNoise(), stands(rows))
    at = np.flatnonzero(problem.lifts)
    assert len(at) == 1
    assert problem.time_s[at[0]] <= 3.02 <= problem.time_s[at[0] + 1]
    assert problem.acc_walk[at[0]] ** 2 * 0.1 == pytest.approx(LIFT_SD_M_S2**2, rel=0.05)
    assert np.ptp(np.delete(problem.acc_walk, at)) == 0.0


@pytest.mark.slow
def test_the_drift_of_the_vertical_bias_is_found_for_each_flight():
    """0.8 mm/s^2 each second beyond what all flights share, poses until 40 s: found to a third, although the prior says
    0 +- 0.5, and the height 12 s later is off by less than half as much as where it is the same in every flight."""
    flight, t, p, _ = known_motion(seconds=54.0)
    imu = flight["imu"]
    drifting = imu.values.copy()
    drifting[:, 2] += (WARMS_M_S3 + 8e-4) * (t - t[0])
    flight = flight.with_streams(imu=replace(imu, values=drifting),
                                 mocap=flight["mocap"].rows(flight["mocap"].time_s <= 40.0))

    def off(method):
        estimate = method.estimate(flight)
        return abs(np.interp(52.0, estimate.time_s, estimate.position_m[:, 2]) - np.interp(52.0, t, p[:, 2]))

    free, same = Undragged(), Undragged()
    same.slow_sd = np.where(np.arange(10) == same.warms, 1e-8, same.slow_sd)
    assert off(free) < 0.5 * off(same)
    assert free.last.state.slow[-1, free.warms] == pytest.approx(8e-4, rel=0.35)


def test_a_touch_down_ends_the_graph_and_how_sure_it_is():
    """The last second of motors running, full of bounces, is left out, and how sure the estimate is after it."""
    flight, t, *_ = known_motion(seconds=12.0)
    motors = np.where(t[:, None] < 9.0, 0.85, 0.0) * np.ones(4)
    battery = make_stream("battery", t, np.full((len(t), 1), 3.6), ("vbat",))
    flight = flight.with_streams(motor=make_stream("motor", t, motors, ("m1", "m2", "m3", "m4")), battery=battery,
                                 mocap=flight["mocap"].rows(flight["mocap"].time_s < 6.0))
    rows = rows_of(flight)
    assert 8.9 < GtsamAided().measured_until(flight, rows, stands(rows)) < 9.1
    hit = (t >= 8.0) & (t < 9.0)
    bounce = flight["imu"].values.copy()
    bounce[hit, :3] += np.random.default_rng(3).normal(0.0, 15.0, (int(hit.sum()), 3))
    bounce[np.argmax(hit), 2] = 40.0
    struck = flight.with_streams(imu=replace(flight["imu"], values=bounce))
    rows = rows_of(struck)
    assert 7.8 < GtsamAided().measured_until(struck, rows, stands(rows)) <= 8.0
    method = Undragged()
    estimate = method.estimate(struck)
    assert method.last.state.position.shape[0] < 85
    assert np.isfinite(estimate.covariance[estimate.time_s < 7.8]).all()
    assert np.isnan(estimate.covariance[estimate.time_s > 8.2]).all()


def test_late_poses_count_when_they_were_measured():
    flight, t, p, _ = known_motion()
    mocap = flight["mocap"]
    arrived = flight.with_streams(mocap=replace(mocap, time_s=mocap.time_s + 0.03))
    late = replace(arrived, metadata={"pose_delay_s": 0.03})
    estimate = GtsamBatch().estimate(late)
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    assert rms(estimate.position_m - true) < 1e-3


def test_covariances_of_a_chain_are_those_of_the_dense_inverse():
    """Random factors on two variables a time and between times, eliminated in time."""
    rng, sizes, count, n = np.random.default_rng(2), [2, 3], 6, 5
    keys = [[gtsam.symbol("a", i), gtsam.symbol("b", i)] for i in range(count)]
    flat, at = [key for row in keys for key in row], np.cumsum([0, *sizes * count])
    graph, dense = gtsam.GaussianFactorGraph(), np.zeros((n * count, n * count))
    for j in range(2 * count):
        use = list(range(j, min(j + 3, 2 * count)))  # each with the next two: all of a time, and half of the next
        rows = np.zeros((8, n * count))
        rows[:, at[use[0]] : at[use[-1] + 1]] = rng.normal(size=(8, at[use[-1] + 1] - at[use[0]]))
        parts = [part for k in use for part in (flat[k], rows[:, at[k] : at[k + 1]])]
        graph.push_back(gtsam.JacobianFactor(*parts, np.zeros(8), gtsam.noiseModel.Unit.Create(8)))
        dense += rows.T @ rows
    ordering = gtsam.Ordering()
    for row in keys:
        for key in row:
            ordering.push_back(key)
    found = covariance_of(graph.eliminateSequential(ordering), keys, sizes)
    whole = np.linalg.inv(dense)
    assert np.allclose(found, [whole[i * n : i * n + n, i * n : i * n + n] for i in range(count)], rtol=1e-6)


def test_a_smoother_says_how_sure_it_is():
    """As sure as it is right, within a factor of two, and surer than the poses alone."""
    flight, t, p, _ = known_motion(noise_m=0.01)
    estimate = GtsamBatch().estimate(flight)
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    error = estimate.position_m - true
    said = estimate.covariance[:, :3, :3]
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0
    assert 0.2 < np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.inv(said), error)) / 3.0 < 2.0
    assert np.sqrt(said[len(said) // 2].trace()) < 0.017


def test_bad_input_is_one_line():
    flight, *_ = known_motion(seconds=4.0)
    imu, mocap = flight["imu"], flight["mocap"]
    with pytest.raises(InputError, match="imu"):
        GtsamBatch().estimate(flight.without_streams("imu"))
    with pytest.raises(InputError, match="a second of poses"):
        GtsamBatch().estimate(flight.with_streams(mocap=mocap.rows(mocap.time_s < 0.3)))
    with pytest.raises(InputError, match=r"hole of 1\.\d\d s"):
        GtsamBatch().estimate(flight.with_streams(imu=imu.rows((imu.time_s < 1.0) | (imu.time_s > 2.5))))
    degrees = replace(imu, values=imu.values * [1, 1, 1, 57.3, 57.3, 57.3])
    with pytest.raises(InputError, match=r"degrees|contradict|converge"):
        GtsamBatch().estimate(flight.with_streams(imu=degrees))


def test_nan_and_a_repeated_time_are_left_out():
    flight, t, p, _ = known_motion(seconds=4.0)
    imu = flight["imu"]
    values, time_s = imu.values.copy(), imu.time_s.copy()
    values[100] = np.nan
    time_s[200] = time_s[199]
    estimate = GtsamBatch().estimate(flight.with_streams(imu=replace(imu, values=values, time_s=time_s)))
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    assert np.isfinite(estimate.position_m).all()
    assert rms(estimate.position_m - true) < 5e-3


@pytest.mark.parametrize("method", [GtsamBatch, GtsamAided, GtsamFixedLag])
def test_bent_poses_after_t0_change_nothing(crowd, method):
    flight = crowd.flight("slow trefoil")
    mocap = flight["mocap"]
    bent = mocap.values.copy()
    bent[mocap.time_s > 8.0, :3] += 5.0
    worse = flight.with_streams(mocap=replace(mocap, values=bent))
    first, other = (method().estimate(blackout.given_until(f, 8.0)) for f in (flight, worse))
    assert np.array_equal(first.position_m, other.position_m)


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gtsam", None)
    with pytest.raises(MissingExtraError, match=r'pip install .*\[smoothers\]"'):
        GtsamBatch().estimate(known_motion(seconds=3.0)[0])


def moved(state, letter, i, change):
    """The state with one of its parts changed as GTSAM would."""
    if letter == "x":
        rotation, position = state.rotation.copy(), state.position.copy()
        position[i] = position[i] + rotation[i] @ change[3:]
        rotation[i] = rotation[i] @ Rotation.from_rotvec(change[:3]).as_matrix()
        return replace(state, rotation=rotation, position=position)
    names = {"v": ["velocity"], "c": ["slow"], "b": ["acc_bias", "gyro_bias"]}[letter]
    parts = {}
    for name, part in zip(names, np.split(change, len(names)), strict=True):
        parts[name] = getattr(state, name).copy()
        parts[name][i] += part
    return replace(state, **parts)


def test_jacobians_are_those_of_finite_differences():
    """Poses, drag and thrust: what a block says of its derivative, against central differences of its residual."""
    flight, *_ = known_motion(seconds=3.0, pose_every=3)
    rows = rows_of(flight)
    problem = Problem(rows, ImuNoise(), stands(rows))
    rng = np.random.default_rng(5)
    k = problem.count
    turns = Rotation.from_rotvec(0.2 * rng.normal(size=(k, 3)))
    state = State((Rotation.from_euler("Z", 0.03 * np.arange(k)[:, None]) * turns).as_matrix(),
                  rng.normal(size=(k, 3)), rng.normal(size=(k, 3)), 0.1 * rng.normal(size=(k, 3)),
                  0.01 * rng.normal(size=(k, 3)),
                  np.tile([0.02, 0.01, -0.02, 0.013, 0.004, 0.1, -0.1, 0.4, 0.9], (k, 1)))
    poses, force, thrust = Poses(problem, state), rng.normal(size=(k, 3)), 9.0 + rng.normal(size=k)
    every = np.arange(k)
    made = {"poses": lambda s: poses.linear(s, Path(problem.steps, s)), "drag": lambda s: drag(s, force, every),
            "lift": lambda s: lift(s, force, thrust, every)}
    # attitudes far from the poses' would test the small-angle term of the rotation rows only
    near = replace(state, rotation=Rotation.from_quat(
        [np.array(flight["mocap"].values[min(round(t * 100 / 3), len(flight["mocap"]) - 1), 3:])
         for t in problem.time_s]).as_matrix())
    h = 1e-5
    for name, block in made.items():
        at = near if name == "poses" else state
        linear = block(at)
        i = 7
        row = int(np.flatnonzero(linear.keys[0][1] == i)[0])
        for letter, _, jacobian in linear.keys:
            found = np.empty_like(jacobian[row])
            for column in range(found.shape[1]):
                change = np.zeros(found.shape[1])
                change[column] = h
                up, down = (block(moved(at, letter, i, sign * change)).residual[row] for sign in (1.0, -1.0))
                found[:, column] = -(up - down) / (2.0 * h)
            assert np.allclose(found, jacobian[row], atol=0.02 if name == "poses" else 1e-6), (name, letter)


def test_fixed_lag_follows_a_known_motion_and_uses_nothing_later():
    """Poses at 10 Hz, 30 ms late; everything after 5 s replaced by noise leaves what was said before as it was."""
    flight, t, p, _ = known_motion()
    mocap, imu = flight["mocap"], flight["imu"]
    late = replace(flight.with_streams(mocap=replace(mocap, time_s=mocap.time_s + 0.03)),
                   metadata={"pose_delay_s": 0.03})
    method = GtsamFixedLag()
    estimate = method.estimate(late)
    true = np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
    settled = estimate.time_s > 3.0
    assert rms((estimate.position_m - true)[settled]) < 0.03
    assert len(method.update_s) > 60
    rng = np.random.default_rng(2)
    noise, poses = imu.values.copy(), late["mocap"].values.copy()
    noise[imu.time_s > 5.0] += rng.normal(size=noise[imu.time_s > 5.0].shape)
    poses[late["mocap"].time_s > 5.0, :3] += 3.0
    bent = late.with_streams(imu=replace(imu, values=noise), mocap=replace(late["mocap"], values=poses))
    other = GtsamFixedLag().estimate(bent)
    before = estimate.time_s <= 5.0
    assert np.array_equal(estimate.position_m[before], other.position_m[before])


@pytest.mark.slow
def test_fixed_lag_errors_are_as_large_as_it_says():
    """SYNTHETIC, poses at 10 Hz with 1 cm of noise; without drag, and so without motors."""
    found = []
    for seed in range(3):
        flight, t, p, _ = known_motion(seconds=30.0, noise_m=0.01, seed=seed)
        still = make_stream("motor", t, np.zeros((len(t), 4)), ("m1", "m2", "m3", "m4"))
        estimate = GtsamFixedLag().estimate(flight.with_streams(motor=still))
        error = estimate.position_m - np.stack([np.interp(estimate.time_s, t, column) for column in p.T], axis=1)
        settled = estimate.time_s > 3.0
        found.append(normalised_squared(error[settled], estimate.covariance[settled, :3, :3]).mean())
    assert 2.0 < np.mean(found) < 4.0


def test_without_motors_the_aided_row_says_what_is_missing_and_goes_on(crowd):
    flight = crowd.flight("slow trefoil")
    given = blackout.given_until(flight, 8.0).without_streams("motor")
    with pytest.warns(UserWarning, match="without thrust, which needs the motor stream"):
        assert GtsamAided().estimate(given).converged


def test_practice_flight_aided(crowd, audited):
    """Poses with 1 cm of noise on a SYNTHETIC flight through the whole logging chain: less than half of it is left."""
    from nanobench_tools.protocols import task3

    flight = crowd.flight("slow trefoil")
    case = task3.select([flight], {flight.name: audited(flight)}, "clean")[0]
    assert aided.score(case, GtsamBatch(), aided.Aiding()).metrics["ate_rmse_m"] < 0.009
