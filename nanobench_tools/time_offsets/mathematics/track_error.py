"""The time error of the estimated position, row by row: how far it lies ahead or behind along its own path.

An error of time moves a position along the path and never across it, so the error across is the placebo. An estimate
that is merely inaccurate errs as much across as along. In the published recordings it is 20 mm along and 1 mm across.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ...settings import count, number
from .steadiness import CHANCE, SMALLEST_WANDER_S, SURELY_SD, Steadiness

SLOWEST_M_S = number("audit.track_error.slowest_m_s")
OFF_TRACK = number("audit.track_error.off_track")
BLOCK_S = number("audit.track_error.block_s")
OFF_TRACK_M = number("audit.track_error.off_track_m")
FULL_ROWS = count("audit.track_error.full_rows")


@dataclass(frozen=True, kw_only=True)
class TrackError(Steadiness):
    """``time_s``, ``late_s`` (n,): rows fast enough and how late each position is beyond the mean and the slope;
    ``wander_sd_s``: its scatter beyond that across, which is noise_sd_s, as a time; ``mean_sd_s``: standard deviation
    of these rows' mean as an estimate of that of the whole recording."""

    time_s: np.ndarray
    late_s: np.ndarray
    mean_sd_s: float

    @property
    def detectable_wander_s(self) -> float:
        """Standard deviation found with 99.9 % probability: the mean logarithm of (along / across)^2 over the blocks
        scatters by about 1.3 / sqrt(blocks)."""
        gain = np.exp((student.isf(CHANCE, max(self.blocks - 1, 1)) + SURELY_SD) * 1.3 / np.sqrt(self.blocks))
        return max(SMALLEST_WANDER_S, float(self.noise_sd_s * np.sqrt(max(gain - 1.0, 0.0))))


def track_error(estimate: np.ndarray, position: np.ndarray, velocity: np.ndarray, use: np.ndarray, time_s: np.ndarray,
                lag_s: float) -> TrackError | None:
    """estimate, position, velocity (n, 3) on the grid time_s (n,); use (n,) bool; lag_s: mean delay of the estimate.

    None with fewer than eight seconds of fast rows.
    """
    rows = np.flatnonzero(use)
    behind = time_s[rows] - lag_s
    p = np.stack([np.interp(behind, time_s, position[:, k]) for k in range(3)], axis=1)
    v = np.stack([np.interp(behind, time_s, velocity[:, k]) for k in range(3)], axis=1)
    speed = np.linalg.norm(v, axis=1)
    fast = speed > SLOWEST_M_S
    if not fast.any():
        return None
    t, p, v, speed = time_s[rows][fast], p[fast], v[fast], speed[fast]
    error = p - estimate[rows][fast]
    error -= np.median(error, axis=0)
    direction = v / speed[:, None]
    along = np.sum(error * direction, axis=1)
    across = error - along[:, None] * direction
    off = np.linalg.norm(across, axis=1)
    fits = off < OFF_TRACK * np.median(off) + OFF_TRACK_M
    t, along, across, speed = t[fits], along[fits], across[fits], speed[fits]
    late = along / speed
    across2 = 0.5 * np.sum(across**2, axis=1) / speed**2
    block = np.unique(np.floor((t - t[0]) / BLOCK_S), return_inverse=True)[1]
    count = np.bincount(block)
    full = count >= FULL_ROWS
    if full.sum() < 8:
        return None

    def per_block(x: np.ndarray) -> np.ndarray:
        return (np.bincount(block, x) / count)[full]

    # drift from the blocks' means, so that their scatter carries the correlation of the rows
    centre, mean = per_block(t), per_block(late)
    n = len(mean)
    c = centre - centre.mean()
    slope = float(c @ (mean - mean.mean()) / (c @ c))
    rest = mean - mean.mean() - slope * c
    slope_sd = float(np.sqrt(rest @ rest / (n - 2) / (c @ c)))
    p_drift = float(2.0 * student.sf(abs(slope) / max(slope_sd, 1e-12), n - 2))
    late = late - mean.mean() - slope * (t - centre.mean())
    along2, across2 = per_block(late**2), per_block(across2)
    ratio = np.log(np.maximum(along2, 1e-16) / np.maximum(across2, 1e-16))
    p_wander = float(student.sf(ratio.mean() / max(ratio.std(ddof=1) / np.sqrt(n), 1e-12), n - 1))
    wander = float(np.sqrt(max(np.mean(along2) - np.mean(across2), 0.0)))
    return TrackError(slope=slope, slope_sd=slope_sd, span_s=float(centre[-1] - centre[0]), wander_sd_s=wander,
                      noise_sd_s=float(np.sqrt(np.median(across2))), blocks=n, p_drift=p_drift, p_wander=p_wander,
                      time_s=t, late_s=late,
                      mean_sd_s=float(mean.std(ddof=1) / np.sqrt(n) * np.sqrt(max(1.0 - len(t) / len(time_s), 0.0))))
