"""When the vehicle was in the air: more than 5 cm above the resting height. Rests on the ground between two flights of
one log are excluded.

A log that was switched on in the air never shows the ground, and its lowest point is no resting height. Motors at
flight load on a vehicle that moves are then the evidence: a vehicle on the ground never runs them that long.
"""

import numpy as np

from ..flight import Span, Stream, poses_alone, subtract_spans
from ..settings import count, number
from .context import Context
from .flown_axes import tracker_scale
from .pose_frame import pose_frame, posed
from .step_removal import levelled
from .usable_rows import runs, usable_streams

HEIGHT_M = number("audit.airborne.height_m")
CARRIES = number("audit.airborne.carries")
RUNS = number("audit.airborne.runs")
ALWAYS = number("audit.airborne.always")
HELD_S = number("audit.airborne.held_s")
MOVED_M = number("audit.airborne.moved_m")
RESTS_S = number("audit.airborne.rests_s")
RESTS_M = number("audit.airborne.rests_m")
"""A vehicle at rest moves by less in that time, plus RESTS_NOISE standard deviations of its tracker's noise."""
RESTS_NOISE = number("audit.airborne.rests_noise")
NOISE_OF_BENDS = 0.6745 * np.sqrt(6.0)  # median |second difference| of white noise over its standard deviation
FALLS_S = number("audit.airborne.falls_s")
ENDS_ROWS = count("audit.airborne.ends_rows")
ABOVE_LOW_M = number("audit.airborne.above_low_m")
LOW = number("audit.airborne.low")


def resting_height_m(z: np.ndarray) -> float:
    """The lowest height it stood at: the median of the first or last half second, or the 2 % point if that is lower."""
    n = min(len(z), ENDS_ROWS)
    return float(min(np.median(z[:n]), np.median(z[-n:]), np.quantile(z, LOW) + ABOVE_LOW_M))


def _with_poses(context: Context) -> dict[str, Stream]:
    """The usable streams, the motion capture with z up; without it where its up is not known."""
    streams, poses = dict(context.once(usable_streams)), context.once(posed)
    if poses is not None:
        streams["mocap"] = poses
    if context.once(pose_frame).world is None:
        del streams["mocap"]
    return streams


def height_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,), z (n,) m of the motion capture, less its jumps, else of the estimator; None without either, or where
    it is not known which axis of the motion capture points up."""
    streams = _with_poses(context)
    for name, column in (("mocap", "pz"), ("estimator", "z")):
        if name in streams and column in streams[name].quantities:
            stream = streams[name]
            z = stream[column] / (context.once(tracker_scale) if name == "mocap" else 1.0)
            good = np.isfinite(z)
            if good.sum() > 1:
                return stream.time_s[good], levelled(stream.time_s[good], z[good]) if name == "mocap" else z[good]
    return None


def position_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,), position (n, 3) m of the stream of ``height_of``; without an axis that was not logged."""
    streams = _with_poses(context)
    for name, columns in (("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z"))):
        if name in streams and columns[2] in streams[name].quantities:
            stream = streams[name]
            position = stream[[c for c in columns if c in stream.quantities]]
            position = position / (context.once(tracker_scale) if name == "mocap" else 1.0)
            good = np.isfinite(position).all(axis=1)
            if good.sum() > 1:
                return stream.time_s[good], position[good]
    return None


def airborne_spans(context: Context) -> tuple[Span, ...]:
    """Flights in the order of time; none if it never left the ground or there is no height.

    A recording that starts or ends in the air is airborne from its first or to its last row. Rows that stick out
    alone (spikes of the tracker) do not count: three in a row must be up. Two flights are separated by a rest on the
    ground; rebounds of a landing and flight close to the ground separate nothing.
    """
    height = context.once(height_of)
    if height is None or (context.once(pose_frame).foreign_rad and poses_alone(context.flight)):
        return ()
    time_s, z = height
    up = z > resting_height_m(z) + HEIGHT_M
    lasting = up.copy()
    lasting[1:-1] = (up[:-2] & up[1:-1]) | (up[1:-1] & up[2:])
    rows = np.flatnonzero(lasting)
    whole = Span(float(time_s[0]), float(time_s[-1]))
    if len(rows) <= 2:
        return (whole,) if _flies(context, whole) or _never_rests(context, whole) else ()
    crossed = Span(float(time_s[rows[0]]), float(time_s[rows[-1]]))
    before, after = Span(whole.start_s, crossed.start_s), Span(crossed.end_s, whole.end_s)
    flown = Span(whole.start_s if _flies(context, before) else crossed.start_s,
                 whole.end_s if _flies(context, after) else crossed.end_s)
    low = [Span(float(time_s[a - 1]), float(time_s[b])) for a, b in runs(~lasting) if rows[0] < a and b <= rows[-1]]
    return subtract_spans([flown], [*_motors_off(context), *(span for span in low if _rests(context, span))])


def _motors_off(context: Context) -> list[Span]:
    """Where all motors stand still for so long that the vehicle has landed, or never took off."""
    motor = context.once(usable_streams).get("motor")
    if motor is None or len(motor) < 2:
        return []
    t, off = motor.time_s, ~(np.nan_to_num(motor.values) > 0.0).any(axis=1)
    ends = [(a, b) for a, b in runs(off) if t[b - 1] - t[a] >= RESTS_S]
    return [Span(float(t[a]) + FALLS_S if a else -np.inf, float(t[b - 1]) if b < len(t) else np.inf) for a, b in ends]


def _rests(context: Context, span: Span) -> bool:
    """Whether the vehicle is at rest on the ground in most of a low stretch between two flights. It then moves by no
    more than its tracker's noise, and its motors, where known, do not carry it."""
    place = context.once(position_of)
    if span.duration_s < RESTS_S or place is None or _carried(context, span):
        return False
    time_s, position = place
    there = position[span.mask(time_s)]
    n = max(round(RESTS_S / span.duration_s * len(there)), 3)
    if len(there) < n:
        return False
    noise = np.median(np.abs(np.diff(there, 2, axis=0)), axis=0) / NOISE_OF_BENDS
    windows = np.lib.stride_tricks.sliding_window_view(there, n, axis=0)[::max(n // 10, 1)]
    return bool((np.ptp(windows, axis=2) < RESTS_M + RESTS_NOISE * noise).all(axis=1).any())


def _never_rests(context: Context, span: Span) -> bool:
    """Whether a body whose motors were not logged moves all the time at one height: the ground was never seen."""
    streams, place = context.once(usable_streams), context.once(position_of)
    if {"motor", "command"} & set(streams) or place is None or span.duration_s < RESTS_S:
        return False
    moved = np.ptp(np.quantile(place[1], (0.05, 0.95), axis=0), axis=0)
    return bool((moved > MOVED_M).any()) and not _rests(context, span)


def _carried(context: Context, span: Span) -> bool:
    """Whether motors run in a stretch as they do in most of the recording."""
    motor = context.once(usable_streams).get("motor") or context.once(usable_streams).get("command")
    if motor is None:
        return False
    command = np.nan_to_num(motor.values).mean(axis=1)
    inside = command[span.mask(motor.time_s)]
    running = command[command > 0.0]
    return len(inside) > 0 and len(running) > 0 and bool(np.median(inside) > 0.5 * np.median(running))


def _flies(context: Context, span: Span) -> bool:
    """Whether motors that never stop in the recording carry a moving vehicle in a stretch where the height is too low
    to decide. Where motors do stop, the ground was measured and the height decides."""
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
    moved = np.ptp(np.quantile(there, (0.05, 0.95), axis=0), axis=0) if len(there) > 10 else np.zeros(1)
    return bool((inside > CARRIES * np.median(command)).mean() > CARRIES and (moved > MOVED_M).any())
