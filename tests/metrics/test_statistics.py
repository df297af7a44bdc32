"""Summaries over flights: against NumPy and SciPy, reproducible, and honest about one flight."""

import numpy as np
import pytest
import scipy.stats

from nanobench_tools.metrics.statistics import bootstrap_interval, summary


def test_summary_by_hand():
    found = summary([1.0, 2.0, 3.0, 6.0])
    assert (found["mean"], found["median"], found["n"]) == (3.0, 2.5, 4)
    assert found["std"] == pytest.approx(np.sqrt(3.5))
    assert found["p90"] == pytest.approx(5.1)


def test_one_flight_has_no_interval():
    assert summary([2.0]) == {"mean": 2.0, "std": 0.0, "median": 2.0, "p90": 2.0, "ci95": None, "n": 1}


def test_undefined_flights_are_left_out_and_counted():
    assert summary([1.0, np.nan, 3.0])["n"] == 2
    assert summary([np.nan])["mean"] is None
    with pytest.raises(ValueError, match="infinite"):
        summary([1.0, np.inf])


def test_the_interval_is_scipys():
    x = np.random.default_rng(0).gamma(2.0, size=25)
    ours = bootstrap_interval(x, seed=1, resamples=20000)
    theirs = scipy.stats.bootstrap((x,), np.mean, n_resamples=20000, method="percentile",
                                   rng=np.random.default_rng(2)).confidence_interval
    np.testing.assert_allclose(ours, theirs, rtol=0.02)


def test_the_same_seed_gives_the_same_interval():
    x = np.random.default_rng(0).normal(size=12)
    assert bootstrap_interval(x, 3) == bootstrap_interval(x, 3)
    assert bootstrap_interval(x, 3) != bootstrap_interval(x, 4)


def test_the_interval_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    inside = 0
    for seed in range(400):
        low, high = bootstrap_interval(rng.normal(1.0, 1.0, 30), seed, resamples=500)
        inside += low <= 1.0 <= high
    assert inside / 400 == pytest.approx(0.95, abs=0.04)
