"""How the time error of a stream moves within the flight, from windows of half a second.

In every window the lag is what makes s(t) = A r(t - lag) fit best, A and the noise fixed by the whole flight. A
placebo shows how far such lags scatter without any clock error. It is the same fit with the reference's slope turned
by a quarter period (Hilbert transform). It has the same spectrum, meets the same noise, and a delay leaves it alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import hilbert
from scipy.stats import f as fisher
from scipy.stats import t as student

from ...settings import number
from .lags import Lag, LagSums, best
from .steadiness import CHANCE, SMALLEST_WANDER_S, Steadiness

REACH_S = number("audit.lag_windows.reach_s")
KEPT = number("audit.lag_windows.kept")


@dataclass(frozen=True, kw_only=True)
class Movement(Steadiness):
    """time_s, lag_s, weight (w,) of the windows, which are the blocks; noise_sd_s: what the placebo scatters, per
    window of mean weight."""

    time_s: np.ndarray
    lag_s: np.ndarray
    weight: np.ndarray

    @property
    def detectable_wander_s(self) -> float:
        """Standard deviation of an error as fast as that of the published recordings that is found with about 99.9 %
        probability. A fast error raises the placebo too, so this holds for the recording as it is."""
        dof = max(self.blocks - 2, 1)
        ratio = fisher.isf(CHANCE, dof, dof) * fisher.isf(1e-3, dof, dof)
        return max(SMALLEST_WANDER_S, float(self.noise_sd_s * np.sqrt(ratio - 1.0))) / KEPT


def movement(measured: np.ndarray, reference: np.ndarray, time_s: np.ndarray, sums: LagSums,
             lag: Lag) -> Movement | None:
    """From one pair (n, 3), its sums (blocks are the windows) and its lag; None with fewer than eight windows."""
    a, w = lag.matrix, 1.0 / np.maximum(lag.noise, 1e-300)
    near = np.abs(sums.lags_s - lag.offset_s) <= REACH_S + 1e-9
    windows = len(sums.rows)
    if windows < 8 or near.sum() < 8:
        return None
    # sum of squares left in each window at each lag, A fixed
    left = (
        np.einsum("bkk->bk", sums.measured)[:, None, :]
        - 2.0 * np.einsum("kj,blkj->blk", a, sums.cross[:, near])
        + np.einsum("kj,blji,ki->blk", a, sums.reference[:, near], a)
    ) @ w
    lags = best(sums.lags_s[near], left[..., None], False) - lag.offset_s
    # the placebo, linear in the quarter-turned slope
    step = sums.lags_s[1] - sums.lags_s[0]
    rows = sums.rows.ravel()
    whole = int(np.floor(lag.offset_s / step))
    part = lag.offset_s / step - whole

    def delayed(x: np.ndarray) -> np.ndarray:
        return np.asarray((1.0 - part) * x[rows - whole] + part * x[np.maximum(rows - whole - 1, 0)])

    predicted = reference @ a.T
    slope = np.gradient(predicted, step, axis=0)
    turned = np.imag(hilbert(slope, axis=0))
    rest = measured[rows] - delayed(predicted)
    slope, turned = delayed(slope), delayed(turned)

    def per_window(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(((x * y) @ w).reshape(windows, -1).sum(axis=1))

    weight = per_window(slope, slope)
    power = per_window(turned, turned)
    placebo = per_window(turned, rest) / np.maximum(power, 1e-300)
    times = time_s[rows].reshape(windows, -1).mean(axis=1)
    return _judge(times, lags, weight, placebo, power)


def _judge(times: np.ndarray, lags: np.ndarray, weight: np.ndarray, placebo: np.ndarray, power: np.ndarray) -> Movement:
    n = len(lags)
    share = weight / weight.sum()
    centre = float(share @ times)
    t = times - centre
    mean = float(share @ lags)
    slope = float(share @ (t * (lags - mean)) / (share @ t**2))
    rest = lags - mean - slope * t
    # per window of mean weight, two degrees of freedom used
    scatter2 = float(share @ rest**2) * n / (n - 2)
    noise2 = float((power / power.sum()) @ (placebo - (power @ placebo) / power.sum()) ** 2) * n / (n - 1)
    effective = 1.0 / float(np.sum(share**2))
    dof = max(effective - 2.0, 1.0)
    slope_sd = float(np.sqrt(max(scatter2, noise2) / (effective * (share @ t**2))))
    p_drift = float(2.0 * student.sf(abs(slope) / max(slope_sd, 1e-12), dof))
    p_wander = float(fisher.sf(scatter2 / max(noise2, 1e-14), dof, dof))
    return Movement(slope=slope, slope_sd=slope_sd, span_s=float(times[-1] - times[0]),
                    wander_sd_s=float(np.sqrt(max(scatter2 - noise2, 0.0))), noise_sd_s=float(np.sqrt(noise2)),
                    blocks=n, p_drift=p_drift, p_wander=p_wander, time_s=times, lag_s=lags, weight=weight)
