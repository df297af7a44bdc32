"""A clock error over time, and a flight with it taken out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...flight import Flight, Span, Stream
from ...results.result import Result


@dataclass(frozen=True, repr=False)
class TimeOffset(Result):
    """How late the timestamps of one clock are against the motion capture.

    - time_s, offset_s, sd_s (n,): recorded time, lateness (positive = late, subtract it) and its standard deviation.
    - constant_s: the best constant, used outside of time_s; wander_sd_s: scatter of offset_s about a line.
    - moving: whether a moving error was found (else offset_s is the constant everywhere).
    - lags_s: each stream's own constant lag behind the clock, left in the data because it belongs to the estimator or
      the sensor.
    - reason: one sentence; evidence: the kinds of streams used.
    - log_ratio: logarithm of the likelihood ratio of a moving clock to a constant one, nan where it was not computed.
    """

    time_s: np.ndarray
    offset_s: np.ndarray
    sd_s: np.ndarray
    constant_s: float
    wander_sd_s: float
    moving: bool
    lags_s: Mapping[str, float]
    reason: str
    evidence: tuple[str, ...] = ()
    log_ratio: float = math.nan

    def points(self, tolerance_s: float = 0.001) -> tuple[tuple[float, float, float], ...]:
        """(t_s, offset_s, sd_s) of the fewest rows that describe offset_s within ``tolerance_s`` by straight lines.
        Empty for a constant offset. Source: Ramer 1972, Douglas and Peucker 1973."""
        if not self.moving or len(self.time_s) < 2:
            return ()
        keep = np.zeros(len(self.time_s), bool)
        keep[[0, -1]] = True
        open_ = [(0, len(self.time_s) - 1)]
        while open_:
            a, b = open_.pop()
            t, d = self.time_s[a:b + 1], self.offset_s[a:b + 1]
            off = np.abs(d - np.interp(t, t[[0, -1]], d[[0, -1]]))
            worst = a + int(np.argmax(off))
            if off[worst - a] > tolerance_s:
                keep[worst] = True
                open_ += [(a, worst), (worst, b)]
        return tuple(zip(*(np.round(v[keep], 5).tolist() for v in (self.time_s, self.offset_s, self.sd_s)),
                         strict=True))

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """(m,) lateness [s] of timestamps ``time_s`` (m,)."""
        if not len(self.time_s):
            return np.full(len(time_s), self.constant_s)
        found: np.ndarray = np.interp(time_s, self.time_s, self.offset_s, left=self.constant_s, right=self.constant_s)
        return found


def wander_of(time_s: np.ndarray, offset_s: np.ndarray) -> float:
    """Standard deviation [s] of a moving error (n,) about its own line: a clock that merely drifts does not wander."""
    t = time_s - time_s.mean()
    return float(np.std(offset_s - (t @ offset_s) / max(t @ t, 1e-12) * t))


def retime_stream(stream: Stream, time_offset: TimeOffset) -> Stream:
    """The same samples on the motion capture's clock: timestamps are moved, order is kept, no value is changed or
    made."""
    moved = np.maximum.accumulate(stream.time_s - time_offset.at(stream.time_s))
    sd = np.interp(stream.time_s, time_offset.time_s, time_offset.sd_s) if len(time_offset.time_s) else None
    shift_s = time_offset.constant_s
    valid = stream.valid and tuple(Span(s.start_s - shift_s, s.end_s - shift_s) for s in stream.valid)
    return replace(stream, time_s=moved, valid=valid, time_sd_s=sd)


def retime(flight: Flight, time_offset: TimeOffset, keep: tuple[str, ...] = ("mocap",)) -> Flight:
    """A copy of ``flight`` in which every stream but ``keep`` is moved by ``time_offset``; the provenance says so."""
    moved = {name: s if name in keep else retime_stream(s, time_offset) for name, s in flight.streams.items()}
    note = f"re-timed: {time_offset.reason}"
    return replace(flight, streams=moved,
                   provenance=replace(flight.provenance, notes=(*flight.provenance.notes, note),
                                      clock_evidence=time_offset.evidence))
