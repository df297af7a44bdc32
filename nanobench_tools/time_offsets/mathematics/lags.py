"""By how much one vector signal follows another, with an interval that is honest about slow changes.

Both signals are on one even grid and band-limited without delay. The measured signal is modelled as s(t) = A r(t - d)
+ noise with a constant matrix A and independent noise per axis. A is free (sensors may be turned, scaled or mirrored
against the reference) or the identity (world frames agree). The delay d maximises the likelihood. All sums are kept
per short block, so that leaving blocks out (the delete-a-group jackknife) costs nothing.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import t as student

from ...settings import number, setting

FINE_S = number("audit.lags.fine_s")

GROUPS_S = setting("audit.lags.groups_s")

BLOCK_S = number("audit.lags.block_s")
GRID_S = number("audit.lags.grid_s")
LOCAL_S = number("audit.lags.local_s")
REACH_S = number("audit.lags.reach_s")
LEAST_S = number("audit.lags.least_s")


@dataclass(frozen=True)
class LagSums:
    """Second moments per block b and lag l.

    - cross (b, l, k, k): of s(t) r(t - lag)'.
    - reference (b, l, k, k): of r(t - lag) r(t - lag)'; measured (b, k, k): of s s'.
    - lags_s (l,); rows (b, m): of the grid in each block; block_s: its length."""

    lags_s: np.ndarray
    cross: np.ndarray
    reference: np.ndarray
    measured: np.ndarray
    rows: np.ndarray
    block_s: float


@dataclass(frozen=True)
class Lag:
    """``offset_s``: s is late by this; ``half_width_s``: of the 95 % interval; ``matrix`` (k, k): A; ``explained``
    (k,): share of each axis of s that A r(t - d) accounts for; ``noise`` (k,): mean square of the rest."""

    offset_s: float
    half_width_s: float
    matrix: np.ndarray
    explained: np.ndarray
    noise: np.ndarray


STILL = 1e-9
"""A signal that moves by less is a constant: no lag can be read from it."""


def lag_sums(measured: np.ndarray, reference: np.ndarray, use: np.ndarray, step_s: float, reach_s: float = REACH_S,
             block_s: float = BLOCK_S) -> LagSums | None:
    """Sums over the rows in ``use`` (n,) bool of measured and reference (n, k) on one grid of ``step_s``.

    Blocks are whole and without holes; rows closer than ``reach_s`` to the ends of the grid are left out. None with
    less than three seconds of blocks, or where either side stands still.
    """
    n, k = measured.shape
    if not all((np.ptp(x[use], axis=0) > STILL).any() for x in (measured, reference) if use.any()):
        return None
    reach = round(reach_s / step_s)
    use = use.copy()
    use[:reach] = False
    use[n - reach :] = False
    per_block = round(block_s / step_s)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], use.astype(np.int8), [0])))).reshape(-1, 2)
    starts = np.concatenate([np.arange(a, b - per_block + 1, per_block) for a, b in edges] or [np.zeros(0, int)])
    blocks = len(starts)
    if blocks * block_s < LEAST_S:
        return None
    rows = starts[:, None] + np.arange(per_block)
    windows = np.lib.stride_tricks.sliding_window_view(reference, 2 * reach + 1, axis=0)  # row i: r[i .. i + 2 reach]
    lagged = windows[rows - reach][..., ::-1].reshape(blocks, per_block, k * (2 * reach + 1))
    s = measured[rows]
    cross = (s.transpose(0, 2, 1) @ lagged).reshape(blocks, k, k, -1).transpose(0, 3, 1, 2)
    # sums of products over a block are differences of one running sum
    products = (reference[:, :, None] * reference[:, None, :]).reshape(n, k * k)
    total = np.vstack([np.zeros((1, k * k)), np.cumsum(products, axis=0)])
    first = starts[:, None] - np.arange(-reach, reach + 1)
    auto = (total[first + per_block] - total[first]).reshape(blocks, -1, k, k)
    return LagSums(np.arange(-reach, reach + 1) * step_s, cross, auto, s.transpose(0, 2, 1) @ s, rows, block_s)


def residual(cross: np.ndarray, reference: np.ndarray, measured: np.ndarray, free: bool) -> np.ndarray:
    """Sum of squares left per axis, (..., l, k), of sums over blocks (..., l, k, k), (..., l, k, k), (..., k, k)."""
    power = np.diagonal(measured, axis1=-2, axis2=-1)[..., None, :]
    if free:
        size = np.trace(reference, axis1=-2, axis2=-1)[..., None, None]  # 0 where the reference stands still
        regular = reference + np.maximum(1e-9 * size, 1e-300) * np.eye(measured.shape[-1])
        solved = np.linalg.solve(regular, np.swapaxes(cross, -1, -2))
        left = power - np.einsum("...lab,...lba->...la", cross, solved)
    else:
        left = power - 2.0 * np.diagonal(cross, axis1=-2, axis2=-1) + np.diagonal(reference, axis1=-2, axis2=-1)
    return np.asarray(np.maximum(left, 1e-12 * power + 1e-300))


def _cost(left: np.ndarray, free: bool) -> np.ndarray:
    """Minus the logarithm of the likelihood, (..., l), of what is left, (..., l, k)."""
    # world vectors share their noise over the axes; axes of a sensor have their own
    return np.asarray(np.log(left).sum(axis=-1) if free else np.log(left.sum(axis=-1)))


def best(lags_s: np.ndarray, left: np.ndarray, free: bool) -> np.ndarray:
    """(...,) most likely lag, between the grid's points, of the sums of squares left (..., l, k).

    The sums are smooth and are what is interpolated; their logarithm has a sharp bottom where the fit is good.
    """
    step = lags_s[1] - lags_s[0]
    reach = 3 if len(lags_s) > 7 else 1
    start = np.clip(np.argmin(_cost(left, free), axis=-1) - reach, 0, len(lags_s) - 2 * reach - 1)
    near = np.take_along_axis(left, (start[..., None] + np.arange(2 * reach + 1))[..., None], axis=-2)
    fine = np.arange(0.0, 2 * reach + 1e-9, FINE_S / step)
    values = CubicSpline(np.arange(2 * reach + 1.0), near, axis=-2)(fine)
    cost = _cost(np.maximum(values, 1e-3 * near.min(axis=-2, keepdims=True)), free)
    i = np.clip(np.argmin(cost, axis=-1), 1, len(fine) - 2)
    before, here, after = (np.take_along_axis(cost, i[..., None] + d, axis=-1)[..., 0] for d in (-1, 0, 1))
    bend = before - 2.0 * here + after
    vertex = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    return np.asarray(lags_s[start] + (i + np.clip(vertex, -1.0, 1.0)) * (fine[1] - fine[0]) * step)


def best_lag(sums: LagSums, free: bool = True) -> Lag:
    """The lag of the whole, its interval, and the matrix at that lag."""
    cross, reference, measured = (x.sum(axis=0) for x in (sums.cross, sums.reference, sums.measured))
    offset = float(best(sums.lags_s, residual(cross, reference, measured, free), free))
    near = np.flatnonzero(np.abs(sums.lags_s - offset) <= LOCAL_S + 1e-9)
    k = measured.shape[0]
    cross_at, reference_at = (CubicSpline(sums.lags_s[near], x[near])(offset) for x in (cross, reference))
    matrix = np.linalg.lstsq(reference_at, cross_at.T, rcond=1e-9)[0].T if free else np.eye(k)
    left = residual(cross_at[None], reference_at[None], measured, free)[0]
    power = np.maximum(np.diag(measured), 1e-300)
    return Lag(offset, _half_width(sums, near, free), matrix, 1.0 - left / power, left / sums.rows.size)


def _half_width(sums: LagSums, near: np.ndarray, free: bool) -> float:
    """Half width of the 95 % interval: the largest of the jackknife's over the lengths of group."""
    lags, blocks = sums.lags_s[near], len(sums.rows)
    widest = 0.0
    for length in GROUPS_S:
        groups = max(3, round(blocks * sums.block_s / length))
        if groups > blocks:
            continue
        edges = np.linspace(0, blocks, groups + 1).round().astype(int)[:-1]
        parts = [
            np.add.reduceat(x, edges, axis=0) for x in (sums.cross[:, near], sums.reference[:, near], sums.measured)
        ]
        without = [part.sum(axis=0) - part for part in parts]
        offsets = best(lags, residual(without[0], without[1], without[2], free), free)
        variance = (groups - 1) / groups * np.sum((offsets - offsets.mean()) ** 2)
        widest = max(widest, float(student.ppf(0.975, groups - 1) * np.sqrt(variance)))
    return float(np.hypot(widest, GRID_S))
