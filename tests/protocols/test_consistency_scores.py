"""NEES and NIS of a row: errors drawn from the covariance stated, and errors that hang together."""

import numpy as np
import pytest

from nanobench_tools.methods import Estimate
from nanobench_tools.metrics.consistency import independent_samples
from nanobench_tools.protocols.scoring3 import consistency_metrics


def scores(error, covariance, **more):
    n = len(error)
    estimate = Estimate(np.arange(n) * 0.01, error, np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)), None,
                        np.broadcast_to(covariance, (n, 3, 3)), **more)
    return consistency_metrics(estimate, np.arange(n), np.zeros((n, 3)))


def drawn(n, seed, keep=0.0):
    rng = np.random.default_rng(seed)
    x = np.empty((n, 3))
    x[0] = rng.normal(size=3)
    for i in range(1, n):
        x[i] = keep * x[i - 1] + np.sqrt(1.0 - keep**2) * rng.normal(size=3)
    return x


def test_consistent_and_overconfident():
    factor = np.array([[0.02, 0.0, 0.0], [0.01, 0.03, 0.0], [0.0, 0.005, 0.01]])
    error = drawn(2000, 1) @ factor.T
    fair, bold = scores(error, factor @ factor.T), scores(error, 0.25 * factor @ factor.T)
    assert fair["nees"] == pytest.approx(3.0, abs=0.2)
    assert (fair["nees_in_band"], bold["nees_in_band"]) == (1.0, 0.0)
    assert bold["nees"] == pytest.approx(4.0 * fair["nees"])


def test_errors_that_hang_together_count_as_fewer():
    """A first-order process that keeps 0.99 from row to row has n (1 - 0.99) / (1 + 0.99) independent rows."""
    x = drawn(20_000, 2, 0.99)
    assert independent_samples(x) == pytest.approx(20_000 * 0.01 / 1.99, rel=0.35)
    assert independent_samples(drawn(2000, 3)) == pytest.approx(2000.0, rel=0.15)
    inside = [scores(drawn(2000, seed, 0.95), np.eye(3))["nees_in_band"] for seed in range(30)]
    assert np.mean(inside) > 0.7


def test_what_is_not_said_is_not_scored():
    n = 10
    plain = Estimate(np.arange(n), np.zeros((n, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))
    assert consistency_metrics(plain, np.arange(n), np.zeros((n, 3))) == {}
    nis = scores(drawn(50, 5), np.eye(3), nis=np.full(40, 3.0), nis_dof=np.full(40, 3))
    assert (nis["nis"], nis["nis_in_band"]) == (1.0, 1.0)
    assert np.isnan(scores(drawn(50, 5), np.zeros((3, 3)))["nees"])
