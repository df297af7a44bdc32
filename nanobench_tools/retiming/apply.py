"""The three clocks every protocol can be run with: as recorded, constant offset removed, moving error removed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..content.context import Context
from ..flight import Flight, Stream
from .infer import believed, infer
from .warp import ClockWarp, retime

CLOCKS = ("as-recorded", "offset", "retimed")

INERTIAL = ("gyro", "acceleration")
"""Evidence for judging the estimator: its own position and velocity must not have set the clock that judges them."""


@dataclass(frozen=True)
class Clocked:
    """A flight on the chosen clock, its firmware streams put back on the rows of the motion capture; ``said`` is what a
    row of a table has to say about it, ``warp`` None when nothing was moved."""

    flight: Flight
    warp: ClockWarp | None
    said: str


def with_clock(flight: Flight, clock: str, judges_estimator: bool = False) -> Clocked:
    """``flight`` as seen with ``clock`` (one of CLOCKS).

    Re-timing uses the motion capture of the whole flight: right for asking what limits a method, never for an online
    claim. ``judges_estimator``: use only gyro and accelerometer (and how the estimator's position advances against its
    own velocity, which needs no motion capture) as evidence. Without a usable clock the flight is left as it is.
    """
    if clock == "as-recorded":
        return Clocked(flight, None, "clock as recorded")
    context = Context(flight)
    warp = infer(context, INERTIAL) if judges_estimator else believed(context)
    if warp is None:
        return Clocked(flight, None, "clock as recorded (no motion to read it from)")
    if clock == "offset":
        flat = np.full(len(warp.time_s), warp.constant_s)
        warp = replace(warp, offset_s=flat, moving=False, wander_sd_s=0.0, reason="constant offset removed")
    source = ", ".join(warp.lags_s)
    said = "constant offset removed" if not warp.moving else f"re-timed off-line by {source}"
    return Clocked(on_rows(retime(flight, warp)), warp, said)


def on_rows(flight: Flight) -> Flight:
    """Every firmware stream interpolated linearly onto the stamps of the motion capture (quaternions along the great
    circle); true sample counts are kept, so that these rows still do not count as measurements."""
    rows_s = flight["mocap"].time_s
    return replace(flight, streams={name: s if name == "mocap" or len(s) < 2 else _resampled(s, rows_s)
                                    for name, s in flight.streams.items()})


def _resampled(stream: Stream, rows_s: np.ndarray) -> Stream:
    # equal stamps (samples delivered in one burst) keep the last of them
    last = np.concatenate((np.diff(stream.time_s) > 0.0, [True]))
    t, values = stream.time_s[last], stream.values[last]
    moved = np.column_stack([np.interp(rows_s, t, values[:, k]) for k in range(values.shape[1])])
    if {"qx", "qy", "qz", "qw"} <= set(stream.quantities):
        where = [stream.index(q) for q in ("qx", "qy", "qz", "qw")]
        moved[:, where] = so3.interpolate(t, values[:, where], rows_s)
    return replace(stream, time_s=rows_s, values=moved)
