"""Fewer points for the page without hiding anything: extremes and gaps survive, and the page says what was done."""

from __future__ import annotations

import base64

import numpy as np

MISSING = -32768
"""The int16 that stands for a value that is not there."""


def extreme_rows(values: np.ndarray, buckets: int) -> np.ndarray:
    """Rows (m,) of ``values`` (n,) that keep the smallest and largest of every bucket, both ends and every gap.

    All rows when there are at most 2 ``buckets``. A bucket with values that are not numbers keeps one of them, so
    that a gap of any length stays a gap.
    """
    values = np.asarray(values, float)
    n = len(values)
    if n <= 2 * buckets:
        return np.arange(n)
    size = -(-n // buckets)
    padded = np.concatenate([values, np.full(-n % size, values[-1])]).reshape(-1, size)
    start = np.arange(len(padded)) * size
    gap = np.isnan(padded)
    low = np.argmin(np.where(gap, np.inf, padded), axis=1) + start
    high = np.argmax(np.where(gap, -np.inf, padded), axis=1) + start
    holes = (np.argmax(gap, axis=1) + start)[gap.any(axis=1)]
    rows = np.unique(np.concatenate([[0, n - 1], low, high, holes]))
    return rows[rows < n]


def at_rate(time_s: np.ndarray, rate_hz: float) -> np.ndarray:
    """Rows (m,) of ``time_s`` (n,): the first of every 1 / ``rate_hz`` seconds, and the last row."""
    if not len(time_s):
        return np.arange(0)
    slot = np.floor((np.asarray(time_s) - time_s[0]) * rate_hz + 1e-6)
    rows = np.flatnonzero(np.r_[True, np.diff(slot) != 0])
    return np.union1d(rows, [len(time_s) - 1])


def pack(values: np.ndarray, resolution: float) -> dict[str, object]:
    """``values`` (n,) for the page: base64 of int16 steps of at most ``resolution``, else of float32.

    ``{"b": base64, "n": n, "s": step, "o": offset}`` (value = o + s * int16) or ``{"f": base64, "n": n}``;
    values that are not finite become a gap. Bytes are little-endian.
    """
    values = np.asarray(values, float)
    good = np.isfinite(values)
    low, high = (float(values[good].min()), float(values[good].max())) if good.any() else (0.0, 0.0)
    step = max((high - low) / 65000.0, resolution / 8.0)
    if step > resolution:
        raw = np.where(good, values, np.nan).astype("<f4").tobytes()
        return {"f": base64.b64encode(raw).decode(), "n": len(values)}
    offset = (low + high) / 2.0
    steps = np.full(len(values), MISSING, dtype="<i2")
    steps[good] = np.round((values[good] - offset) / step).astype("<i2")
    return {"b": base64.b64encode(steps.tobytes()).decode(), "n": len(values), "s": float(f"{step:.9g}"),
            "o": float(f"{offset:.12g}")}
