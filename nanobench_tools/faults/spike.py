"""spike: one sample (up to three rows, since interpolation spreads it) that sticks out and is gone again.

Found as the distance of a row from the median of the seven rows around it. A spike is farther off than the vehicle can
get in 30 ms (LIMITS, per quantity, from its agility: 40 m/s^2, 300 rad/s^2, and the radio clock's leaps of up to 70 ms
for estimates) and more than 12 times the median distance of the rows within half a second (noise of this very
place). Accelerometer, gyro and accelerations are not judged within half a second of moving near the ground, where
true shocks look the same. Motors, requests and setpoints may leap by right. One entry per spike.

Size: distance, in the unit of the column. Smallest found: the larger of the two limits.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..content.context import Context
from ..content.landmarks import contact_likely
from ..content.rows import runs, usable_streams
from ..content.tails import alive_until
from ..content.wrongness import distorted_streams
from ..flight import Fault, Flight, Stream

KIND = "spike"

LIMITS: dict[str, dict[str, float]] = {
    "mocap": {**dict.fromkeys(("px", "py", "pz"), 0.02), **dict.fromkeys(("qx", "qy", "qz", "qw"), 0.08)},
    "imu": {**dict.fromkeys(("acc_x", "acc_y", "acc_z"), 6.0), **dict.fromkeys(("gyro_x", "gyro_y", "gyro_z"), 3.0)},
    "estimator": {**dict.fromkeys(("x", "y", "z"), 0.12), **dict.fromkeys(("vx", "vy", "vz"), 0.4)},
    "estimator_acc": dict.fromkeys(("ax", "ay", "az"), 6.0),
    "attitude": dict.fromkeys(("roll", "pitch", "yaw"), 0.12),
    "attitude_qw": dict.fromkeys(("qx", "qy", "qz", "qw"), 0.06),
    "battery": {"vbat": 0.12},
}
SHOCKED = ("imu", "estimator_acc")
TIMES_LOCAL = 12.0
WIDTH = 7
WIDEST = 3
AROUND = 50
"""Rows on either side from which the local noise is taken."""


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per spike; columns that stick out together are one spike."""
    faults = []
    for name, stream, columns, distance, first, last in context.once(spikes):
        limits = np.array([LIMITS[name][stream.quantities[k]] for k in columns])
        strongest = int(np.argmax(distance / limits))
        k = columns[strongest]
        t = stream.time_s
        start, end = float(t[max(first - 1, 0)]), float(t[min(last + 1, len(t) - 1)])
        names = tuple(stream.columns[c] for c in columns)
        faults.append(Fault(KIND, name, names, start, end, float(distance[strongest]), stream.unit[k],
                            f"{stream.columns[k]} is {distance[strongest]:.3g} {stream.unit[k]} off its neighbours in "
                            f"{last - first + 1} row(s) at {t[first]:.3f} s", float(limits[strongest])))
    return faults


def spikes(context: Context) -> list[tuple[str, Stream, list[int], np.ndarray, int, int]]:
    """(stream name, stream, columns, distance per column, first row, last row) of every spike."""
    found = []
    for name, limits in LIMITS.items():
        stream = context.once(usable_streams).get(name)
        if stream is None or len(stream) < 2 * WIDTH or name in context.once(distorted_streams):
            continue
        use = [k for k, q in enumerate(stream.quantities) if q in limits]
        if not use:
            continue
        values = _filled(_unwrapped(stream, use))
        distance = np.abs(values - median_filter(values, size=(WIDTH, 1), mode="nearest"))
        limit = np.array([limits[stream.quantities[k]] for k in use])
        beyond = (distance > limit) & (stream.time_s <= context.once(alive_until)[name])[:, None]
        rows = beyond.any(axis=1)
        if not rows.any():
            continue
        if name in SHOCKED:
            rows &= ~contact_likely(context, stream.time_s)
        for a, b in runs(rows):
            if b - a > WIDEST:
                continue
            around = distance[max(a - AROUND, 0):b + AROUND]
            floor = TIMES_LOCAL * np.median(around, axis=0)
            top = distance[a:b].max(axis=0)
            sticking = np.flatnonzero((top > limit) & (top > floor))
            if len(sticking):
                found.append((name, stream, [use[k] for k in sticking], top[sticking], int(a), int(b) - 1))
    return found


def _unwrapped(stream: Stream, use: list[int]) -> np.ndarray:
    values = stream.values[:, use]
    if stream.quantities[use[0]] in ("roll", "pitch", "yaw"):
        finite = np.where(np.isfinite(values), values, 0.0)
        return np.where(np.isfinite(values), np.unwrap(finite, axis=0), np.nan)
    if "qw" in stream.quantities:
        # q and -q are the same rotation: a change of sign is no spike
        q = [i for i, k in enumerate(use) if stream.quantities[k] in ("qx", "qy", "qz", "qw")]
        values = values.copy()
        dots = np.sum(values[1:, q] * values[:-1, q], axis=1)
        values[1:, q] *= np.cumprod(np.where(dots < 0.0, -1.0, 1.0))[:, None]
    return values


def _filled(values: np.ndarray) -> np.ndarray:
    """Rows that are no numbers take the value before them (they are reported elsewhere)."""
    bad = ~np.isfinite(values)
    if not bad.any():
        return values
    index = np.where(bad, 0, np.arange(len(values))[:, None])
    np.maximum.accumulate(index, axis=0, out=index)
    return np.nan_to_num(np.take_along_axis(values, index, axis=0))
