"""When the vehicle was in the air: first to last crossing of 5 cm above the resting height.

A log that was switched on in the air never shows the ground, and its lowest point is no resting height. Motors that
carry what they carry in flight, on a vehicle that moves, are then the evidence: nothing stands that long with them.
"""

from __future__ import annotations

import numpy as np

from ..flight import Span
from ..settings import count, number
from .context import Context
from .plausible_ranges import tracker_scale
from .step_removal import levelled
from .usable_rows import usable_streams

HEIGHT_M = number("audit.airborne.height_m")
"""Above the resting height; a vehicle of 40 g stands within 1 mm and rebounds by 2-14 cm after touch-down."""
CARRIES = number("audit.airborne.carries")
"""Of the median command of motors that run: less may not lift the vehicle off."""
RUNS = number("audit.airborne.runs")
"""Mean command of motors that run."""
ALWAYS = number("audit.airborne.always")
"""Share of rows in which they run, of a log without the ground."""
HELD_S = number("audit.airborne.held_s")
"""A vehicle at rest whose motors carry it has left the 5 cm within this time."""
MOVED_M = number("audit.airborne.moved_m")
"""Range of a position that no vehicle at rest has: the tracker's noise is 1 mm."""
ENDS_ROWS = count("audit.airborne.ends_rows")
"""Rows at both ends whose median height may be the resting one."""
ABOVE_LOW_M = number("audit.airborne.above_low_m")
"""A vehicle rests at most so far above that quantile."""
LOW = number("audit.airborne.low")
"""Quantile of the heights that is near the resting one."""


def resting_height_m(z: np.ndarray) -> float:
    """The lowest height it stood at: the median of the first or last half second, or the 2 % point if that is lower."""
    n = min(len(z), ENDS_ROWS)
    return float(min(np.median(z[:n]), np.median(z[-n:]), np.quantile(z, LOW) + ABOVE_LOW_M))


def height_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,), z (n,) m of the motion capture, less its jumps, else of the estimator; None without either."""
    streams = context.once(usable_streams)
    for name, column in (("mocap", "pz"), ("estimator", "z")):
        if name in streams and column in streams[name].quantities:
            stream = streams[name]
            z = stream[column] / (context.once(tracker_scale) if name == "mocap" else 1.0)
            good = np.isfinite(z)
            if good.sum() > 1:
                return stream.time_s[good], levelled(stream.time_s[good], z[good]) if name == "mocap" else z[good]
    return None


def position_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,), position (n, 3) m of the stream of ``height_of``."""
    streams = context.once(usable_streams)
    for name, columns in (("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z"))):
        if name in streams and all(c in streams[name].quantities for c in columns):
            stream = streams[name]
            position = stream[columns] / (context.once(tracker_scale) if name == "mocap" else 1.0)
            good = np.isfinite(position).all(axis=1)
            if good.sum() > 1:
                return stream.time_s[good], position[good]
    return None


def airborne_spans(context: Context) -> tuple[Span, ...]:
    """One span, or none if it never left the ground or there is no height to tell.

    A recording that starts or ends in the air is airborne from its first or to its last row. Rows that stick out
    alone (spikes of the tracker) do not count: three in a row must be up.
    """
    height = context.once(height_of)
    if height is None:
        return ()
    time_s, z = height
    up = z > resting_height_m(z) + HEIGHT_M
    lasting = up.copy()
    lasting[1:-1] = (up[:-2] & up[1:-1]) | (up[1:-1] & up[2:])
    rows = np.flatnonzero(lasting)
    crossed = Span(float(time_s[rows[0]]), float(time_s[rows[-1]])) if len(rows) > 2 else None
    whole = Span(float(time_s[0]), float(time_s[-1]))
    if crossed is None:
        return (whole,) if _flies(context, whole) else ()
    before, after = Span(whole.start_s, crossed.start_s), Span(crossed.end_s, whole.end_s)
    return (Span(whole.start_s if _flies(context, before) else crossed.start_s,
                 whole.end_s if _flies(context, after) else crossed.end_s),)


def _flies(context: Context, span: Span) -> bool:
    """Whether a vehicle whose motors never stop in the recording is carried by them, and moves, in a stretch that is
    too low to tell. Where they do stop, the ground was seen and the height tells."""
    streams = context.once(usable_streams)
    motor = streams.get("motor") or streams.get("command")
    place = context.once(position_of)
    if span.duration_s < HELD_S or motor is None or place is None:
        return False
    command = np.nan_to_num(motor.values).mean(axis=1)
    if "N" in motor.unit:  # as a share of about what carries it
        command = 0.5 * command / max(float(np.median(command)), 1e-9)
    inside = command[span.mask(motor.time_s)]
    if len(inside) < 10 or not np.ptp(inside) or (command > RUNS).mean() < ALWAYS:
        return False
    time_s, position = place
    there = position[span.mask(time_s)]
    moved = np.ptp(np.quantile(there, (0.05, 0.95), axis=0), axis=0) if len(there) > 10 else np.zeros(3)
    return bool((inside > CARRIES * np.median(command)).mean() > CARRIES and (moved > MOVED_M).any())
