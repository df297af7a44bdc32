"""NEES and NIS of a row: errors drawn from the covariance stated, and errors that hang together."""

import numpy as np
import pytest

from nanobench_tools.methods import Estimate
from nanobench_tools.metrics.consistency import independent_samples
from nanobench_tools.protocols import blackout
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
    """Squares of a first-order process that keeps 0.99 from row to row keep 0.99^2: n (1 - 0.98) / (1 + 0.98) rows."""
    x = drawn(20_000, 2, 0.99)
    keep = 0.99**2
    assert independent_samples(x) == pytest.approx(20_000 * (1.0 - keep) / (1.0 + keep), rel=0.35)
    assert independent_samples(drawn(2000, 3)) == pytest.approx(2000.0, rel=0.15)


@pytest.mark.slow
def test_the_band_holds_95_percent_of_runs_whose_errors_hang_together():
    """300 runs of three axes that keep 0.9, 0.95 and 0.98; with three in a hundred of scatter by chance."""
    rng, keep = np.random.default_rng(0), np.array([0.9, 0.95, 0.98])
    x = np.empty((2500, 300, 3))
    x[0] = rng.normal(size=(300, 3))
    for i in range(1, len(x)):
        x[i] = keep * x[i - 1] + np.sqrt(1.0 - keep**2) * rng.normal(size=(300, 3))
    inside = np.mean([scores(x[:, run], np.eye(3))["nees_in_band"] for run in range(300)])
    assert 0.91 < inside < 0.98


def test_what_is_not_said_is_not_scored():
    n = 10
    plain = Estimate(np.arange(n), np.zeros((n, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))
    assert consistency_metrics(plain, np.arange(n), np.zeros((n, 3))) == {}
    nis = scores(drawn(50, 5), np.eye(3), nis=np.full(40, 3.0), nis_dof=np.full(40, 3))
    assert (nis["nis"], nis["nis_in_band"]) == (1.0, 1.0)
    assert np.isnan(scores(drawn(50, 5), np.zeros((3, 3)))["nees"])


def test_windows_that_overlap_count_as_those_that_fit_side_by_side():
    """A mean NEES of 4.2 from 40 windows is out of the band of 40, and in that of 10."""
    found = blackout.consistency_after({1.0: [4.2] * 40, 20.0: [4.2] * 40, 5.0: []})
    assert (found["nees_1s"], found["nees_in_band_1s"], found["nees_in_band_20s"]) == (pytest.approx(4.2), 0.0, 1.0)
    assert np.isnan(found["nees_in_band_5s"])
    assert blackout.consistency_after({0.0: [14.0, 15.0]})["inside_3_sigma_0s_percent"] == 50.0


def test_a_consistent_estimator_is_in_the_band_on_nineteen_flights_of_twenty():
    rng = np.random.default_rng(5)
    inside = [blackout.consistency_after({5.0: rng.chisquare(3.0, 7).tolist()})["nees_in_band_5s"] for _ in range(2000)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)
