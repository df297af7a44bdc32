"""Dates of a text column as seconds: ISO 8601, and dates as spreadsheets and MATLAB write them.

Times of day, also of twelve hours, and durations such as ``0.02 sec`` or ``59:30.020`` are read, too."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..errors import UsageError

_DAY_TIME = re.compile(r"(\d?\d:\d\d:\d\d(?:[.,:]\d+)?)\s*([ap]\.?m\.?)?", re.IGNORECASE)
_ISO = re.compile(r"\d{4}([-/.]?)\d\d\1\d\d[T ]\d\d:?\d\d.*")
_LOCAL = re.compile(rf"(\d?\d)([-/. ])(\d?\d|[A-Za-z]{{3}})\2(\d{{4}})[T ,]+{_DAY_TIME.pattern}", re.IGNORECASE)
"""Two numbers, of which one is the day, or the day and a month by its name."""
_DURATION = re.compile(r"(-?\d+(?:[.,]\d+)?) ?(sec|s|ms|min|hr)")
_MINUTES = re.compile(r"(\d{1,3}):(\d\d[.,]\d+)")
"""Minutes and seconds. Without a fraction these could be hours and minutes."""
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
UNITS_S = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "hr": 3600.0}
DAY_S, HOUR_S = 86400.0, 3600.0
KINDS = (_ISO, _LOCAL, _DAY_TIME, _DURATION, _MINUTES)
ISO, DAY_FIRST, MONTH_FIRST = "iso8601", "day/month/year", "month/day/year"
DATE_UNITS = (ISO, DAY_FIRST, MONTH_FIRST)
"""Units of a time of dates in a map. By the first, the numbers have to show whether the day or the month is first."""


def looks_like_dates(cells: Sequence[str]) -> bool:
    """Whether most of the cells hold a date, a time of day or a duration."""
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(any(kind.fullmatch(c) for kind in KINDS) for c in filled) > len(filled)


def seconds_of_dates(cells: Sequence[str], unit: str = ISO) -> np.ndarray:
    """(n,) s since 1970, or since midnight for a time of day (a later midnight, or hour, is counted on); NaN without.

    A date without a zone is read as UTC. UsageError for dates of which nothing shows whether the day is first.
    """
    import pandas as pd

    plain = [c.strip().removesuffix("UTC").strip() for c in cells]
    kind = max(KINDS, key=lambda kind: sum(bool(kind.fullmatch(c)) for c in plain))
    if kind is _LOCAL:
        plain = _as_iso(plain, unit)
    elif kind is _DAY_TIME:
        plain = [_of_24_hours(m[1], m[2] or "") if (m := _DAY_TIME.fullmatch(c)) else "" for c in plain]
    plain = [c.replace(",", ".") for c in plain]
    if kind is _DURATION:
        found = [_DURATION.fullmatch(c) for c in plain]
        return np.array([float(m[1]) * UNITS_S[m[2]] if m else np.nan for m in found])
    if kind is _MINUTES:
        found = [_MINUTES.fullmatch(c) for c in plain]
        return _counted_on(np.array([60.0 * float(m[1]) + float(m[2]) if m else np.nan for m in found]), HOUR_S)
    if kind is _DAY_TIME:
        since = np.array(pd.to_timedelta(pd.Series(plain), errors="coerce").dt.total_seconds(), dtype=float)
        return _counted_on(since, DAY_S)
    plain = [re.sub(r"^(\d{4})[/.](\d\d)[/.]", r"\1-\2-", c) for c in plain]
    dates = pd.to_datetime(pd.Series(plain), errors="coerce", format="ISO8601", utc=True)
    nanoseconds = dates.to_numpy("datetime64[ns]")
    return np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype("int64") * 1e-9)


def _as_iso(cells: Sequence[str], unit: str) -> list[str]:
    """``14.03.2025 15:09:26`` or ``03/14/2025 3:09:26 PM`` in the order of ISO 8601."""
    found = [_LOCAL.fullmatch(c) for c in cells]
    there = [m for m in found if m]
    parts = [[int(m[k]) for m in there if m[k].isdigit()] for k in (1, 3)]
    day_first = unit == DAY_FIRST or (unit != MONTH_FIRST and (
        there[0][2] == "." or not parts[1] or max(parts[0]) > len(MONTHS)))
    if unit == ISO and not day_first and max(parts[1]) <= len(MONTHS):
        raise UsageError(f"{there[0][0]!r}: day or month first? write [{DAY_FIRST}] or [{MONTH_FIRST}] behind the name "
                         "of the column, or as the unit in the map")

    def one(m: re.Match[str]) -> str:
        day, month = (m[1], m[3]) if day_first else (m[3], m[1])
        number = int(month) if month.isdigit() else MONTHS.index(month.lower()) + 1 if month.lower() in MONTHS else 0
        return f"{m[4]}-{number:02}-{int(day):02} {_of_24_hours(m[5], m[6] or '')}"

    return [one(m) if m else "" for m in found]


def _of_24_hours(time: str, half: str) -> str:
    """``3:09:26:500`` and ``PM`` -> ``15:09:26.500``."""
    hour, minute, second, fraction = (*re.split(r"[:.,]", time), "00", "0")[:4]
    late = (12 if half.lower().startswith("p") else 0) - (12 if half and int(hour) == 12 else 0)
    return f"{int(hour) + late:02}:{minute}:{second}.{fraction}"


def _counted_on(since: np.ndarray, whole_s: float) -> np.ndarray:
    """(n,) s that begin again at 0 after ``whole_s``, counted on."""
    known = np.flatnonzero(np.isfinite(since))
    passed = np.zeros(len(since))
    passed[known] = np.cumsum(np.diff(since[known], prepend=since[known[:1]]) < -0.5 * whole_s)
    return since + whole_s * passed
