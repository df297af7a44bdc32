"""Comparison of two vector signals that should be equal: a stream, and its prediction from motion capture. The pairs
are in ``pairs``.

Both are on the grid of ``mocap_derivatives`` and band-limited forward and backward (no delay). Rows near missing, dead,
frozen or jumping data are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ..flight import mask_of
from ..settings import count, number, setting
from .airborne import airborne_spans
from .context import Context
from .crashes import crash_of
from .dropouts import alive_until
from .mocap_derivatives import SLOWEST_STEP_S, STEP_S, MocapDerivatives, derivatives_of, widened
from .packet_rows import packets_of
from .pose_frame import posed
from .usable_rows import runs, typical_step_s, usable_streams

RATE_BAND_HZ = setting("audit.paired_signals.rate_band_hz")
POSE_BAND_HZ = setting("audit.paired_signals.pose_band_hz")
FORCE_BAND_HZ = setting("audit.paired_signals.force_band_hz")
STILL_ROWS = count("audit.paired_signals.still_rows")
BEFORE_LANDING_S = number("audit.paired_signals.before_landing_s")
REACH_S = number("audit.paired_signals.reach_s")
FEWEST_ROWS = count("audit.paired_signals.fewest_rows")
BRIDGED_S = number("audit.paired_signals.bridged_s")


@dataclass(frozen=True)
class Pair:
    """measured, reference (n, 3) filtered; use (n,) bool rows to compare; free: a constant matrix may lie between;
    reach_s: lags to look at."""

    stream: str
    quantities: tuple[str, ...]
    measured: np.ndarray
    reference: np.ndarray
    use: np.ndarray
    free: bool
    reach_s: float = REACH_S

    @property
    def rms(self) -> np.ndarray:
        """(3,) of the measured signal over the rows in use."""
        return np.sqrt(np.mean(self.measured[self.use] ** 2, axis=0)) if self.use.any() else np.zeros(3)


@cache
def _band(low_hz: float, high_hz: float) -> np.ndarray:
    return np.asarray(butter(2, (low_hz, high_hz), btype="band", fs=1.0 / STEP_S, output="sos"))


def band_limited(values: np.ndarray, band_hz: tuple[float, float]) -> np.ndarray:
    """(..., n, k) on the grid -> the same without what lies outside ``band_hz``, without delay."""
    n = values.shape[-2]
    # mirrored ends: the default continuation turns a shock in the last row into a step
    return np.asarray(sosfiltfilt(_band(*band_hz), values, axis=-2, padtype="even", padlen=min(200, n - 1)))


def flying_rows(context: Context) -> np.ndarray:
    """(n,) bool on the grid of truth: in the air, landing and crash left out."""
    truth = context.once(derivatives_of)
    spans = context.once(airborne_spans)
    if truth is None or not spans:
        return np.zeros(0 if truth is None else len(truth.time_s), dtype=bool)
    t, crash = truth.time_s, context.once(crash_of)
    end = spans[-1].end_s if crash is None else min(crash.start_s, spans[-1].end_s)
    return mask_of(spans, t) & (t <= end - BEFORE_LANDING_S)


def on_grid(context: Context, name: str, quantities: tuple[str, ...],
            prepare: Callable[[np.ndarray], np.ndarray] = lambda v: v,
            shift_s: float = 0.0) -> tuple[np.ndarray, np.ndarray] | None:
    """values (n, k) of a stream ``shift_s`` before the timestamps of truth, linearly interpolated, and (n,) bool where
    they are true values."""
    truth = context.once(derivatives_of)
    stream = context.once(posed) if name == "mocap" else context.once(usable_streams).get(name)
    if truth is None or stream is None or not all(q in stream.quantities for q in quantities):
        return None
    t = truth.time_s - shift_s
    values = stream[quantities]
    fine = np.isfinite(values).all(axis=1) & (stream.time_s <= context.once(alive_until)[name])
    packets = context.once(packets_of).get(name)
    for a, b in [] if packets is None else runs(packets.still):
        if b - a >= STILL_ROWS:
            fine[a:b] = False
    if fine.sum() < 100:
        return None
    times, values = stream.time_s[fine], prepare(values[fine])
    result = np.stack([np.interp(t, times, values[:, k]) for k in range(values.shape[1])], axis=1)
    after = np.searchsorted(times, t, side="right")
    bridged_s = max(BRIDGED_S, 1.5 * min(typical_step_s(times), SLOWEST_STEP_S))
    near = times[np.minimum(after, len(times) - 1)] - times[np.maximum(after - 1, 0)] < bridged_s
    return result, near & (t >= times[0]) & (t <= times[-1])


def against(context: Context, name: str, quantities: tuple[str, ...],
            reference: Callable[[MocapDerivatives], np.ndarray], band_hz: tuple[float, float], free: bool,
            signal: Callable[[np.ndarray], np.ndarray] = lambda v: v,
            prepare: Callable[[np.ndarray], np.ndarray] = lambda v: v, reach_s: float = REACH_S,
            shift_s: float = 0.0) -> Pair | None:
    """The pair of a stream's ``signal(prepare(values))`` and what ``reference`` makes of truth; see ``on_grid`` and
    ``pair_of``."""
    placed, truth = on_grid(context, name, quantities, prepare, shift_s), context.once(derivatives_of)
    if placed is None or truth is None:
        return None
    values, true_rows = placed
    return pair_of(context, name, quantities, signal, values, true_rows, reference(truth), band_hz, free, reach_s)


def pair_of(context: Context, name: str, quantities: tuple[str, ...], signal: Callable[[np.ndarray], np.ndarray],
            values: np.ndarray, true_rows: np.ndarray, reference: np.ndarray, band_hz: tuple[float, float], free: bool,
            reach_s: float = REACH_S) -> Pair | None:
    """The pair of ``signal(values)`` and ``reference``, both on the grid of truth; true_rows (n,) bool: real values.

    None with less than three seconds in the air.
    """
    truth = context.once(derivatives_of)
    if truth is None:
        return None
    use = context.once(flying_rows) & truth.good & ~widened(~true_rows, 10)
    inside = np.flatnonzero(use)
    if len(inside) < FEWEST_ROWS:
        return None
    # both are filtered over the same stretch, one second longer on each side as far as there are true values
    there = np.flatnonzero(true_rows)
    first, last = max(inside[0] - 100, there[0]), min(inside[-1] + 100, there[-1])
    reach = round(reach_s / STEP_S)
    use[: first + reach] = False
    use[last - reach + 1 :] = False
    both = np.zeros((2, len(values), 3))
    both[:, first : last + 1] = band_limited(np.stack([signal(values[first : last + 1]), reference[first : last + 1]]),
                                             band_hz)
    # an axis that never moves holds rounding errors only
    both[np.broadcast_to((np.abs(both).max(axis=1) < 1e-9)[:, None, :], both.shape)] = 0.0
    return Pair(name, quantities, both[0], both[1], use, free, reach_s)
