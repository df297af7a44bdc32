"""Known errors put into recordings, and how much of each a clock takes for time: the null tests of re-timing.

An estimator's error along the track must survive a clock that judges the estimator; an error of the timestamps must
not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..flight import Flight, Span, Stream
from ..signals.airborne import airborne_spans
from ..signals.context import Context
from ..signals.dropouts import alive_until
from ..signals.mocap_derivatives import MocapDerivatives, derivatives_of
from ..time_offsets.moving.time_offset import TimeOffset
from .clock import ClockError, draw_clock

RANDOM = "random"
MARGIN_S = 0.5
"""Left out after take-off and before landing, where a derivative of the track is no flight."""
SLOWEST_M_S = 0.2
RANDOM_SMOOTH_S = 0.3
"""Standard deviation of the Gaussian that smooths the random error: most of it lies below 1 Hz."""


@dataclass(frozen=True)
class Errors:
    """Sums over rows of one flight, to be pooled: injected squared, injected times what is left, left squared."""

    injected: float
    both: float
    left: float

    @classmethod
    def of(cls, injected: np.ndarray, left: np.ndarray) -> Errors:
        """injected, left (n,), constants removed: a constant is no moving error."""
        a, b = injected - injected.mean(), left - left.mean()
        return cls(float(a @ a), float(a @ b), float(b @ b))


def kept(errors: list[Errors]) -> float:
    """Share of the injected variance that is still there: the squared slope of what is left on what was injected."""
    slope = sum(e.both for e in errors) / max(sum(e.injected for e in errors), 1e-30)
    return max(slope, 0.0) ** 2


def removed(errors: list[Errors]) -> float:
    """Removed fraction of the injected variance; errors that the clock adds count against it."""
    return 1.0 - sum(e.left for e in errors) / max(sum(e.injected for e in errors), 1e-30)


def living(flight: Flight) -> Flight:
    """``flight`` as long as its estimator's log lived."""
    context = Context(flight)
    return flight.during(Span(-np.inf, context.once(alive_until)["estimator"] - 0.05))


def with_track_error(flight: Flight, frequency_hz: float | str, amplitude_s: float, seed: int,
                     velocity: bool = False) -> tuple[Flight, np.ndarray]:
    """``flight`` with an injected along-track error of its estimated position, of amplitude times speed. The error is
    a sine of ``frequency_hz`` or smoothly random (RANDOM, the same power). Also (n, 3) the error [m] at the
    estimator's rows. ``velocity``: the estimated velocity errs by its derivative, too."""
    context, stream, rng = Context(flight), flight["estimator"], np.random.default_rng(seed)
    t, truth = stream.time_s, _truth(context)
    if frequency_hz == RANDOM:
        smooth = gaussian_filter1d(rng.standard_normal(len(t)), RANDOM_SMOOTH_S / float(np.median(np.diff(t))))
        shape = smooth / smooth.std() * np.sqrt(0.5)
    else:
        shape = np.sin(2.0 * np.pi * float(frequency_hz) * t + rng.uniform(0.0, 2.0 * np.pi))
    span = context.once(airborne_spans)
    flown = (t > span[0].start_s) & (t < span[-1].end_s)
    error = amplitude_s * (shape * flown)[:, None] * _at(truth, truth.velocity_m_s, t)
    values = stream.values.copy()
    values[:, [stream.index(q) for q in ("x", "y", "z")]] += error
    if velocity:
        values[:, [stream.index(q) for q in ("vx", "vy", "vz")]] += np.gradient(error, t, axis=0)
    return flight.with_streams(estimator=replace(stream, values=values)), error


def with_wander(flight: Flight, sd_s: float, seed: int) -> tuple[Flight, ClockError]:
    """``flight`` whose timestamps wander by ``sd_s`` more, in a sawtooth as delivery makes it, put back on its rows."""
    clock = draw_clock(np.random.default_rng(seed), float(flight["mocap"].time_s[-1]) + 2.0, wander_sd_s=sd_s)
    moved = {name: stream if name == "mocap" or len(stream) < 2 else _on_rows(stream, clock.stamp(stream.time_s))
             for name, stream in flight.streams.items()}
    return replace(flight, streams=moved), clock


def along_track(context: Context, time_offset: TimeOffset | None,
                lag_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Error of the estimated position along the track [m] (n,), unit vectors of the track (n, 3), rows of the
    estimator (n,).

    Only moving rows in the air; ``time_offset`` and the constant ``lag_s`` are removed from the timestamps."""
    stream = context.flight["estimator"]
    truth, span = _truth(context), context.once(airborne_spans)
    rows = np.flatnonzero((stream.time_s > span[0].start_s + MARGIN_S) & (stream.time_s < span[-1].end_s - MARGIN_S))
    stamps = stream.time_s[rows]
    at = stamps - lag_s - (0.0 if time_offset is None else time_offset.at(stamps))
    v = _at(truth, truth.velocity_m_s, at)
    speed = np.linalg.norm(v, axis=1)
    error = stream["x", "y", "z"][rows] - _at(truth, truth.position_m, at)
    fast = speed > SLOWEST_M_S
    u = v[fast] / speed[fast, None]
    return np.sum((error - np.median(error, axis=0))[fast] * u, axis=1), u, rows[fast]


def best_lag_s(context: Context, time_offset: TimeOffset | None) -> float:
    """The constant lag of the estimated position [s] that leaves the least error along the track."""
    lags = np.arange(-0.1, 0.1001, 0.0025)
    return float(lags[np.argmin([np.mean(along_track(context, time_offset, lag)[0] ** 2) for lag in lags])])


def track_errors(before: Context, after: Context, error_m: np.ndarray, clock_before: TimeOffset | None,
                 clock_after: TimeOffset | None) -> Errors:
    """What clocks leave of an error (n, 3) that was put into the estimate of ``after``."""
    lag = best_lag_s(before, clock_before)
    first, u, rows = along_track(before, clock_before, lag)
    second, _, again = along_track(after, clock_after, lag)
    shared, i, j = np.intersect1d(rows, again, return_indices=True)
    return Errors.of(np.sum(error_m[shared] * u[i], axis=1), second[j] - first[i])


def wander_errors(context: Context, clock: ClockError, offset_before: TimeOffset, offset_after: TimeOffset) -> Errors:
    """Remaining wander after injecting one into the timestamps of a flight, as metres along the track."""
    truth = _truth(context)
    t = offset_after.time_s
    sent = np.arange(t[0] - 1.0, t[-1] + 1.0, 0.001)
    was = np.interp(t, clock.stamp(sent), sent)  # the timestamp that this row had before
    speed = np.linalg.norm(_at(truth, truth.velocity_m_s, was), axis=1)
    use = (speed > SLOWEST_M_S) & (t > t[0] + 2.0 * MARGIN_S) & (t < t[-1] - 2.0 * MARGIN_S)
    injected = (t - was) * speed
    left = (t - was - offset_after.offset_s + offset_before.at(was)) * speed
    return Errors.of(injected[use], left[use])


def _truth(context: Context) -> MocapDerivatives:
    truth = context.once(derivatives_of)
    if truth is None or not context.once(airborne_spans):
        raise ValueError(f"{context.flight.name} has no motion capture of a flight")
    return truth


def _at(truth: MocapDerivatives, values: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at_s, truth.time_s, values[:, k]) for k in range(values.shape[1])], axis=1)


def _on_rows(stream: Stream, moved_s: np.ndarray) -> Stream:
    values = [np.interp(stream.time_s, moved_s, stream.values[:, k]) for k in range(stream.values.shape[1])]
    return replace(stream, values=np.stack(values, axis=1))
