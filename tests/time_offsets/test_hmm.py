"""The chain against an enumeration of all its paths, and the delivery model against closed cases."""

import itertools

import numpy as np
import pytest

from nanobench_tools.time_offsets.mathematics.hmm import add_student_evidence, log_evidence, posterior
from nanobench_tools.time_offsets.mathematics.packet_delay import CELL_S, log_step_prior
from nanobench_tools.time_offsets.moving.steps import log_steps


@pytest.mark.parametrize("seed", range(4))
def test_posterior_equals_the_sum_over_all_paths(seed):
    rng = np.random.default_rng(seed)
    n, m, up, width = 4, 4, 1, 3  # steps of -1, 0, +1 cells
    likelihood, transition = rng.normal(size=(n, m)), rng.normal(size=(n, width))
    smoothed, filtered = np.zeros((n, m)), np.zeros((n, m))
    for length in range(1, n + 1):
        for path in itertools.product(range(m), repeat=length):
            steps = np.diff(path)
            if np.any(np.abs(steps) > 1):
                continue
            weight = np.exp(likelihood[range(length), path].sum()
                            + sum(transition[i + 1, step + width - 1 - up] for i, step in enumerate(steps)))
            filtered[length - 1, path[-1]] += weight
            if length == n:
                smoothed[range(n), path] += weight
    assert log_evidence(likelihood, transition, up) == pytest.approx(np.log(smoothed[0].sum() / m), abs=1e-12)
    for table, causal in ((smoothed, False), (filtered, True)):
        expected = table / table.sum(axis=1, keepdims=True)
        np.testing.assert_allclose(posterior(likelihood, transition, up, causal), expected, atol=1e-12)


def test_contradicting_evidence_does_not_end_the_chain():
    likelihood = np.full((6, 5), -1e6)
    likelihood[:3, 0] = likelihood[3:, 4] = 0.0  # a leap that no step allows
    result = posterior(likelihood, np.zeros((6, 2)), 1, False)
    assert np.isfinite(result).all()
    np.testing.assert_allclose(result.sum(axis=1), 1.0)


def test_evidence_is_highest_at_the_true_shift_and_limits_spikes():
    t = np.arange(400) * CELL_S
    predicted = np.sin(7.0 * t)[:, None]
    cells = np.arange(100, 300, 4)
    measured = predicted[cells - 6].copy()  # six cells late
    measured[10] += 1e6
    table = np.zeros((1, 21))
    rows = np.zeros(len(cells), dtype=np.int64)
    add_student_evidence(table, rows, cells, predicted, measured, np.array([0.1]), 1.0, 0)
    assert np.argmax(table[0]) == 6


def test_the_step_prior_forbids_time_running_backward():
    steps, log_p, up = log_step_prior(0.01)
    assert steps.max() == pytest.approx(0.01)
    assert up == 4
    assert np.exp(log_p).sum() == pytest.approx(1.0)


def test_odometry_reads_how_far_firmware_time_advanced():
    rng = np.random.default_rng(1)
    t = np.arange(200) * 0.01
    late = np.where(t > 1.0, 0.03 - np.minimum(t - 1.0, 0.03), 0.0)  # jumps by 30 ms, then catches up
    velocity = np.tile([0.6, -0.3, 0.2], (200, 1))
    position = (t - late)[:, None] * velocity + rng.normal(0.0, 1e-5, (200, 3))
    steps, _, _ = log_step_prior(0.01)
    likely = log_steps(steps, t, np.diff(position, axis=0), velocity[1:], 0.15, 0.5)
    best = steps[np.argmax(likely, axis=1)]
    expected = np.concatenate(([steps[0]], np.clip(np.diff(late), steps[0], steps[-1])))
    np.testing.assert_allclose(best[1:][np.abs(np.diff(late)) < 0.0101], expected[1:][np.abs(np.diff(late)) < 0.0101],
                               atol=CELL_S)


def test_odometry_says_nothing_of_a_vehicle_that_hovers():
    steps, _, _ = log_step_prior(0.01)
    t = np.arange(100) * 0.01
    assert not log_steps(steps, t, np.zeros((99, 3)), np.full((99, 3), 0.01), 0.15, 0.5).any()
