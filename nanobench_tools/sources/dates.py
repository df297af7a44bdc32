"""Dates of a text column as seconds: ISO 8601, also with a blank for the T or a decimal comma, and times of day."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

_DATE = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d\d:?\d\d.*")
_DAY_TIME = re.compile(r"\d?\d:\d\d:\d\d([.,]\d+)?")
DAY_S = 86400.0


def looks_like_dates(cells: Sequence[str]) -> bool:
    """Whether most of the cells hold a date or a time of day."""
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(bool(_DATE.fullmatch(c) or _DAY_TIME.fullmatch(c)) for c in filled) > len(filled)


def seconds_of_dates(cells: Sequence[str]) -> np.ndarray:
    """(n,) s since 1970, or since midnight for a time of day (a later midnight is counted on); NaN without one.

    A date without a zone is read as UTC.
    """
    import pandas as pd

    plain = [c.strip().replace(",", ".") for c in cells]
    if sum(bool(_DAY_TIME.fullmatch(c)) for c in plain) > sum(bool(_DATE.fullmatch(c)) for c in plain):
        since = np.array(pd.to_timedelta(pd.Series(plain), errors="coerce").dt.total_seconds(), dtype=float)
        passed = np.cumsum(np.diff(np.nan_to_num(since), prepend=np.nan_to_num(since[:1])) < -0.5 * DAY_S)
        return since + DAY_S * passed
    found = pd.to_datetime(pd.Series(plain), errors="coerce", format="ISO8601", utc=True)
    nanoseconds = found.to_numpy("datetime64[ns]")
    return np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype("int64") * 1e-9)
