"""Disturbances that last: an autoregression per channel, and its inverse, which whitens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter


@dataclass(frozen=True)
class Memory:
    """Prediction of a sample from the previous ones: ``weights`` (p,), the nearest first. ``runs`` (n,) counts the
    samples without a hole before each."""

    weights: np.ndarray
    runs: np.ndarray

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """values (n, ...) -> the part that the previous samples do not predict; 0 where there are too few of them."""
        found = np.array(values, float)
        for lag, weight in enumerate(self.weights, 1):
            found[lag:] -= weight * values[:-lag]
        found[~self.judged] = 0.0
        return found

    def colour(self, white: np.ndarray) -> np.ndarray:
        """The inverse of ``whiten``, from rest at the beginning of every run: (n,) -> (n,)."""
        starts = np.flatnonzero(self.runs == 0)[1:]
        poles = np.concatenate([[1.0], -self.weights])
        return np.concatenate([lfilter([1.0], poles, part) for part in np.split(white, starts)])

    @property
    def judged(self) -> np.ndarray:
        """(n,) bool: samples with enough before them."""
        return self.runs >= len(self.weights)


def runs_of(at: np.ndarray, step: int, track: np.ndarray) -> np.ndarray:
    """at (n,) rows, track (rows,) -> (n,) number of samples ``step`` rows apart on one track before each."""
    follows = np.concatenate([[False], (np.diff(at) == step) & (track[at[1:]] == track[at[:-1]])])
    number = np.arange(len(at))
    return number - np.maximum.accumulate(np.where(follows, 0, number))


def fit_memory(residual: np.ndarray, columns: np.ndarray, runs: np.ndarray, order: int) -> Memory:
    """Least squares on the previous ``order`` samples, together with ``columns`` (n, k) (Ljung 1999, System
    Identification, ch. 10: ARX).

    The part that the columns explain is not counted as memory.
    """
    lags = np.stack([np.concatenate([np.zeros(lag), residual[:-lag]]) for lag in range(1, order + 1)], axis=1)
    use = runs >= order
    size = np.linalg.norm(columns[use], axis=0)
    design = np.concatenate([lags, columns[:, size > 0.0] / size[size > 0.0]], axis=1)[use]
    weights = np.linalg.lstsq(design, residual[use], rcond=1e-8)[0][:order]
    return Memory(weights, runs)
