"""The inertial rows: nothing later leaks in, bad input is said, covariances stay sound, clocks are found."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators import inertial, inertial_core, radio_clock
from estimators.delayed_pose_ekf import DelayedPoseEkf
from estimators.drag_ekf import DragEkf, DragMatrixEkf
from estimators.error_state_ekf import ErrorStateEkf, Strapdown
from estimators.inertial import STAMP_LEFT, lifted
from estimators.invariant_ekf import InvariantEkf
from estimators.learned_velocity import LearnedVelocityEkf
from nanobench_tools.errors import InputError
from nanobench_tools.protocols import aided, blackout, task3

ROWS = (Strapdown, ErrorStateEkf, DragEkf, DragMatrixEkf, LearnedVelocityEkf, InvariantEkf, DelayedPoseEkf)


@pytest.fixture(scope="module")
def flight(crowd):
    return crowd.flight("slow trefoil")


@pytest.fixture(scope="module")
def case(flight, audited):
    return task3.select([flight], {flight.name: audited(flight)}, "clean")[0]


def spoiled(flight, after_s, mocap_after_s, seed=1):
    """All values later than the two times replaced by noise of a hundred times their size."""
    rng = np.random.default_rng(seed)
    streams = {}
    for name, stream in flight.streams.items():
        values = stream.values.copy()
        late = stream.time_s > (mocap_after_s if name == "mocap" else after_s)
        values[late] = rng.normal(0.0, 100.0, (int(late.sum()), values.shape[1]))
        streams[name] = replace(stream, values=values)
    return replace(flight, streams=streams)


@pytest.mark.parametrize("row", ROWS)
def test_future_samples_change_nothing(case, row):
    """Blackout from t0; at t0 + 5 s the estimate must not know what comes later, of poses and of any other stream."""
    t0 = blackout.starts(case)[1]
    whole = row().estimate(blackout.given_until(case.flight, t0))
    bent = row().estimate(blackout.given_until(spoiled(case.flight, t0 + 5.0, t0), t0))
    before = whole.time_s <= t0 + 5.0
    assert np.array_equal(whole.time_s[before], bent.time_s[: before.sum()])
    assert np.abs(whole.position_m[before] - bent.position_m[: before.sum()]).max() < 1e-6


@pytest.mark.parametrize("row", ROWS)
def test_late_poses_are_used_when_they_have_come(case, row):
    """aided: what has arrived by t alone counts at t, whatever comes afterwards."""
    given = aided.given_to(case, aided.Aiding())
    until = case.spans[0].start_s + 6.0
    whole = row().estimate(given)
    mocap = given["mocap"]
    moved = mocap.values.copy()
    moved[mocap.time_s > until, :3] += 3.0
    bent = row().estimate(given.with_streams(mocap=replace(mocap, values=moved)))
    before = whole.time_s <= until
    assert np.abs(whole.position_m[before] - bent.position_m[before]).max() < 1e-6
    assert np.abs(whole.position_m[~before] - bent.position_m[~before]).max() > 1.0


@pytest.mark.parametrize("row", [ErrorStateEkf, DragMatrixEkf, InvariantEkf])
def test_poses_aid(case, row):
    value = aided.score(case, row(), aided.Aiding())
    assert value.metrics["ate_rmse_m"] < 0.03


def test_an_unknown_delay_is_found(case):
    """Poses half a second late: told, or found by the row whose state it is; the row that believes otherwise is off."""
    aiding = aided.Aiding(delay_s=0.15, noise_m=0.003)
    given = aided.given_to(case, aiding)
    untold = replace(given, metadata={k: v for k, v in given.metadata.items() if k != "pose_delay_s"})
    mocap = case.flight["mocap"]

    def off(estimate):
        late = (estimate.time_s > case.spans[0].start_s + 8.0) & (estimate.time_s < case.spans[-1].end_s)
        truth = mocap.interpolate(("px", "py", "pz"), estimate.time_s[late])
        return np.sqrt(np.mean(np.sum((estimate.position_m[late] - truth) ** 2, axis=1)))

    told, believed = DragMatrixEkf().estimate(given), DragMatrixEkf().estimate(untold)
    found = DelayedPoseEkf().estimate(untold)
    assert off(told) < 0.04
    assert off(found) < 0.5 * off(believed)


def test_a_missing_aid_is_named_and_the_others_go_on(case):
    given = blackout.given_until(case.flight, 9.0)
    for stream in ("motor", "battery"):
        less = given.without_streams(stream)
        with pytest.raises(InputError, match=f"no {stream} stream, which learned_velocity_ekf needs"):
            LearnedVelocityEkf().estimate(less)
        assert np.isfinite(DragMatrixEkf().estimate(less).position_m).all()


def changed(flight, column, function):
    imu = flight["imu"]
    values = imu.values.copy()
    k = imu.index(column)
    values[:, k] = function(values[:, k])
    return flight.with_streams(imu=replace(imu, values=values))


def test_bad_input_is_said_in_one_line(case):
    given = blackout.given_until(case.flight, 15.0)
    imu = given["imu"]
    for column in ("gyro_x", "gyro_y"):
        with pytest.raises(InputError, match=f"{column} turns .* in degrees"):
            DragEkf().estimate(changed(given, column, np.degrees))
        with pytest.raises(InputError, match=f"{column} turns .* other way round"):
            DragEkf().estimate(changed(given, column, np.negative))
    with pytest.raises(InputError, match=r"accelerometer shows .* other way round"):
        DragEkf().estimate(changed(given, "acc_z", np.negative))
    with pytest.raises(InputError, match=r"accelerometer shows .* another unit"):
        DragEkf().estimate(changed(given, "acc_z", lambda a: a / 9.81))
    hole = (imu.time_s > 8.0) & (imu.time_s < 9.0)
    with pytest.raises(InputError, match=r"a hole of 1\.0\d s at"):
        DragEkf().estimate(given.with_streams(imu=imu.rows(~hole)))
    back = imu.time_s.copy()
    back[700:] -= 1.0
    with pytest.raises(InputError, match="goes back by"):
        DragEkf().estimate(given.with_streams(imu=replace(imu, time_s=back)))
    with pytest.raises(InputError, match="a second of poses"):
        DragEkf().estimate(blackout.given_until(case.flight, 0.5))


def test_nan_and_a_late_first_pose_are_lived_with(case):
    given = blackout.given_until(case.flight, 12.0)
    imu, mocap = given["imu"], given["mocap"]
    values = imu.values.copy()
    values[500:505, 0] = np.nan
    poses = mocap.values.copy()
    poses[:300] = np.nan
    estimate = DragMatrixEkf().estimate(given.with_streams(imu=replace(imu, values=values),
                                                           mocap=replace(mocap, values=poses)))
    assert estimate.time_s[0] >= mocap.time_s[300]
    assert np.isfinite(estimate.position_m).all()
    at = np.searchsorted(estimate.time_s, 12.0)
    assert np.linalg.norm(estimate.position_m[at] - case.flight["mocap"].interpolate(("px", "py", "pz"),
                                                                                    np.array([12.0]))[0]) < 0.05


@pytest.mark.parametrize("n", [50_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_covariance_stays_symmetric_and_positive_over_many_steps(n):
    """Poses for the first tenth and ten times a second in stretches, all aids on."""
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(n)
    acc = rng.normal([0.0, 0.0, 9.81], 0.5, (n, 3))
    gyro = rng.normal(0.0, 0.3, (n, 3))
    has = (np.arange(n) % 10 == 0) & ((np.arange(n) < n // 10) | (np.arange(n) // (n // 10) % 2 == 0))
    poses = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (int(has.sum()), 1))
    values = inertial.values_of({**inertial_core.SETTINGS, **DragMatrixEkf.settings})
    state, cov = np.zeros(inertial_core.STATE), np.zeros((inertial_core.ERROR,) * 2)
    inertial_core.start(poses[0], values, state, cov)
    out = np.empty((n, 11))
    arrived = np.concatenate(([0], np.cumsum(has)))
    inertial_core.run(t, t, acc, gyro, np.zeros(n), np.ones(n, bool), inertial.NOTHING, arrived,
                      t[has], poses, values, 0, state, cov, np.zeros((n, 6)), np.zeros((n, 4)), out,
                      np.empty((0, 9, 9)))
    assert np.array_equal(cov, cov.T)
    scale = np.sqrt(np.diag(cov))
    assert np.linalg.eigvalsh(cov / np.outer(scale, scale)).min() > 0.0
    assert np.isfinite(out[:, :10]).all()


def test_the_compiled_step_against_plain_matrices():
    """One propagation and one scalar update, against F P F^T and the textbook gain."""
    rng = np.random.default_rng(4)
    n = inertial_core.ERROR
    a = rng.normal(size=(n, n))
    cov = a @ a.T + np.eye(n)
    rot, f, w, dt = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), rng.normal(size=3), 0.01

    def skew(v):
        return np.cross(np.eye(3), v)

    step = np.eye(n)
    step[0:3, 3:6] = dt * np.eye(3)
    step[3:6, 6:9] = -rot @ skew(f) * dt
    step[3:6, 9:12] = -rot * dt
    step[6:9, 6:9] -= skew(w) * dt
    step[6:9, 12:15] = -np.eye(3) * dt
    step[11, 18] = dt
    step[19, 19], step[20, 20], step[22, 22] = 0.9, 0.9, 0.8
    half, full = np.empty((n, n)), np.empty((n, n))
    inertial_core._transition(cov, half, dt, rot, *f, *w, 0.9, 0.8)
    inertial_core._transition(half, full, dt, rot, *f, *w, 0.9, 0.8)
    assert np.allclose(full, step @ cov @ step.T, atol=1e-9)

    h, x = rng.normal(size=n), np.zeros(n)
    gain = cov @ h / (h @ cov @ h + 0.3)
    joseph = (np.eye(n) - np.outer(gain, h)) @ cov @ (np.eye(n) - np.outer(gain, h)).T + 0.3 * np.outer(gain, gain)
    updated = cov.copy()
    nis = inertial_core._scalar(updated, x, h, 1.7, 0.3, np.empty(n), np.empty(n))
    assert np.allclose(updated, joseph, atol=1e-9)
    assert np.allclose(x, 1.7 * gain)
    assert nis == pytest.approx(1.7**2 / (h @ cov @ h + 0.3))


def test_what_is_said_of_a_position_knows_how_it_was_moved_on():
    """A position moved on by the lateness found: its covariance is that of p + (late + wander) v, to first order."""
    rng = np.random.default_rng(6)
    n, v, on = inertial_core.ERROR, np.array([1.0, -0.4, 0.2]), 0.03
    a = rng.normal(size=(n, n))
    cov, said = a @ a.T, np.empty((9, 9))
    inertial_core._stated(cov, on, v, 1.0, said)
    moved = np.eye(9, n)
    moved[:3, 3:6] = on * np.eye(3)
    moved[:3, 21] = moved[:3, 22] = v
    assert np.allclose(said, moved @ cov @ moved.T)


def test_stamps_that_wander_make_noise_of_what_changes(case):
    """A flight is known less well where its signals change fast; with steady stamps it is not."""
    given = aided.given_to(case, aided.Aiding())
    rows = inertial.rows_of(given)
    steady, wandering = ({**DragMatrixEkf.settings, "stamp": s} for s in (0.0, 0.01))
    a, b = (inertial.run(rows, inertial.values_of(s)).covariance[300:, 3, 3] for s in (steady, wandering))
    assert b.mean() > 1.5 * a.mean()
    assert np.std(b / a) > 0.1


def test_re_timed_stamps_are_not_set_back_again_and_trusted_more(case):
    """A stream that says how well its stamps are known has had its clock's error taken out."""
    given = aided.given_to(case, aided.Aiding())
    imu = given["imu"]
    told = given.with_streams(imu=replace(imu, time_sd_s=np.full(len(imu), 0.008)))
    found, class_settings = DragEkf().estimate(told), DragEkf.settings

    class Trusting(DragEkf):
        radio = False
        settings: ClassVar = {**class_settings, "stamp": STAMP_LEFT * class_settings["stamp"]}

    assert np.array_equal(found.position_m, Trusting().estimate(given).position_m)
    assert not np.array_equal(found.position_m, DragEkf().estimate(given).position_m)


def test_lift_off_is_seen_once_and_only_with_motors(case):
    given = case.flight
    time_s = given["imu"].time_s
    lift = lifted(given, time_s)
    assert lift.sum() == 1
    assert abs(time_s[lift][0] - case.spans[0].start_s) < 1.5
    assert not lifted(given.without_streams("motor"), time_s).any()


def test_missing_packets_tell_how_late_rows_are(flight):
    """A log without drawn rows is not late; rows on a chord make what follows late, and nothing before."""
    imu = flight["imu"]
    rng = np.random.default_rng(2)
    values = imu.values + rng.normal(0.0, 0.01, imu.values.shape)
    alone = flight.without_streams("motor").with_streams(imu=replace(imu, values=values))
    assert not radio_clock.drawn(alone).any()
    assert not radio_clock.lateness(alone).any()
    drawn = values.copy()
    drawn[1001:1006] = values[1000] + np.outer(np.arange(1, 6) / 6.0, values[1006] - values[1000])
    t = imu.time_s.copy()
    t[990:1020] = t[990] + 0.01 * np.arange(30)
    late = radio_clock.lateness(alone.with_streams(imu=replace(imu, values=drawn, time_s=t)))
    assert not late[:1002].any()
    assert late[1006] > 0.02
    assert abs(late[1400]) < 0.02


def test_attitudes_in_quick_succession_count_as_fewer():
    """Errors correlated over 0.3 s: ten poses 10 ms apart say little more than one; at 10 ms the SDs are as they were
    set, and without a correlation at any interval."""
    times = np.array([0.0, 0.01, 0.11])
    assert inertial_core.tilt_factor(times, 1, 0.3) == pytest.approx(1.0)
    assert inertial_core.tilt_factor(times, 2, 0.3) == pytest.approx((1.0 + 3.0) / (1.0 + 30.0))
    assert inertial_core.tilt_factor(times, 2, 0.0) == 1.0
    white, together = (0.1 * inertial_core.tilt_factor(times, j, 0.3) for j in (1, 2))
    assert white / 10.0 < together < 3.5 * white / 10.0


def test_fewer_poses_say_as_much_of_the_tilt_as_many(case):
    """SYNTHETIC: with a correlation, ten times as many poses do not make the stated tilt three times as sure."""
    class Apart(DragMatrixEkf):
        settings: ClassVar = {**DragMatrixEkf.settings, "tilt_s": 0.0}

    def tilt_sd(row, rate_hz):
        found = row().estimate(aided.given_to(case, aided.Aiding(rate_hz=rate_hz, delay_s=0.0, noise_m=0.001)))
        return float(np.sqrt(np.median(found.covariance[-500:, 6, 6])))

    ratio, white = (tilt_sd(row, 10.0) / tilt_sd(row, 100.0) for row in (DragMatrixEkf, Apart))
    assert ratio < white
