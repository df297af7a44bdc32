"""What says how late a sample is: every stream that the motion capture can predict, each with its own constant lag.

The motion capture is put on a grid of CELL_S, so that a delay is a shift by cells. A stream's noise and how alike
neighbouring errors are (``weight``) are read off its own residual, never set per recording.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numba as nb
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from ... import so3
from ...flight import Stream
from ...frames import gravity_up
from ...settings import count, number, setting
from ...signals.context import Context
from ...signals.dropouts import alive_until
from ...signals.mocap_derivatives import STEP_S, MocapDerivatives, derivatives_of
from ...signals.usable_rows import usable_streams
from ..mathematics.packet_delay import CELL_S

MARGIN_S = number("retiming.evidence.margin_s")

DETREND_S = number("retiming.evidence.detrend_s")

LAGS_S = number("retiming.evidence.lags_s")

ENOUGH = count("retiming.evidence.enough")

ALIKE_S = number("retiming.evidence.alike_s")
FARTHEST_SD = number("retiming.evidence.farthest_sd")
LEAST_WEIGHT = number("retiming.evidence.least_weight")
ALIKE = number("retiming.evidence.alike")
START_WEIGHT = number("retiming.evidence.start_weight")
FEWEST = count("retiming.evidence.fewest")
CALIBRATED_RAD_S = number("retiming.evidence.calibrated_rad_s")


@dataclass(frozen=True)
class Kind:
    """stream and its quantities; ``start_sigma`` and ``floor``: first and smallest noise believed, SI;
    ``detrended``: only its fast part is compared; ``group``: ``inertial`` or ``estimator``; ``typical_lag_s`` (behind
    the gyro of the same clock), ``typical_sigma`` and ``typical_weight`` are medians of 64 real flights. They serve a
    causal clock, which cannot learn them."""

    name: str
    stream: str
    quantities: tuple[str, ...]
    start_sigma: float
    floor: float
    detrended: bool
    group: str
    typical_lag_s: float
    typical_sigma: float
    typical_weight: float


START: dict[str, tuple[float, float]] = setting("retiming.evidence.start")
TYPICAL: dict[str, tuple[float, float, float]] = setting("retiming.evidence.typical")
KINDS: dict[str, Kind] = {kind.name: kind for kind in (
    Kind("gyro", "imu", ("gyro_x", "gyro_y", "gyro_z"), *START["gyro"], False, "inertial", *TYPICAL["gyro"]),
    Kind("acceleration", "imu", ("acc_x", "acc_y", "acc_z"), *START["acceleration"], True, "inertial",
         *TYPICAL["acceleration"]),
    Kind("attitude", "attitude_qw", ("qx", "qy", "qz", "qw"), *START["attitude"], True, "estimator",
         *TYPICAL["attitude"]),
    Kind("velocity", "estimator", ("vx", "vy", "vz"), *START["velocity"], False, "estimator", *TYPICAL["velocity"]),
    Kind("position", "estimator", ("x", "y", "z"), *START["position"], False, "estimator", *TYPICAL["position"]),
)}


@dataclass
class Evidence:
    """Samples of one kind.

    - time_s (s,), measured (s, k).
    - predicted (g, k): on the fine grid from grid_start_s.
    - lag_s, sigma (k,), weight: present estimates.
    - bias (k,): constant error of a gyro that is not calibrated, removed before it shows time; else 0."""

    kind: Kind
    time_s: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    grid_start_s: float
    lag_s: float
    sigma: np.ndarray
    weight: float
    bias: np.ndarray | float = 0.0

    def predicted_at(self, delay_s: np.ndarray, lag_s: float) -> np.ndarray:
        """(s, k) what the samples should show if each is late by ``delay_s`` (s,) and the stream by ``lag_s``."""
        x = np.clip((self.time_s - delay_s - lag_s - self.grid_start_s) / CELL_S, 0, len(self.predicted) - 1.001)
        i = x.astype(np.int64)
        part = (x - i)[:, None]
        return np.asarray(self.predicted[i] * (1.0 - part) + self.predicted[i + 1] * part)

    def cells(self) -> np.ndarray:
        """(s,) timestamps less the lag, as cells of the grid."""
        return np.round((self.time_s - self.lag_s - self.grid_start_s) / CELL_S).astype(np.int64)

    def detrended(self, delay_s: np.ndarray) -> np.ndarray:
        """(s, k) measured, with its slow difference from the prediction taken off where the kind asks for it."""
        if not self.kind.detrended:
            return np.asarray(self.measured - self.bias)
        slow = uniform_filter1d(self.measured - self.predicted_at(delay_s, self.lag_s), self._rows(DETREND_S), axis=0,
                                mode="nearest")
        return np.asarray(self.measured - slow)

    def learn_lag(self, delay_s: np.ndarray, near: bool = False) -> None:
        """Updates the constant lag under ``delay_s`` (s,): coarse over LAGS_S, then fine about the best; ``near``:
        only fine about the present one."""
        best = self.lag_s if near else self._lowest(delay_s, np.arange(-LAGS_S, LAGS_S + 1e-9, 4 * CELL_S))
        self.lag_s = self._lowest(delay_s, best + CELL_S * np.arange(-4, 5))

    def learn_bias(self, delay_s: np.ndarray) -> None:
        """Updates the bias of a gyro under ``delay_s`` (s,); that of a calibrated one is too small to matter."""
        if self.kind.name == "gyro":
            found = np.median(self.measured - self.predicted_at(delay_s, self.lag_s), axis=0)
            self.bias = np.where(np.abs(found) > CALIBRATED_RAD_S, found, 0.0)

    def learn_noise(self, delay_s: np.ndarray) -> None:
        """Updates noise and weight from the residual under ``delay_s`` (s,)."""
        residual = self.residual(delay_s)
        self.sigma = np.maximum(1.4826 * np.median(np.abs(residual), axis=0), self.kind.floor)
        fast = residual - uniform_filter1d(residual, self._rows(ALIKE_S), axis=0, mode="nearest")
        alike = _alike_rows(np.clip(fast / self.sigma, -FARTHEST_SD, FARTHEST_SD))
        self.weight = float(np.clip(1.0 / alike, LEAST_WEIGHT, 1.0))

    def residual(self, delay_s: np.ndarray) -> np.ndarray:
        """(s, k) measured less predicted under ``delay_s`` (s,) and the present lag, medians removed."""
        r = self.detrended(delay_s) - self.predicted_at(delay_s, self.lag_s)
        return np.asarray(r - np.median(r, axis=0))

    def _lowest(self, delay_s: np.ndarray, lags_s: np.ndarray) -> float:
        """The lag of least clipped squared residual, refined by a parabola through the three lowest points."""
        thin = len(self.time_s) // ENOUGH
        if thin > 1:
            part = replace(self, time_s=self.time_s[::thin], measured=self.measured[::thin])
            return part._lowest(delay_s[::thin], lags_s)
        cells = (self.time_s - delay_s - self.grid_start_s) / CELL_S
        residuals = residuals_of_lags(self.measured, self.predicted, cells, lags_s / CELL_S)
        if self.kind.detrended:
            residuals -= uniform_filter1d(residuals, self._rows(DETREND_S), axis=-1, mode="nearest")
        squared = np.sum((residuals - np.median(residuals, axis=-1, keepdims=True)) ** 2, axis=1)
        limit = 9.0 * np.median(squared, axis=-1).min()  # spikes must not choose the lag
        cost = np.minimum(squared, limit).mean(-1)
        i = int(np.argmin(cost))
        if 0 < i < len(cost) - 1:
            bend = cost[i - 1] - 2.0 * cost[i] + cost[i + 1]
            if bend > 0.0:
                return float(lags_s[i] + 0.5 * (lags_s[1] - lags_s[0]) * (cost[i - 1] - cost[i + 1]) / bend)
        return float(lags_s[i])

    def _rows(self, duration_s: float) -> int:
        return max(1, round(duration_s / float(np.median(np.diff(self.time_s)))))


@nb.njit(cache=True)
def residuals_of_lags(measured: np.ndarray, predicted: np.ndarray, cells: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """(l, k, s) measured (s, k) less predicted (g, k), interpolated at ``cells`` (s,) less each lag (l,), in cells."""
    samples, channels = measured.shape
    found = np.empty((len(lags), channels, samples))
    for row in range(len(lags)):
        for s in range(samples):
            x = min(max(cells[s] - lags[row], 0.0), len(predicted) - 1.001)
            i = int(x)
            for k in range(channels):
                found[row, k, s] = measured[s, k] - predicted[i, k] * (1.0 - x + i) - predicted[i + 1, k] * (x - i)
    return found


def _alike_rows(z: np.ndarray) -> float:
    """Integrated autocorrelation of (s, k) scaled residuals: how many rows count as one."""
    n = len(z)
    spectrum = np.abs(np.fft.rfft(z - z.mean(axis=0), 2 * n, axis=0)) ** 2
    correlation = np.fft.irfft(spectrum, axis=0)[:min(50, n)]
    correlation = correlation / np.maximum(correlation[0], 1e-12)
    positive = np.cumprod(correlation[1:] > ALIKE, axis=0)
    return float(np.mean(1.0 + 2.0 * np.sum(correlation[1:] * positive, axis=0)))


def _fine(truth: MocapDerivatives, values: np.ndarray) -> np.ndarray:
    """(n, k) on the truth's grid -> on the fine grid, ends held."""
    fine = np.arange(truth.time_s[0] - MARGIN_S, truth.time_s[-1] + MARGIN_S, CELL_S)
    return np.asarray(CubicSpline(truth.time_s, values)(np.clip(fine, truth.time_s[0], truth.time_s[-1])))


def _rate(truth: MocapDerivatives) -> np.ndarray:
    dq = savgol_filter(truth.quaternion, 11, 3, deriv=1, delta=STEP_S, axis=0)
    return 2.0 * so3.multiply(so3.conjugate(truth.quaternion), dq)[:, :3]


def _force(truth: MocapDerivatives) -> np.ndarray:
    acceleration = savgol_filter(truth.position_m, 13, 3, deriv=2, delta=STEP_S, axis=0)
    return so3.rotate_inverse(truth.quaternion, acceleration + gravity_up())


PREDICTED: dict[str, Callable[[MocapDerivatives], np.ndarray]] = {
    "gyro": _rate,
    "acceleration": _force,
    "attitude": lambda truth: truth.euler_rad[:, :2],
    "velocity": lambda truth: savgol_filter(truth.position_m, 11, 3, deriv=1, delta=STEP_S, axis=0),
    "position": lambda truth: truth.position_m,
}


def _measured(kind: Kind, stream: Stream) -> np.ndarray:
    values = stream[kind.quantities]
    if kind.name == "attitude":
        none = np.linalg.norm(values, axis=1) < 0.5
        values = np.where(none[:, None], np.nan, values)
    return so3.euler_zyx(values)[:, :2] if kind.name == "attitude" else values  # yaw wraps and hardly moves


def collect(context: Context, kinds: tuple[str, ...], start_s: float, end_s: float) -> list[Evidence]:
    """The evidence of ``kinds`` that this flight has between ``start_s`` and ``end_s``. Kinds of fewer than 100 usable
    samples are left out."""
    truth = context.once(derivatives_of)
    if truth is None:
        return []
    streams, alive = context.once(usable_streams), context.once(alive_until)
    found = []
    for name in kinds:
        kind = KINDS[name]
        stream = streams.get(kind.stream)
        if stream is None or not all(q in stream.quantities for q in kind.quantities):
            continue
        measured = _measured(kind, stream)
        t = stream.time_s
        good = np.isfinite(measured).all(axis=1) & (t >= start_s) & (t <= min(end_s, alive[kind.stream]))
        good &= np.interp(t, truth.time_s, truth.good.astype(float), left=0.0, right=0.0) > 0.999
        if good.sum() < FEWEST:
            continue
        k = measured.shape[1]
        found.append(Evidence(kind, t[good], np.ascontiguousarray(measured[good]),
                              np.ascontiguousarray(_fine(truth, PREDICTED[name](truth))),
                              truth.time_s[0] - MARGIN_S, 0.0, np.full(k, kind.start_sigma), START_WEIGHT))
    return found
