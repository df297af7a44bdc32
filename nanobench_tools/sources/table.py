"""A user's own table, CSV or Parquet, read through a column map (``column_map``).

A stream has the rows in which it has a value: empty cells are no samples and no fault, text is one. Cells may hold
lists; ``index`` picks an element.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..errors import InputError, UsageError, did_you_mean
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from ..units import factor
from .base import cell_faults, text_fault
from .cells import EMPTY_CELLS, GIGANTIC, BadCells, Grid, LostRow, numbers, read_grid, read_text_columns
from .column_map import ColumnMap, Entry, in_units, read_column_map
from .dates import DATE_UNITS, seconds_of_dates
from .dialect import unique_names
from .header import header_of
from .interpolation import count_changes, count_packets
from .payload import check_size
from .sheets import Sheet
from .timestamps import counted_on

PARQUET_MAGIC = b"PAR1"
_LIST_CELL = re.compile(r"\s*[\[({]?([^\[\](){}]*)[\])}]?\s*")


class TableSource:
    """Source ``table``; asked before the others when a column map is given. Raises InputError for a bad map."""

    name = "table"

    def __init__(self, columns: str | Path | ColumnMap) -> None:
        self.map = columns if isinstance(columns, ColumnMap) else read_column_map(columns)
        self.version = f"1-{self.map.digest[:16]}"

    def recognises(self, path: Path, head: bytes) -> bool:
        """A Parquet file, or a text table that has the time column and one other column of the map."""
        if head.startswith(PARQUET_MAGIC):
            return True
        names = set(unique_names(header_of(head)[0])[0])
        return self.map.time.column in names and any(e.column in names for e in self.map.entries)

    def why_not(self, head: bytes) -> str | None:
        if head.startswith(PARQUET_MAGIC) or self.map.topics:
            return None
        names = set(unique_names(header_of(head)[0])[0])
        here = [c for c in self.map.columns if c in names]
        if self.map.time.column not in names:
            return f"the time column {self.map.time.column} of {self.map.path} is not there" + (
                f", {near.strip()}" if (near := did_you_mean(self.map.time.column, names)) else "") if here else None
        return f"of the columns of {self.map.path} only the time {self.map.time.column} is there"

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        cells = cells_of(data, place, self.map)
        return flight_of(self.map, cells, path, self.name)


def cells_of(data: bytes, place: str, column_map: ColumnMap) -> Grid:
    """The columns of a map as numbers, of a text table or a Parquet file."""
    return _parquet(data, place, column_map) if data.startswith(PARQUET_MAGIC) else _text(data, place, column_map)


def flight_of(column_map: ColumnMap, cells: Grid, path: Path, source: str) -> Flight:
    """The flight of a table whose columns ``column_map`` gives. InputError where it has no time or no stream."""
    place = str(path)
    for time in column_map.times:
        if _key(time) not in cells.columns:
            raise InputError(f"{place}: column {time.column}", "is not there or holds no number",
                             f"{column_map.path} names it as time")
    readable = np.isfinite(np.sum([cells.columns[_key(time)] for time in column_map.times], axis=0))
    kept = np.flatnonzero(readable)
    if not len(kept):
        raise InputError(f"{place}: column {column_map.time.column}", "holds no time", "rows cannot be placed")
    epoch, time_s = _seconds(column_map, cells, kept)
    steps = np.diff(time_s)
    if len(steps) > 1 and 2 * np.count_nonzero(steps < 0.0) >= np.count_nonzero(steps > 0.0):
        raise InputError(f"{place}: column {column_map.time.column}", "is no time: it falls as often as it rises, or "
                         "stands still", f"{column_map.path} names it as time")
    for time in column_map.times:
        cells.bad.pop(_key(time), None)
    cells.lost += [LostRow(int(cells.lines[r]), int(r) - 1, f"no time in column {column_map.time.column}")
                   for r in np.flatnonzero(~readable)]
    streams, faults = _streams(column_map, cells, time_s, kept)
    if not streams:
        raise InputError(place, f"no column of {column_map.path} holds a number", "check the names in the map")
    end = float(time_s[-1])
    faults += cell_faults(cells, time_s, kept, {_key(e): e.stream for e in column_map.entries})
    if cells.truncated:
        faults.append(text_fault("truncated", "", (), cells.truncated, (end, end), 1.0, "rows"))
    used = set(column_map.columns)
    notes = [*cells.notes, *(f"column {c} is not in the map" for c in cells.empty if c not in used)]
    return Flight(path.name, streams,
                  {"family": None, "speed": None, "reference_speed_m_s": None, "vehicle": dict(column_map.vehicle)},
                  Provenance(place, "", source, findings=tuple(faults), notes=tuple(notes),
                             assumptions=column_map.assumptions), epoch_s=epoch)


def _seconds(column_map: ColumnMap, cells: Grid, kept: np.ndarray) -> tuple[float, np.ndarray]:
    """Time of the first row [s], and (n,) s since then: subtracted before scaling, since nanoseconds since 1970 have
    more digits than a float."""
    epoch, time_s = 0.0, np.zeros(len(kept))
    for entry in column_map.times:
        read = counted_on(cells.columns[_key(entry)][kept])
        scale = 1.0 / column_map.rate_hz if column_map.rate_hz else 1.0 if entry.unit in DATE_UNITS else factor(
                entry.unit)
        epoch += float(read[0]) * scale
        time_s += (read - read[0]) * scale
    return epoch, time_s


def _key(entry: Entry) -> str:
    """Name of an entry's numbers in the Grid: the column, with the element where there is one."""
    return entry.column if entry.index is None else f"{entry.column}[{entry.index}]"


def _streams(column_map: ColumnMap, cells: Grid, time_s: np.ndarray,
             kept: np.ndarray) -> tuple[dict[str, Stream], list[Fault]]:
    streams: dict[str, Stream] = {}
    faults: list[Fault] = []
    span = (0.0, float(time_s[-1]))
    for name in dict.fromkeys(e.stream for e in column_map.entries):
        wanted = [e for e in column_map.entries if e.stream == name]
        here = [e for e in wanted if _key(e) in cells.columns]
        if missing := tuple(_key(e) for e in wanted if e not in here):
            faults.append(
                text_fault("missing_column", name, missing,
                           f"{', '.join(missing)}: not in the file or without any value", span, float(len(missing)),
                           "columns")
            )
        if not here:
            continue
        values = np.stack([e.to_si(cells.columns[_key(e)][kept] ) for e in here], axis=1)
        filled = np.isfinite(values).any(axis=1)
        for entry in here:  # a text cell is a sample that was lost, an empty one is none
            if (bad := cells.bad.get(_key(entry))) is not None:
                filled |= np.isin(kept, bad.rows)
        if not filled.any():
            continue
        stamps, values = (time_s, values) if filled.all() else (time_s[filled], values[filled])
        packets, changes = count_packets(stamps, values), count_changes(values)
        count = min(packets.count, changes if changes is not None else len(values))
        duration = packets.last_s - float(stamps[0])
        made = make_stream(name, stamps, values, tuple(e.quantity for e in here), [_key(e) for e in here],
                           samples=count, rate_hz=count / duration if duration > 0.0 else float("nan"))
        streams[name] = column_map.turned(name, in_units(made, here))
    return streams, faults


def _text(data: bytes, place: str, column_map: ColumnMap) -> Grid:
    if all(e.index is None and e.unit not in DATE_UNITS for e in (*column_map.times, *column_map.entries)):
        grid = read_grid(data, place, numeric=set(column_map.columns), time=column_map.time.column)
        for name, bad in list(grid.bad.items()):
            _set_bad(grid, name, bad)
        return grid
    cells, text, dialect = read_text_columns(data, place, column_map.columns)
    grid = Grid({}, text.lines, text.rows_in_file, lost=text.lost, truncated=text.truncated)
    for entry in (*column_map.times, *column_map.entries):
        if entry.column in cells and entry.unit in DATE_UNITS:
            grid.columns[_key(entry)] = _dates(entry, cells[entry.column], place)
        elif entry.column in cells:
            _add(grid, entry, [_element(c, entry.index) for c in cells[entry.column]], dialect.decimal)
    return grid


def _dates(entry: Entry, cells: Sequence[str], place: str) -> np.ndarray:
    try:
        return seconds_of_dates(cells, entry.unit)
    except UsageError as error:
        raise InputError(f"{place}: column {entry.column}", *str(error).split("? ", 1)) from None


def _set_bad(grid: Grid, name: str, bad: BadCells | None) -> None:
    """Empty cells of a user's table are no samples and no fault: only the others are listed."""
    grid.bad.pop(name, None)
    if bad is not None and not bad.empty.all():
        grid.bad[name] = BadCells(bad.rows[~bad.empty], bad.empty[~bad.empty], bad.what)


def _element(cell: str, index: int | None) -> str:
    """Element ``index`` of a list written in a cell; the text itself when there is no list in it."""
    if index is None or cell in EMPTY_CELLS:
        return cell
    match = _LIST_CELL.fullmatch(cell)
    parts = re.split(r"[,;\s]+", match[1].strip()) if match else []
    return parts[index] if index < len(parts) else f"{cell} has no element {index}"


def _add(grid: Grid, entry: Entry, cells: list[str], decimal: str) -> None:
    name = _key(entry)
    values, bad = numbers(cells, decimal, GIGANTIC if entry.stream else np.inf)
    if bad is not None and bad.empty.all() and len(bad.rows) == len(cells):
        grid.empty.append(name)
        return
    grid.columns[name] = values
    _set_bad(grid, name, bad)


def _parquet(data: bytes, place: str, column_map: ColumnMap) -> Grid:
    try:
        with pq.ParquetFile(pa.BufferReader(data)) as file:
            names = set(file.schema_arrow.names)
            check_size(place, file.metadata.num_rows * len(names.intersection(column_map.columns)), data)
            table = file.read(columns=[c for c in column_map.columns if c in names])
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(place, f"cannot be read as Parquet ({str(error).splitlines()[0][:80]})",
                         "take another copy") from None
    if not table.num_rows:
        raise InputError(place, "a table without rows", "the recording is empty")
    grid = Grid({}, np.arange(1, table.num_rows + 1), table.num_rows)
    for entry in (*column_map.times, *column_map.entries):
        if entry.column in table.column_names:
            _add_arrow(grid, entry, table.column(entry.column).combine_chunks(), place)
    return grid


def _add_arrow(grid: Grid, entry: Entry, column: pa.Array, place: str) -> None:
    kind, key = column.type, _key(entry)
    where = f"{place}: column {entry.column}"
    if entry.unit in DATE_UNITS and not pa.types.is_timestamp(kind):
        grid.columns[key] = _dates(entry, [str(c or "") for c in column.to_pylist()], place)
        return
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        _add(grid, entry, [_element((c or "").strip(), entry.index) for c in column.to_pylist()], ".")
        return
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        if entry.index is None:
            raise InputError(where, "its cells hold lists", f"give an index in {key!r} of the map")
        lengths = pc.fill_null(pc.list_value_length(column), 0).to_numpy(zero_copy_only=False)
        short = np.flatnonzero((lengths <= entry.index) & column.is_valid().to_numpy(zero_copy_only=False))
        if len(short) == len(column):
            raise InputError(where, f"no cell has an element {entry.index}", "check the index in the map")
        if len(short):
            grid.bad[key] = BadCells(
                short,
                np.zeros(len(short), dtype=bool),
                {int(i): f"a list of {int(lengths[i])} without element {entry.index}" for i in short[:5]},
            )
        long_enough = pc.if_else(pa.array(lengths > entry.index), column, pa.scalar(None, kind))
        column = pc.list_element(pc.drop_null(long_enough), entry.index)
        values = np.full(len(lengths), np.nan)
        values[np.flatnonzero(lengths > entry.index)] = _as_float(column, where)
    else:
        if entry.index is not None:
            raise InputError(where, "its cells hold single values", "leave the index out of the map")
        values = _as_float(column, where)
    wrong = np.flatnonzero(np.abs(values) >= GIGANTIC) if entry.stream else np.array([], dtype=int)
    if len(wrong):
        before = grid.bad.get(key, BadCells(np.array([], dtype=int), np.array([], dtype=bool)))
        what = {int(i): f"a value beyond any measurement ({values[i]:g})" for i in wrong[:5]}
        values[wrong] = np.nan
        rows = np.union1d(before.rows, wrong)
        grid.bad[key] = BadCells(rows, np.zeros(len(rows), dtype=bool), {**before.what, **what})
    if np.isnan(values).all():
        grid.empty.append(key)
    else:
        grid.columns[key] = values


def _as_float(column: pa.Array, where: str) -> np.ndarray:
    kind = column.type
    if pa.types.is_timestamp(kind):
        column = column.cast(pa.timestamp("ns", tz=kind.tz)).cast(pa.int64())
        seconds = pc.divide(column.cast(pa.float64(), safe=False), 1e9)
        return np.asarray(seconds.to_numpy(zero_copy_only=False).astype(float))
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
        raise InputError(where, f"holds {kind}", "numbers are needed")
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False).astype(float))
