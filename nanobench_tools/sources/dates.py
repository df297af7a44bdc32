"""Dates of a text column as seconds: ISO 8601, also with a blank for the T or a decimal comma.

Times of day, and durations such as ``0.02 sec`` or ``59:30.020``, are read, too."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

_DATE = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d\d:?\d\d.*")
_DAY_TIME = re.compile(r"\d?\d:\d\d:\d\d([.,]\d+)?")
_DURATION = re.compile(r"(-?\d+(?:[.,]\d+)?) ?(sec|s|ms|min|hr)")
_MINUTES = re.compile(r"(\d{1,3}):(\d\d[.,]\d+)")
"""Minutes and seconds. Without a fraction these could be hours and minutes."""
UNITS_S = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "hr": 3600.0}
DAY_S, HOUR_S = 86400.0, 3600.0
KINDS = (_DATE, _DAY_TIME, _DURATION, _MINUTES)


def looks_like_dates(cells: Sequence[str]) -> bool:
    """Whether most of the cells hold a date, a time of day or a duration."""
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(any(kind.fullmatch(c) for kind in KINDS) for c in filled) > len(filled)


def seconds_of_dates(cells: Sequence[str]) -> np.ndarray:
    """(n,) s since 1970, or since midnight for a time of day (a later midnight, or hour, is counted on); NaN without.

    A date without a zone is read as UTC.
    """
    import pandas as pd

    plain = [c.strip().removesuffix("UTC").strip().replace(",", ".") for c in cells]
    kind = max(KINDS, key=lambda kind: sum(bool(kind.fullmatch(c)) for c in plain))
    if kind is _DURATION:
        found = [_DURATION.fullmatch(c) for c in plain]
        return np.array([float(m[1]) * UNITS_S[m[2]] if m else np.nan for m in found])
    if kind is _MINUTES:
        found = [_MINUTES.fullmatch(c) for c in plain]
        return _counted_on(np.array([60.0 * float(m[1]) + float(m[2]) if m else np.nan for m in found]), HOUR_S)
    if kind is _DAY_TIME:
        since = np.array(pd.to_timedelta(pd.Series(plain), errors="coerce").dt.total_seconds(), dtype=float)
        return _counted_on(since, DAY_S)
    dates = pd.to_datetime(pd.Series(plain), errors="coerce", format="ISO8601", utc=True)
    nanoseconds = dates.to_numpy("datetime64[ns]")
    return np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype("int64") * 1e-9)


def _counted_on(since: np.ndarray, whole_s: float) -> np.ndarray:
    """(n,) s that begin again at 0 after ``whole_s``, counted on."""
    known = np.flatnonzero(np.isfinite(since))
    passed = np.zeros(len(since))
    passed[known] = np.cumsum(np.diff(since[known], prepend=since[known[:1]]) < -0.5 * whole_s)
    return since + whole_s * passed
