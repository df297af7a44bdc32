"""Streams as pandas DataFrames and back. pandas is imported at the first use.

A frame has seconds as its index and one column per quantity under its unit. The columns are a MultiIndex (quantity,
unit), and ``attrs["units"]`` has the same as a dictionary. ``frame["px"]`` takes a quantity without naming its unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .. import so3
from ..errors import InputError, UsageError
from ..units import to_si

if TYPE_CHECKING:
    import pandas as pd

INDEX = "time_s"
MOST_ROWS = 20_000_000
"""Of one grid: gigabytes."""
ANGLES = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")


class Sampled(Protocol):
    """A stream: time_s (n,), values (n, k), quantities and unit (k)."""

    @property
    def time_s(self) -> np.ndarray: ...
    @property
    def values(self) -> np.ndarray: ...
    @property
    def quantities(self) -> tuple[str, ...]: ...
    @property
    def unit(self) -> tuple[str, ...]: ...


def frame_of(time_s: np.ndarray, values: np.ndarray, names: Sequence[str], units: Sequence[str],
             attributes: Mapping[str, Any] | None = None) -> pd.DataFrame:
    """time_s (n,), values (n, k) and the k names and units as a frame. attributes: more for ``attrs``."""
    import pandas as pd

    columns = pd.MultiIndex.from_arrays([list(names), list(units)], names=["quantity", "unit"])
    frame = pd.DataFrame(values, index=pd.Index(time_s, name=INDEX), columns=columns)
    frame.attrs.update({"units": dict(zip(names, units, strict=True)), **(attributes or {})})
    return frame


def arrays_of(stream: str, frame: pd.DataFrame, known: Mapping[str, tuple[str, str]],
              units: Mapping[str, str] | None = None) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """(time_s (n,), values (n, k) in SI, quantities) of a frame whose columns are quantities of ``known``.

    The index is seconds, a timedelta, or a date. Units {quantity: unit} override those of the columns' second level
    and of ``frame.attrs["units"]``. Without any, a column is SI. Raises InputError with the wrong column or row.
    Reasons: an index that is not a time, or does not rise; values that are not numbers; an unknown quantity or unit.
    """
    import pandas as pd

    place = f"DataFrame of {stream}"
    if not isinstance(frame, pd.DataFrame):
        raise InputError(place, f"is a {type(frame).__name__}", "give a pandas DataFrame")
    names = [str(c[0] if isinstance(c, tuple) else c) for c in frame.columns]
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise InputError(place, f"has two columns {twice!r}", "keep one of them")
    said = {**{n: str(c[1]) for n, c in zip(names, frame.columns, strict=True) if isinstance(c, tuple) and len(c) > 1},
            **{str(k): str(v) for k, v in dict(frame.attrs.get("units", {})).items()}, **(units or {})}
    strange = [n for n in said if n not in names and units and n in units]
    if strange:
        raise InputError(place, f"units name {strange[0]!r}, which is no column of it", f"it has {', '.join(names)}")
    for name in names:
        if name not in known:
            import difflib

            near = difflib.get_close_matches(name, known, n=1)
            raise InputError(place, f"column {name!r} is no quantity of {stream}",
                             f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}")
    values = np.empty(frame.shape)
    for k, name in enumerate(names):
        column = frame.iloc[:, k]
        try:
            values[:, k] = pd.to_numeric(column).to_numpy(float)
        except (ValueError, TypeError):
            read = pd.to_numeric(column, errors="coerce")
            bad = int(np.flatnonzero((read.isna() & column.notna()).to_numpy())[0])
            raise InputError(place, f"column {name!r}, row {bad + 1}: {column.iloc[bad]!r} is no number",
                             "make the column numeric (pandas.to_numeric)") from None
        unit = said.get(name, known[name][0])
        try:
            values[:, k] = to_si(values[:, k], unit)
        except UsageError as error:
            raise InputError(place, f"column {name!r}: {error}") from None
    return seconds_of(place, frame.index), values, tuple(names)


def seconds_of(place: str, index: pd.Index) -> np.ndarray:
    """(n,) s of an index: seconds as numbers, timedeltas, or dates (seconds of the epoch, UTC)."""
    import pandas as pd

    if isinstance(index, pd.DatetimeIndex):
        utc = index.tz_localize("UTC") if index.tz is None else index.tz_convert("UTC")
        time_s = np.asarray((utc - pd.Timestamp(0, tz="UTC")).total_seconds(), float)
    elif isinstance(index, pd.TimedeltaIndex):
        time_s = np.asarray(index.total_seconds(), float)
    elif isinstance(index, pd.RangeIndex) and index.name is None:
        raise InputError(place, "its index counts rows", f"set the index to seconds: frame.set_index({INDEX!r})")
    else:
        try:
            time_s = np.asarray(index, float)
        except (ValueError, TypeError):
            raise InputError(place, f"its index holds {index[0]!r}", "set the index to seconds, or to dates") from None
    if not np.isfinite(time_s).all():
        raise InputError(place, f"row {int(np.flatnonzero(~np.isfinite(time_s))[0]) + 1}: its time is no number",
                         "drop the row")
    return time_s


def one_grid(flight: str, streams: Mapping[str, Sampled], rate_hz: float) -> pd.DataFrame:
    """All ``streams`` on one grid, see ``Flight.to_pandas``."""
    if not np.isfinite(rate_hz) or rate_hz <= 0.0:
        raise UsageError(f"rate_hz is {rate_hz!r}; give rows per second, such as 100")
    rows = {name: rising(stream.time_s) for name, stream in streams.items()}
    times = {name: streams[name].time_s[keep] for name, keep in rows.items() if keep.sum() > 1}
    if not times:
        raise InputError(flight, "no stream has two rows whose timestamps rise")
    first, last = min(t[0] for t in times.values()), max(t[-1] for t in times.values())
    if (last - first) * rate_hz > MOST_ROWS:
        raise UsageError(f"{last - first:.0f} s at {rate_hz:g} Hz are more than {MOST_ROWS} rows; take a lower rate_hz")
    grid = first + np.arange(int(np.floor((last - first) * rate_hz + 1e-9)) + 1) / rate_hz
    columns: dict[tuple[str, str], np.ndarray] = {}
    for name, time_s in times.items():
        stream = streams[name]
        values = interpolated(time_s, stream.values[rows[name]], stream.quantities, grid)
        values[(grid < time_s[0] - 1e-9) | (grid > time_s[-1] + 1e-9)] = np.nan
        columns |= {(f"{name}.{q}", unit): values[:, k]
                    for k, (q, unit) in enumerate(zip(stream.quantities, stream.unit, strict=True))}
        after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
        nearest = np.minimum(np.abs(grid - time_s[after - 1]), np.abs(grid - time_s[after]))
        columns[f"{name}.interpolated", "1"] = (nearest > 0.5 / rate_hz + 1e-9).astype(float)
    names, units = zip(*columns, strict=True)
    return frame_of(grid, np.column_stack(list(columns.values())), names, units, {"flight": flight, "rate_hz": rate_hz})


def rising(time_s: np.ndarray) -> np.ndarray:
    """(n,) bool: timestamps that are finite and later than every one before."""
    time_s = np.where(np.isfinite(time_s), time_s, -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(time_s)[:-1]])
    return np.asarray(time_s > before)


def interpolated(time_s: np.ndarray, values: np.ndarray, quantities: Sequence[str], at_s: np.ndarray) -> np.ndarray:
    """(m, k) values at ``at_s``: quaternions by slerp, angles the shorter way, everything else by straight lines."""
    found = np.column_stack([np.interp(at_s, time_s, column) for column in values.T])
    for k, quantity in enumerate(quantities):
        if quantity in ANGLES:
            found[:, k] = so3.wrap_angle(np.interp(at_s, time_s, np.unwrap(values[:, k])))
    if all(q in quantities for q in QUATERNION):
        at = [list(quantities).index(q) for q in QUATERNION]
        turned = values[:, at]
        good = np.isfinite(turned).all(axis=1) & (np.linalg.norm(turned, axis=1) > 0.5)
        if good.sum() > 1:
            found[:, at] = so3.interpolate(time_s[good], turned[good], at_s)
    return found
