"""One number per flight -> what a table shows: mean, SD, median, 90th percentile, interval. Flights are the units.

Rows of one flight are not independent, so intervals come from drawing flights, never samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

RESAMPLES = 2000
"""Bootstrap draws: the ends of a 95 % interval then scatter by about 3 % of its length."""


def bootstrap_interval(values: Sequence[float] | np.ndarray, seed: int = 0, probability: float = 0.95,
                       resamples: int = RESAMPLES) -> tuple[float, float] | None:
    """Percentile interval of the mean over flights (Efron 1979); None for fewer than two flights.

    values (n,) one per flight. The same values and seed always give the same interval. With fewer than about
    8 flights the percentile interval is too short (coverage near 85 % at n = 5).
    """
    x = np.asarray(values, float)
    if len(x) < 2:
        return None
    rng = np.random.default_rng(seed)
    means = x[rng.integers(0, len(x), (resamples, len(x)))].mean(axis=1)
    tail = 50.0 * (1.0 - probability)
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return float(low), float(high)


def summary(values: Sequence[float] | np.ndarray, seed: int = 0) -> dict[str, Any]:
    """{mean, std (ddof 0), median, p90, ci95: [lo, hi] | None, n} over flights; unit of ``values``.

    A flight where the metric is not defined (nan: a path too short, no rotation to align) is left out and n says so;
    with none left every figure is None. Raises ValueError on infinity: that is a fault, not a figure.

    >>> summary([1.0, 3.0])["std"], summary([2.0])["ci95"]
    (1.0, None)
    """
    x = np.asarray(values, float)
    if np.isinf(x).any():
        raise ValueError("an infinite value among the flights")
    x = x[~np.isnan(x)]
    if not len(x):
        return {"mean": None, "std": None, "median": None, "p90": None, "ci95": None, "n": 0}
    interval = bootstrap_interval(x, seed)
    return {"mean": float(x.mean()), "std": float(x.std()), "median": float(np.median(x)),
            "p90": float(np.percentile(x, 90.0)), "ci95": None if interval is None else list(interval), "n": len(x)}


def bootstrap_ratio(sums: np.ndarray, counts: np.ndarray, seed: int = 0, probability: float = 0.95,
                    resamples: int = RESAMPLES) -> tuple[np.ndarray, np.ndarray] | None:
    """Intervals of pooled means: flights are drawn, then all their windows are pooled; None for fewer than two flights.

    sums (n, ...) of errors per flight, counts (n,) of windows behind them. Returns (low, high), each (...).
    """
    total, n = np.asarray(sums, float), np.asarray(counts, float)
    if len(total) < 2:
        return None
    draws = np.random.default_rng(seed).multinomial(len(total), np.full(len(total), 1.0 / len(total)), resamples)
    pooled = np.tensordot(draws, total, axes=1) / np.expand_dims(draws @ n, tuple(range(1, total.ndim)))
    tail = 50.0 * (1.0 - probability)
    low, high = np.percentile(pooled, [tail, 100.0 - tail], axis=0)
    return low, high
