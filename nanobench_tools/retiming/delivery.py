"""How the time error can move from one row to the next: samples are delivered late, never early, in order.

A sample taken on a steady clock arrives after a varying delay; in a radio hang the delay grows by as much as time
passes (firmware time stands still on the host), then a burst catches up. Hence d(i) - d(i-1) <= dt always, small
steps mostly, rises of 0..dt while the radio hangs, falls after it. The shares and scales are weak: halving or
doubling them moves the result by far less than its own standard deviation.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

CELL_S = 0.0025
"""Grid of the delay; a quarter of a row, and half the finest structure that 100 Hz rows can show."""

LARGEST_FALL_S = 0.12
"""Within one row; larger ones are taken in two rows."""

SHARE_HANG, SHARE_BURST, SHARE_RESIDUAL = 0.12, 0.08, 0.8
SCALE_RESIDUAL_S, SCALE_BURST_S = 0.0012, 0.008


def log_step_prior(step_s: float, cell_s: float = CELL_S) -> tuple[np.ndarray, np.ndarray, int]:
    """Steps [s] (b,), their log probability (b,), and how many cells upward are possible in ``step_s``."""
    up = max(1, round(step_s / cell_s))
    x = np.arange(-round(LARGEST_FALL_S / cell_s), up + 1) * cell_s
    laplace = np.exp(-np.abs(x) / SCALE_RESIDUAL_S)
    hang = (x >= 0.0).astype(float)
    burst = np.where(x <= 0.0, np.exp(x / SCALE_BURST_S), 0.0)
    p = (SHARE_RESIDUAL * laplace / laplace.sum() + SHARE_HANG * hang / hang.sum()
         + SHARE_BURST * burst / burst.sum())
    return x, np.log(p), up


VELOCITY_ERROR_S = 0.5
"""An onboard velocity errs by some 5 % for about a second at a time; over that long the clock's error averages out, so
that the position's own advance tells the velocity's slow error."""


def without_slow_error(velocity_m_s: np.ndarray, advance_m_s: np.ndarray, rows: float, causal: bool) -> np.ndarray:
    """(n, 3) m/s: fast part of the velocity, slow part of the position's ``advance_m_s`` (n, 3) per time of the file;
    ``rows``: width of the average (standard deviation, or time constant of a causal one)."""
    error = advance_m_s - velocity_m_s
    if causal:
        keep = np.exp(-1.0 / rows)
        return velocity_m_s + lfilter([1.0 - keep], [1.0, -keep], error, axis=0)
    return velocity_m_s + gaussian_filter1d(error, rows, axis=0)


def log_steps_from_odometry(steps_s: np.ndarray, time_s: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray,
                            causal: bool = False, slowest_m_s: float = 0.15) -> np.ndarray:
    """(n, b) log likelihood of each step of the delay, from the estimator's own position and velocity alone.

    Between two rows firmware time advances by dp.v/|v|^2 while the file's clock advances by dt, so the delay grew by
    dt - dp.v/|v|^2; the noise is what the position step shows across the velocity, where time cannot act. Rows slower
    than ``slowest_m_s`` say nothing. time_s (n,), position_m and velocity_m_s (n, 3); row 0 is zero.
    """
    result = np.zeros((len(time_s), len(steps_s)))
    dp = np.diff(position_m, axis=0)
    dt = np.diff(time_s)[:, None]
    v = without_slow_error(0.5 * (velocity_m_s[1:] + velocity_m_s[:-1]), dp / dt,
                           VELOCITY_ERROR_S / float(np.median(dt)), causal)
    speed = np.linalg.norm(v, axis=1)
    moving = speed > slowest_m_s
    if moving.sum() < 50:
        return result
    advance = np.sum(dp * v, axis=1) / np.maximum(speed, 1e-3) ** 2
    across = np.linalg.norm(dp - advance[:, None] * v, axis=1)[moving]
    sigma_m = np.median(across) / 1.1774  # median of a Rayleigh variable
    sigma_s = np.hypot(sigma_m / np.maximum(speed, slowest_m_s), CELL_S / np.sqrt(12.0))
    z = (steps_s[None, :] - (np.diff(time_s) - advance)[:, None]) / sigma_s[:, None]
    result[1:] = np.where(moving[:, None], -3.0 * np.log1p(z * z / 6.0), 0.0)
    return result
