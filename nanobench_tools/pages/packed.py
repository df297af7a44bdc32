"""Numbers for a page: fewer points without hiding anything, and few bytes. Extremes and gaps survive."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

SIGNIFICANT = 4
"""Digits of a number that a picture can show."""


@dataclass(frozen=True)
class Steps:
    """``values`` (n,) drawn in whole multiples of ``resolution``: as differences they compress to a byte each."""

    values: np.ndarray
    resolution: float

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Even:
    """``count`` values from ``start``, each ``step`` after the one before."""

    start: float
    step: float
    count: int

    def __len__(self) -> int:
        return self.count


Values = Steps | Even | np.ndarray | Sequence[float | str | None]


def as_json(values: Values) -> Any:
    """``{"s": resolution, "d": [first, difference, ..., null for a gap]}``, ``{"r": [start, step, count]}``, or a list
    of numbers of four digits, texts and nulls."""
    if isinstance(values, Even):
        return {"r": [round(values.start, 4), round(values.step, 6), values.count]}
    if isinstance(values, Steps):
        good = np.isfinite(values.values)
        whole = np.round(np.where(good, values.values, 0.0) / values.resolution).astype(np.int64)
        gaps = np.zeros(len(whole), np.int64)
        gaps[good] = np.diff(whole[good], prepend=0)
        return {"s": values.resolution, "d": [int(d) if there else None for d, there in
                                              zip(gaps.tolist(), good.tolist(), strict=True)]}
    return [_short(value) for value in (values.tolist() if isinstance(values, np.ndarray) else values)]


def _short(value: float | str | None) -> float | str | None:
    if value is None or isinstance(value, str):
        return value
    return float(f"{value:.{SIGNIFICANT}g}") if np.isfinite(value) else None


def compressed(body: Any) -> str:
    """JSON of ``body`` as base64 of a zlib stream; every browser undoes both. What is no text (names of files may hold
    such) becomes a question mark."""
    text = json.dumps(body, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return base64.b64encode(zlib.compress(text.encode(errors="replace"), 9)).decode()


def envelope(time_s: np.ndarray, values: np.ndarray, span: tuple[float, float], buckets: int,
             resolution: float) -> tuple[Even, Steps]:
    """Time and value (2 ``buckets``,): of every stretch of ``span`` the smallest and the largest of ``values`` (n,) at
    ``time_s`` (n,), in their order. A stretch with a value that is no number keeps a gap."""
    start, end = span
    width = max(end - start, 1e-9) / buckets
    slot = np.floor((np.asarray(time_s, float) - start) / width)
    slot = np.clip(np.where(np.isfinite(slot), slot, -1), -1, buckets).astype(int)
    slot[slot == buckets] = buckets - 1  # the last value belongs to the last stretch
    low, high = np.full(buckets, np.inf), np.full(buckets, -np.inf)
    first, last = np.full(buckets, np.nan), np.full(buckets, np.nan)
    good = np.isfinite(values) & (slot >= 0)
    np.minimum.at(low, slot[good], values[good])
    np.maximum.at(high, slot[good], values[good])
    first[slot[good][::-1]] = values[good][::-1]
    last[slot[good]] = values[good]
    holes = np.unique(slot[~np.isfinite(values) & (slot >= 0)])
    there = np.isfinite(low)
    pair = np.where((first > last)[:, None], np.stack([high, low], axis=1), np.stack([low, high], axis=1))
    pair[~there] = np.nan
    pair[holes, 1] = np.nan
    return (Even(start + width / 4.0, width / 2.0, 2 * buckets), Steps(pair.ravel(), resolution))


def on_grid(time_s: np.ndarray, values: np.ndarray, grid: np.ndarray, longest_gap_s: float) -> np.ndarray:
    """``values`` (n, k) between their times at ``grid`` (m,): (m, k), gaps where none is nearer than that."""
    if len(time_s) < 2:
        return np.full((len(grid), values.shape[1]), np.nan)
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    found = np.stack([np.interp(grid, time_s, column) for column in values.T], axis=1)
    away = (time_s[after] - time_s[after - 1] > longest_gap_s) | (grid < time_s[0]) | (grid > time_s[-1])
    found[away] = np.nan
    return found
