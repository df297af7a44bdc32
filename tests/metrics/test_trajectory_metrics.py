"""ATE, RTE and the rest against evo, SciPy, cases worked by hand, and invariances."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from nanobench_tools import so3
from nanobench_tools.metrics import alignment, attitude, timing, trajectory

HAND = tomllib.loads((Path(__file__).parents[1] / "references" / "metrics_by_hand.toml").read_text())


def paths(seed: int, n: int = 400):
    """A smooth curve with attitude, and a noisy estimate of it in another frame."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 6, n)
    truth = np.stack([np.sin(t), np.cos(1.7 * t), 1 + 0.3 * np.sin(3 * t)], axis=1)
    q = Rotation.from_euler("ZYX", np.stack([0.4 * t, 0.2 * np.sin(t), 0.1 * np.cos(t)], 1)).as_quat()
    turn = Rotation.from_rotvec(rng.normal(size=3))
    estimate = turn.apply(truth + 0.02 * rng.normal(size=(n, 3))) + rng.normal(size=3)
    qe = (turn * Rotation.from_quat(q) * Rotation.from_rotvec(0.02 * rng.normal(size=(n, 3)))).as_quat()
    return t, truth, q, estimate, qe


def evo_pair(t, truth, q, estimate, qe):
    from evo.core.trajectory import PoseTrajectory3D

    def make(p, x):
        return PoseTrajectory3D(positions_xyz=p, orientations_quat_wxyz=np.roll(x, 1, axis=1), timestamps=t)

    return make(truth, q), make(estimate, qe)


@pytest.mark.parametrize("seed", range(4))
def test_ate_agrees_with_evo(seed):
    from evo.core import metrics

    t, truth, q, estimate, qe = paths(seed)
    reference, other = evo_pair(t, truth, q, estimate, qe)
    for aligned in (False, True):
        if aligned:
            other.align(reference)
        ape = metrics.APE(metrics.PoseRelation.translation_part)
        ape.process_data((reference, other))
        ours = trajectory.ate(estimate, truth, "se3" if aligned else "none")
        assert ours.rmse_m == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)
        assert ours.mean_m == pytest.approx(ape.get_statistic(metrics.StatisticsType.mean), rel=1e-9)
        np.testing.assert_allclose(ours.errors_m, ape.error, atol=1e-9)


@pytest.mark.parametrize("delta", [1, 7, 50])
def test_relative_errors_agree_with_evo(delta):
    from evo.core import metrics
    from evo.core.units import Unit

    t, truth, q, estimate, qe = paths(5)
    i = np.arange(len(t) - delta)
    moved, turned = trajectory.relative_errors(estimate, qe, truth, q, i, i + delta)
    for relation, ours in ((metrics.PoseRelation.translation_part, moved),
                           (metrics.PoseRelation.rotation_angle_rad, turned)):
        rpe = metrics.RPE(relation, delta, Unit.frames, all_pairs=True)
        rpe.process_data(evo_pair(t, truth, q, estimate, qe))
        np.testing.assert_allclose(ours, rpe.error, atol=1e-7)


def test_attitude_agrees_with_evo_and_scipy():
    from evo.core import metrics

    t, truth, q, _, _ = paths(1)
    qe = (Rotation.from_quat(q) * Rotation.from_rotvec(np.random.default_rng(0).normal(size=(len(t), 3)))).as_quat()
    ape = metrics.APE(metrics.PoseRelation.rotation_angle_rad)
    ape.process_data(evo_pair(t, truth, q, truth, qe))
    ours = attitude.geodesic_errors(qe, q)
    np.testing.assert_allclose(ours, ape.error, atol=1e-7)
    np.testing.assert_allclose(ours, (Rotation.from_quat(q).inv() * Rotation.from_quat(qe)).magnitude(), atol=1e-12)
    assert np.array_equal(attitude.geodesic_errors(-q, q), np.zeros(len(q)))


def test_alignment_agrees_with_scipy():
    _, truth, _, estimate, _ = paths(2)
    ours = alignment.align(estimate, truth)
    theirs, _ = Rotation.align_vectors(truth - truth.mean(0), estimate - estimate.mean(0))
    np.testing.assert_allclose(ours.rotation, theirs.as_matrix(), atol=1e-9)
    assert np.linalg.det(ours.rotation) == pytest.approx(1.0)
    assert ours.angle_rad == pytest.approx(theirs.magnitude())


def test_alignment_does_not_mirror():
    _, truth, _, _, _ = paths(3)
    mirrored = truth * [1.0, 1.0, -1.0]
    assert np.linalg.det(alignment.align(mirrored, truth).rotation) == pytest.approx(1.0)
    assert trajectory.ate(mirrored, truth).rmse_m > 0.05


@pytest.mark.slow
def test_yaw_alignment_is_the_best_yaw():
    _, truth, _, _, _ = paths(4)
    estimate = Rotation.from_euler("ZX", [0.7, 0.1]).apply(truth) + np.array([1.0, -2.0, 0.5])
    found = alignment.align(estimate, truth, "yaw")
    np.testing.assert_allclose(found.rotation[2], [0, 0, 1])

    def cost(yaw):
        r = Rotation.from_euler("Z", yaw).as_matrix()
        centred = (estimate - estimate.mean(0)) @ r.T - (truth - truth.mean(0))
        return np.mean(np.sum(centred**2, axis=1))

    grid = np.linspace(-np.pi, np.pi, 4001)
    best = grid[np.argmin([cost(y) for y in grid])]
    assert np.arctan2(found.rotation[1, 0], found.rotation[0, 0]) == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("points", [
    np.zeros((50, 3)), np.outer(np.linspace(0, 1, 50), [1.0, 2.0, -1.0]), np.array([[1.0, 2.0, 3.0]])])
def test_what_does_not_determine_a_rotation_raises(points):
    other = np.random.default_rng(0).normal(size=points.shape)
    for estimate, truth in ((points, other), (other, points)):
        with pytest.raises(alignment.AlignmentError):
            alignment.align(estimate, truth)


def test_a_vertical_line_has_no_yaw():
    up = np.outer(np.linspace(0, 1, 50), [0.0, 0.0, 1.0])
    with pytest.raises(alignment.AlignmentError):
        alignment.align(up, up, "yaw")


def test_nan_and_shapes_raise():
    good = np.random.default_rng(0).normal(size=(5, 3))
    bad = good.copy()
    bad[2, 1] = np.nan
    for estimate, truth in ((bad, good), (good, good[:4]), (good[:0], good[:0]), (good[:, :2], good[:, :2])):
        with pytest.raises(ValueError, match=r"not a number|must both|no rows"):
            trajectory.ate(estimate, truth)
    with pytest.raises(ValueError, match="unknown alignment"):
        alignment.align(good, good, "sim3")


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-9, 9)] * 3))
def test_moving_the_estimates_world_changes_no_aligned_error(seed, turn, shift):
    _, truth, q, estimate, qe = paths(seed, 100)
    r = Rotation.from_rotvec(turn)
    moved, turned = r.apply(estimate) + shift, (r * Rotation.from_quat(qe)).as_quat()
    np.testing.assert_allclose(trajectory.ate(moved, truth).errors_m, trajectory.ate(estimate, truth).errors_m,
                               atol=1e-9)
    assert trajectory.rte(moved, turned, truth, q) == pytest.approx(trajectory.rte(estimate, qe, truth, q), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-9, 9)] * 3))
def test_moving_both_worlds_changes_no_error_at_all(seed, turn, shift):
    _, truth, _, estimate, _ = paths(seed, 100)
    r = Rotation.from_rotvec(turn)

    def move(x):
        return r.apply(x) + shift

    for ours in (lambda e, t: trajectory.ate(e, t, "none").rmse_m, trajectory.rte_published,
                 trajectory.drift_percent):
        assert ours(move(estimate), move(truth)) == pytest.approx(ours(estimate, truth), abs=1e-9)


@pytest.mark.parametrize("case", HAND["rte_published"])
def test_rte_by_hand(case):
    truth, estimate = (np.outer(case[k], [1.0, 0.0, 0.0]) for k in ("truth_x", "estimate_x"))
    starts, ends = trajectory.pairs_by_path(truth, 1.0, case["every"])
    assert starts.tolist() == case["starts"]
    assert ends.tolist() == case["ends"]
    assert trajectory.rte_published(estimate, truth, 1.0, case["every"]) == pytest.approx(case["expected_m"])


def test_rte_of_a_path_too_short_is_not_a_number():
    short = np.outer(np.linspace(0, 0.5, 20), [1.0, 0, 0])
    q = np.tile([0.0, 0, 0, 1], (20, 1))
    assert np.isnan(trajectory.rte_published(short, short))
    assert np.isnan(trajectory.rte(short, q, short, q))


def test_published_rte_counts_a_yaw_error_that_the_proper_one_does_not():
    _, truth, q, _, _ = paths(6)
    yaw = Rotation.from_euler("Z", 0.1)
    estimate, qe = yaw.apply(truth), (yaw * Rotation.from_quat(q)).as_quat()
    assert trajectory.rte(estimate, qe, truth, q) == pytest.approx(0.0, abs=1e-12)
    assert trajectory.rte_published(estimate, truth) > 0.05


def test_velocity_and_published_attitude_by_hand():
    v = HAND["velocity"]
    assert trajectory.velocity_rmse(v["estimate"], v["truth"]) == pytest.approx(v["expected_m_s"], rel=1e-12)
    a = HAND["published_attitude"]
    assert attitude.published_euler_rmse_deg([a["estimate_deg"]], [a["truth_rad"]]) == pytest.approx(a["expected"])


def test_drift_percent():
    truth = np.outer(np.linspace(0, 10, 11), [1.0, 0, 0])
    estimate = truth + np.outer(np.linspace(0, 1, 11), [0.0, 0.5, 0.0]) + 3.0
    assert trajectory.drift_percent(estimate, truth) == pytest.approx(5.0)
    assert np.isnan(trajectory.drift_percent(truth * 0, truth * 0))


def test_euler_errors_wrap():
    errors = attitude.euler_errors([[0.0, 0.0, np.pi - 0.1]], [[0.0, 0.0, -np.pi + 0.1]])
    np.testing.assert_allclose(errors, [[0, 0, -0.2]], atol=1e-12)


def test_a_constant_body_rotation_is_taken_away():
    _, _, q, _, _ = paths(7)
    q = q * np.where(np.arange(len(q)) % 2, 1.0, -1.0)[:, None]
    offset = Rotation.from_rotvec([0.02, -0.05, 0.01])
    turned = (Rotation.from_quat(q) * offset).as_quat()
    assert np.degrees(attitude.geodesic_rmse(turned, q)) > 2.0
    assert attitude.geodesic_rmse(attitude.without_constant_rotation(turned, q), q) < 1e-9


@pytest.mark.parametrize("delay", [-0.08, 0.0, 0.021, 0.17])
def test_a_delay_is_found_and_is_along_the_track(delay):
    t = np.arange(0, 20, 0.01)

    def path(x):
        return np.stack([np.sin(x), np.cos(1.7 * x), 0.3 * np.sin(3 * x)], axis=1)

    truth, late = path(t), path(t - delay)
    found = timing.constant_delay(t, late, t, truth)
    assert found.delay_s == pytest.approx(delay, abs=2e-5)
    assert found.rmse_after_m < 5e-5
    speed = np.gradient(truth, t, axis=0)
    split = timing.along_across(late, truth, speed)
    assert split.across_rmse_m <= 0.35 * split.along_rmse_m + 1e-12
    assert np.hypot(split.along_rmse_m, split.across_rmse_m) == pytest.approx(
        trajectory.ate(late, truth, "none").rmse_m, rel=1e-6, abs=1e-12)


def test_along_and_across_by_hand():
    truth = np.outer(np.arange(5.0), [1.0, 0, 0])
    split = timing.along_across(truth + np.array([0.3, 0.0, 0.4]), truth, np.tile([2.0, 0, 0], (5, 1)))
    assert (split.along_rmse_m, split.across_rmse_m, split.n) == pytest.approx((0.3, 0.4, 5))
    still = timing.along_across(truth, truth, truth * 0)
    assert still.n == 0
    assert np.isnan(still.along_rmse_m)


def test_no_rows_inside_the_truth_for_a_delay():
    t = np.arange(0, 0.3, 0.01)
    with pytest.raises(ValueError, match="inside the span"):
        timing.constant_delay(t, np.zeros((30, 3)), t, np.zeros((30, 3)))


def test_q_and_minus_q_score_zero():
    q = so3.exp(np.random.default_rng(0).normal(size=(20, 3)))
    assert attitude.geodesic_rmse(-q, q) == 0.0


@pytest.mark.parametrize("mode", ["se3", "yaw"])
def test_errors_of_a_point_and_of_a_line_are_known_without_a_rotation(mode):
    truth = np.random.default_rng(3).normal(size=(200, 3))
    point = trajectory.ate(np.ones((200, 3)), truth, mode, unique=False)
    assert point.rmse_m == pytest.approx(np.sqrt(truth.var(axis=0).sum()))  # all that is left is the spread
    line = np.arange(200.0)[:, None] * [0.01, 0.0, 0.0]
    aligned = trajectory.ate(line, line[::, [1, 0, 2]] + 3.0, mode, unique=False)
    assert aligned.rmse_m == pytest.approx(0.0, abs=1e-9)
    for turn in np.linspace(0.0, 3.0, 7):
        r = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        moved = line @ r.T - (line @ r.T).mean(axis=0) + truth.mean(axis=0)
        assert trajectory.ate(line, truth, mode, unique=False).rmse_m <= trajectory.rms(
            np.linalg.norm(moved - truth, axis=1)) + 1e-12
