"""Which rows of a resampled stream carry no packet, and how many packets there were.

A resampler that interpolates linearly leaves rows on straight chords between packets. Row i lies on the chord of rows
i-1 and i+1 in every column, and changes, only without a packet between them (the chord test).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..settings import number

RELATIVE_TOLERANCE = number("sources.interpolation.relative_tolerance")
"""Distance from the chord as a share of the column's range, where the print resolution is unknown."""


def _on_chord(time_s: np.ndarray, values: np.ndarray, resolution: np.ndarray | float | None) -> np.ndarray:
    """(n,) bool: row i lies on the chord of its neighbours in all columns, moving or not."""
    flags = np.zeros(len(time_s), dtype=bool)
    if len(time_s) < 3 or values.shape[1] == 0:
        return flags
    if resolution is None:
        finite = np.where(np.isfinite(values), values, 0.0)
        low, high = np.quantile(finite, (0.02, 0.98), axis=0)
        tolerance = RELATIVE_TOLERANCE * (high - low)
    else:
        tolerance = 2.5 * np.asarray(resolution, dtype=float)
    before, here, after = values[:-2], values[1:-1], values[2:]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        share = ((time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2]))[:, None]
        off = np.abs(here - (before + (after - before) * share))
        flags[1:-1] = (off <= tolerance + 4e-15 * np.abs(here)).all(axis=1)
    flags[1:-1] &= (time_s[1:-1] > time_s[:-2]) & (time_s[2:] > time_s[1:-1])
    return flags


def _moved(values: np.ndarray) -> np.ndarray:
    """(n,) bool: the row differs from the one before."""
    moved = np.ones(len(values), dtype=bool)
    moved[1:] = (values[1:] != values[:-1]).any(axis=1)
    return moved


def carries_no_packet(time_s: np.ndarray, values: np.ndarray,
                      resolution: np.ndarray | float | None = None) -> np.ndarray:
    """(n,) bool: row i is on the chord of its neighbours in all columns, and changes.

    time_s (n,) s, values (n, k) any unit; ``resolution`` (k,) is the value of the last printed digit in the same unit.
    An interpolated row is then off its chord by at most two such digits. Without it, a share of the range of the
    middle 96 % is used. A row that equals its neighbours carries no information and is False. So are the first and the
    last row, and rows next to NaN or to a time that does not advance.
    """
    return np.asarray(_on_chord(time_s, values, resolution) & _moved(values))


@dataclass(frozen=True)
class Packets:
    """``count`` packets (estimate); ``last_s`` time of the last row before a straight line to the end begins [s]."""

    count: int
    last_s: float


def count_packets(time_s: np.ndarray, values: np.ndarray, resolution: np.ndarray | float | None = None) -> Packets:
    """How many packets a resampled stream was made of, never more than its rows. Arguments as above.

    Rows between two packets come in blocks of m. A run of m - 2 rows on a chord shows m >= 3. Row by row, m = 2 is
    indistinguishable from m = 1, so their number is continued from the longer runs as a geometric series. Constant
    stretches carry no information and count with the rate of the rest. A straight line to the end of the recording is
    no packet at all.
    """
    n = len(time_s)
    end = float(time_s[-1]) if n else float("nan")
    flags = _on_chord(time_s, values, resolution)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return Packets(n, end)
    lengths = ends - starts
    moving = _moved(values)[starts]
    tail = moving & (ends >= n - 1)
    if tail.any():
        end = float(time_s[starts[-1] - 1])
    ramps = lengths[moving & ~tail]
    between = np.concatenate((starts, [n])) - np.concatenate(([0], ends))
    alone = int(np.maximum(between - 2, 0).sum())  # rows in blocks of one or two
    ratio = (float((ramps - 1).sum()) + 0.5) / (float(ramps.sum()) + 1.0)  # of the series, one half when unknown
    pairs = min((ramps == 1).sum() / ratio, alone / 2.0)
    packets = len(ramps) + alone - pairs
    rows = int((ramps + 2).sum()) + alone
    if rows < 10 or packets <= 0.0:
        return Packets(int(n - lengths[tail].sum()), end)
    still = int((lengths[~moving] + 2).sum())
    return Packets(int(np.clip(round(packets * (1.0 + still / rows)), 1, n)), end)


def count_changes(values: np.ndarray) -> int | None:
    """How many values a stream holds that was written faster than it changes (last value repeated).

    values (n, k). Rows that repeat the row before count as one value with it. Standstills longer than five usual steps
    carry no information and count with the rate of the rest. None when nothing ever changes.
    """
    steps = np.diff(np.flatnonzero(_moved(values)))
    if not len(steps):
        return None
    usual = steps[steps <= 5 * np.median(steps)]
    return int(np.clip(round(len(values) / usual.mean()), 1, len(values)))
