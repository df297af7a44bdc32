"""Samples that stick out of their neighbours and are gone again; limits and reasons stand in ``faults.spike``."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..flight import Stream
from .context import Context
from .crashes import crash_of
from .landmarks import contact_likely
from .rows import runs, usable_streams, usual_step_s
from .tails import alive_until
from .wrongness import distorted_streams

LIMITS: dict[str, dict[str, float]] = {
    "mocap": {**dict.fromkeys(("px", "py", "pz"), 0.02), **dict.fromkeys(("qx", "qy", "qz", "qw"), 0.08)},
    "imu": {**dict.fromkeys(("acc_x", "acc_y", "acc_z"), 6.0), **dict.fromkeys(("gyro_x", "gyro_y", "gyro_z"), 3.0)},
    "estimator": {**dict.fromkeys(("x", "y", "z"), 0.12), **dict.fromkeys(("vx", "vy", "vz"), 0.4)},
    "estimator_acc": dict.fromkeys(("ax", "ay", "az"), 6.0),
    "attitude": dict.fromkeys(("roll", "pitch", "yaw"), 0.12),
    "attitude_qw": dict.fromkeys(("qx", "qy", "qz", "qw"), 0.06),
    "battery": {"vbat": 0.12},
}
SHOCKED = ("imu", "estimator_acc", "attitude", "attitude_qw")
ROW_S = 0.01
TIMES_LOCAL = 12.0
WIDTH = 7
WIDEST = 3
AROUND = 50
"""Rows on either side from which the local noise is taken."""


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
        # the limits are for rows 10 ms apart; bends grow with the square of the time between rows
        slower = max(usual_step_s(stream.time_s) / ROW_S, 1.0) ** 2 if name == "mocap" else 1.0
        limit = slower * np.array([limits[stream.quantities[k]] for k in use])
        beyond = (distance > limit) & (stream.time_s <= context.once(alive_until)[name])[:, None]
        rows = beyond.any(axis=1)
        if not rows.any():
            continue
        crash = context.once(crash_of)
        if crash is not None:
            rows &= stream.time_s < crash.start_s
        if name in SHOCKED:
            rows &= ~contact_likely(context, stream.time_s)
        for a, b in runs(rows):
            if b - a > WIDEST:
                continue
            around = distance[max(a - AROUND, 0) : b + AROUND]
            floor = TIMES_LOCAL * np.median(around, axis=0)
            top = distance[a:b].max(axis=0)
            stays = np.abs(values[min(b, len(values) - 1)] - values[max(a - 1, 0)]) > 0.5 * top
            sticking = np.flatnonzero((top > limit) & (top > floor) & ~stays)
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
