"""Numbers for a page: fewer points without hiding anything, and few bytes. Extremes and gaps survive."""

import base64
import json
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

SIGNIFICANT = 6
"""Digits of a number on a page."""
Values = np.ndarray | Sequence[float | str | None]


def rounded(values: np.ndarray, resolution: float) -> np.ndarray:
    """``values`` in whole multiples of ``resolution``: what a picture can show, in few bytes."""
    return np.round(values / resolution) * resolution


def as_json(values: Values) -> list[float | str | None]:
    """Numbers of six digits, texts, and null for what is no number."""
    return [_short(value) for value in (values.tolist() if isinstance(values, np.ndarray) else values)]


def _short(value: float | str | None) -> float | str | None:
    if value is None or isinstance(value, str):
        return value
    return float(f"{value:.{SIGNIFICANT}g}") if np.isfinite(value) else None


def compressed(body: Any) -> str:
    """JSON of ``body`` as base64 of a zlib stream; every browser undoes both. Characters that are not text (names of
    files may have such) become a question mark."""
    text = json.dumps(body, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return base64.b64encode(zlib.compress(text.encode(errors="replace"), 9)).decode()


def envelope(time_s: np.ndarray, values: np.ndarray, span: tuple[float, float], buckets: int,
             resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """Time and value (2 ``buckets``,): the smallest and the largest value in every stretch of ``span``, in their
    order.

    Inputs: ``values`` (n,) at ``time_s`` (n,). A stretch with a value that is no number keeps a gap."""
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
    return start + width * (0.25 + 0.5 * np.arange(2 * buckets)), rounded(pair.ravel(), resolution)


def on_grid(time_s: np.ndarray, values: np.ndarray, grid: np.ndarray, longest_gap_s: float) -> np.ndarray:
    """``values`` (n, k) between their times at ``grid`` (m,): (m, k), gaps where none is nearer than that."""
    if len(time_s) < 2:
        return np.full((len(grid), values.shape[1]), np.nan)
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    found = np.stack([np.interp(grid, time_s, column) for column in values.T], axis=1)
    away = (time_s[after] - time_s[after - 1] > longest_gap_s) | (grid < time_s[0]) | (grid > time_s[-1])
    found[away] = np.nan
    return found
