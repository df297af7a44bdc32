"""Samples that differ from their neighbours and return at once; limits and reasons are in ``faults.spike``."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from ..flight import Stream
from ..settings import count, number, setting
from .context import Context
from .crashes import crash_of
from .dropouts import alive_until
from .ground_contact import contact_likely
from .unit_sign_errors import distorted_streams
from .usable_rows import runs, usable_streams, usual_step_s

LIMITS: dict[str, dict[str, float]] = setting("audit.spikes.limits")
SHOCKED = ("imu", "estimator_acc", "attitude", "attitude_qw")
ROW_S = number("audit.spikes.row_s")
TIMES_LOCAL = number("audit.spikes.times_local")
WIDTH = count("audit.spikes.width")
WIDEST = count("audit.spikes.widest")
AROUND = count("audit.spikes.around")
STAYS = number("audit.spikes.stays")
AROUND_QUANTILE = number("audit.spikes.around_quantile")
BOUNCE = number("audit.spikes.bounce")


class Spike(NamedTuple):
    """Rows first..last of ``stream`` stick out in ``columns`` (k,) by ``distance`` (k,); ``least`` (k,) is what is
    surely found there."""

    name: str
    stream: Stream
    columns: list[int]
    distance: np.ndarray
    least: np.ndarray
    first: int
    last: int


def spikes(context: Context) -> list[Spike]:
    """Every spike."""
    found = []
    for name, limits in LIMITS.items():
        stream = context.once(usable_streams).get(name)
        if stream is None or len(stream) < 2 * WIDTH or name in context.once(distorted_streams):
            continue
        use = [k for k, q in enumerate(stream.quantities) if q in limits]
        if not use:
            continue
        values = _filled(_unwrapped(stream, use))
        distance = _distance(values)
        # the limits are for rows 10 ms apart; bends grow with the square of the time between rows
        slower = max(usual_step_s(stream.time_s) / ROW_S, 1.0) ** 2 if name == "mocap" else 1.0
        limit = slower * np.array([limits[stream.quantities[k]] for k in use])
        beyond = (distance > limit) & (stream.time_s <= context.once(alive_until)[name])[:, None]
        rows: np.ndarray = np.any(beyond, axis=1)
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
            stays = np.abs(values[min(b, len(values) - 1)] - values[max(a - 1, 0)]) > STAYS * top
            sticking = np.flatnonzero((top > limit) & (top > floor) & ~stays)
            if name == "mocap" and contact_likely(context, stream.time_s[a:b]).any() and \
                    _bounced(values[:, sticking], int(a), int(b), limit[sticking]):
                continue
            if len(sticking):
                least = least_height(values[:, sticking], int(a), int(b), limit[sticking])
                columns = [use[k] for k in sticking]
                found.append(Spike(name, stream, columns, top[sticking], least, int(a), int(b) - 1))
    return found


def least_height(values: np.ndarray, first: int, end: int, limit: np.ndarray) -> np.ndarray:
    """(k,): smallest spike of either sign that is found in rows first..end-1 of values (n, k).

    A moving vehicle moves on during the spike. The median of the neighbours may be nearer by a row's step for each row
    of the spike. The neighbours on either side also differ; a spike that returns must be twice that difference. Rows a
    step beyond the limit away count as part of it. The spoiled reading may have been off to the other side by as much
    as readings around it. Counted are 97 % of these: all but those that the spike itself reaches.
    """
    rows = slice(max(first - AROUND, 0), end + AROUND)
    noise, off = np.quantile(_distance(values[rows]), (0.5, AROUND_QUANTILE), axis=0)
    before, after = values[max(first - WIDEST, 0) : first], values[end : end + WIDEST]
    across = np.abs(values[min(end, len(values) - 1)] - values[max(first - 1, 0)])
    step = np.abs(np.concatenate([np.diff(before, axis=0), np.diff(after, axis=0), across[None]])).max(axis=0)
    across = across + np.where(step > limit, 2.0 * step, 0.0)
    beyond = np.maximum(np.maximum(limit, TIMES_LOCAL * noise), 2.0 * across)
    return np.asarray(beyond + (end - first) * step + off)


def _bounced(values: np.ndarray, first: int, end: int, limit: np.ndarray) -> bool:
    """Whether the path turns round in rows first..end-1 of positions (n, k), as when legs strike the ground. They then
    lie on the straight lines through the rows before and after, within half the limit. A spike is off both."""
    before, after = values[max(first - WIDEST, 0):first], values[end:end + WIDEST]
    if len(before) < WIDEST or len(after) < WIDEST:
        return False
    ahead = np.arange(1, end - first + 1)[:, None]
    forth = before[-1] + ahead * (before[-1] - before[0]) / (WIDEST - 1)
    back = (after[0] - ahead * (after[-1] - after[0]) / (WIDEST - 1))[::-1]
    off = np.minimum(np.abs(values[first:end] - forth), np.abs(values[first:end] - back))
    return bool((off < BOUNCE * limit).all())


def _distance(values: np.ndarray) -> np.ndarray:
    """(n, k): of every row from the median of the WIDTH rows around it."""
    return np.asarray(np.abs(values - median_filter(values, size=(WIDTH, 1), mode="nearest")))


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
    return np.asarray(np.nan_to_num(np.take_along_axis(values, index, axis=0)))
