"""Means of a residual in bins, with 95 % bars that know how long disturbances last."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from nanobench_tools.settings import count, number

BLOCK_S = number("mismatch.binned.block_s")
LEAST_BLOCKS = count("mismatch.binned.least_blocks")


@dataclass(frozen=True)
class Means:
    """mean and half (B, ...): half the width of the 95 % interval, nan where there are too few stretches; samples and
    blocks (B,)."""

    mean: np.ndarray
    half: np.ndarray
    samples: np.ndarray
    blocks: np.ndarray

    @property
    def shown(self) -> np.ndarray:
        """(B,) bool: bins with enough stretches."""
        return self.blocks >= LEAST_BLOCKS


def block_numbers(track: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(n,) number of the stretch of BLOCK_S that a sample of a track lies in."""
    slot = np.floor(time_s / BLOCK_S).astype(int)
    return np.unique(np.stack([track, slot]), axis=1, return_inverse=True)[1].reshape(-1)


def binned(values: np.ndarray, bins: np.ndarray, blocks: np.ndarray, count: int) -> Means:
    """values (n, D), bins (n,) from 0 to count - 1, blocks (n,) -> means of every bin.

    The variance of a mean comes from the sums of its stretches, so samples within one may be correlated. Source:
    Cochran 1977, Sampling Techniques, ch. 9: clusters of unequal size.
    """
    pair, where = np.unique(np.stack([bins, blocks]), axis=1, return_inverse=True)
    where, owner = where.reshape(-1), pair[0]
    sums = np.stack([np.bincount(where, column, len(owner)) for column in values.T], axis=1)
    inside = np.bincount(where, minlength=len(owner)).astype(float)
    samples, many = np.bincount(bins, minlength=count), np.bincount(owner, minlength=count)
    size = np.maximum(samples, 1)[:, None]
    mean = np.stack([np.bincount(owner, column, count) for column in sums.T], axis=1) / size
    off = sums - inside[:, None] * mean[owner]
    spread = np.stack([np.bincount(owner, column**2, count) for column in off.T], axis=1)
    freedom = np.maximum(many - 1, 1)[:, None]
    half = student.ppf(0.975, freedom) * np.sqrt(spread * np.maximum(many, 1)[:, None] / freedom) / size
    half[many < LEAST_BLOCKS] = np.nan
    return Means(mean, half, samples, many)
