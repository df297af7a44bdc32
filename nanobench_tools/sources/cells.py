"""Text tables to numbers: a fast path through pyarrow, and an exact one, cell by cell, for files that are broken.

Both return the same Grid. A cell that holds no number is NaN and listed; a row whose cells cannot be distinguished
is left out and listed; nothing is guessed.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..errors import InputError
from .dialect import NUMBER, Dialect, clean_name, cut_last_line, decimals_of, dialect_notes, split_line
from .header import Opened, open_table
from .names import listed

GIGANTIC = 1e12
"""Larger magnitudes are not measurements of anything here; such a cell is listed and NaN."""

EMPTY_CELLS = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None", "none", "n/a", "#N/A", "<NA>",
               "-", "--", "---")


_UNIT = re.compile(r"\s*[\[(][^\[\]()]*[\])]$")


@dataclass
class BadCells:
    """Cells of one column without a number: ``rows`` (m,) indices into the Grid; ``empty`` (m,) bool: cells without
    text; ``what`` describes the first few by row."""

    rows: np.ndarray
    empty: np.ndarray
    what: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class LostRow:
    """A line that was left out: ``line`` counted from 1, ``after`` the Grid row before it (-1: none), why."""

    line: int
    after: int
    reason: str


@dataclass
class Grid:
    """Columns of numbers. ``lines`` (n,) is the line of the file each row came from; ``rows_in_file`` counts lost
    rows too; ``empty`` are columns without any cell filled, ``text`` columns that hold text. ``repeated`` are names
    that came twice (the first is kept); ``decimals`` the digits printed behind the point per column (the last line's);
    ``units`` those of a row of units."""

    columns: dict[str, np.ndarray]
    lines: np.ndarray
    rows_in_file: int
    bad: dict[str, BadCells] = field(default_factory=dict)
    lost: list[LostRow] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    repeated: list[str] = field(default_factory=list)
    decimals: dict[str, int] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    truncated: str = ""
    notes: list[str] = field(default_factory=list)


def read_grid(data: bytes, place: str, numeric: Collection[str] = (), time: str | None = None) -> Grid:
    """Parse a delimited text table with a header line.

    ``numeric`` are names that must hold numbers; other columns may hold text and are then only listed. The column
    ``time`` may hold gigantic numbers (timestamps in nanoseconds). Raises InputError at ``place`` when there is no
    header, no row, or no line that fits the header.
    """
    table = open_table(data, place)
    grid = _fast(table, set(numeric), time)
    if grid is None:
        grid = _exact(_split_rows(table, place), table.columns, table.dialect, set(numeric), time)
        last = table.body[-(1 << 16) :].rstrip(b"\n").rpartition(b"\n")[2]
        grid.decimals = decimals_of(last, table.columns, table.dialect)
    grid.repeated, grid.units = table.repeated, table.units
    for name in [n for n in grid.columns if "\x00" in n]:
        del grid.columns[name]
        grid.bad.pop(name, None)
    grid.empty = [n for n in grid.empty if "\x00" not in n]
    grid.text = [n for n in grid.text if "\x00" not in n]
    grid.notes += dialect_notes(table.dialect)
    return grid


@dataclass(frozen=True)
class TextRows:
    """Cells of a table as text, row by row: ``lines`` (n,) of the file, the rest as in Grid."""

    rows: list[list[str]]
    lines: np.ndarray
    rows_in_file: int
    lost: list[LostRow]
    truncated: str


def read_text_columns(data: bytes, place: str,
                      wanted: Collection[str]) -> tuple[dict[str, list[str]], TextRows, Dialect]:
    """The cells of some columns as text (for cells that hold lists). Raises InputError as ``read_grid`` does."""
    table = open_table(data, place)
    text = _split_rows(table, place)
    cells = {n: [row[i] for row in text.rows] for i, n in enumerate(table.columns) if n in wanted}
    return cells, text, table.dialect


def _fast(opened: Opened, numeric: set[str], time: str | None) -> Grid | None:
    """pyarrow; None when the file is not clean enough for it."""
    body, columns, dialect = opened.body, opened.columns, opened.dialect
    if b'"' in body or b"\x00" in body or b"\r" in body or dialect.delimiter is None:
        return None
    body, truncated = cut_last_line(body, columns, dialect)
    if not body.strip():
        return None
    try:
        table = pacsv.read_csv(
            pa.BufferReader(body),
            read_options=pacsv.ReadOptions(column_names=columns, use_threads=False, block_size=len(body) + 1),
            parse_options=pacsv.ParseOptions(delimiter=dialect.delimiter, quote_char=False),
            convert_options=pacsv.ConvertOptions(column_types={c: pa.float64() for c in columns if c in numeric},
                                                 decimal_point=dialect.decimal, null_values=list(EMPTY_CELLS),
                                                 auto_dict_encode=False, timestamp_parsers=[]),
        )
    except pa.ArrowInvalid:
        return None
    rows = table.num_rows
    if body.count(b"\n") + (not body.endswith(b"\n")) != rows:
        return None  # blank lines: let the exact path keep the line numbers
    lines = np.arange(rows) + opened.first_line
    grid = Grid({}, lines, rows + bool(truncated), truncated=truncated)
    for name in columns:
        column = table.column(name).combine_chunks()
        kind = column.type
        if column.null_count == rows:
            grid.empty.append(name)
            continue
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            return None  # text somewhere in a column: the exact path separates a bad cell from a column of text
        _note_unreadable(grid, name, column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), column,
                         np.inf if name == time else GIGANTIC)
    grid.decimals = decimals_of(body[-(1 << 16) :].rstrip(b"\n").rpartition(b"\n")[2], columns, dialect)
    return grid


def _note_unreadable(grid: Grid, name: str, values: np.ndarray, column: pa.Array, limit: float) -> None:
    """Store a column of the fast path; nulls, infinities and gigantic values become NaN and are listed."""
    wrong = ~(np.abs(values) < limit)
    if wrong.any():
        rows = np.flatnonzero(wrong)
        empty = np.isnan(values[rows])
        what = {
            int(r): describe_cell("" if e else repr(float(values[r]))) for r, e in zip(rows[:5], empty[:5], strict=True)
        }
        values = np.where(wrong, np.nan, values)
        grid.bad[name] = BadCells(rows, empty, what)
    grid.columns[name] = values


def describe_cell(cell: str) -> str:
    """The text of a cell that should be a number, printable and short."""
    if cell.strip() in EMPTY_CELLS:
        return "an empty cell" if not cell.strip() else f"no number ({cell.strip()})"
    shown = "".join(c if c.isprintable() else "?" for c in cell[:20]) + ("..." if len(cell) > 20 else "")
    if NUMBER.fullmatch(cell.strip()) or cell.strip().lstrip("+-").lower() in ("inf", "infinity"):
        return f"a value beyond any measurement ({shown})"
    return f"text '{shown}' where a number belongs"


def parse_number(cell: str, decimal: str = ".", limit: float = GIGANTIC) -> float:
    """The number in a cell, or NaN. Stricter than float(): no underscores, no digits of other scripts."""
    if decimal == ",":
        if "." in cell:
            return float("nan")
        cell = cell.replace(",", ".", 1)
    if not NUMBER.fullmatch(cell):
        return float("nan")
    value = float(cell)
    return value if abs(value) < limit else float("nan")


def numbers(cells: Sequence[str], decimal: str = ".", limit: float = GIGANTIC) -> tuple[np.ndarray, BadCells | None]:
    """(n,) numbers of a column of text, NaN elsewhere, and the list of the other cells."""
    values = np.array([parse_number(c, decimal, limit) for c in cells])
    wrong = np.flatnonzero(np.isnan(values)).tolist()
    if not wrong:
        return values, None
    empty = np.array([cells[i] in EMPTY_CELLS for i in wrong])
    return values, BadCells(np.array(wrong), empty, {i: describe_cell(cells[i]) for i in wrong[:5]})


def _split_rows(opened: Opened, place: str) -> TextRows:
    """Line by line; a line whose number of cells is not that of the header is left out and listed."""
    columns, dialect = opened.columns, opened.dialect
    body, truncated = cut_last_line(opened.body, columns, dialect)
    rows: list[list[str]] = []
    lines: list[int] = []
    lost: list[LostRow] = []
    widths: dict[int, int] = {}
    for number, raw in enumerate(body.split(b"\n"), start=opened.first_line):
        text = raw.decode("utf-8", errors="replace").rstrip("\r")
        if not text.strip():
            continue
        cells = split_line(text, dialect.delimiter)
        if len(cells) != len(columns):
            widths[len(cells)] = widths.get(len(cells), 0) + 1
            lost.append(LostRow(number, len(rows) - 1, f"{len(cells)} cells where the header has {len(columns)}"))
            continue
        if rows and _are_other_names(cells, columns):
            raise InputError(f"{place}: line {number}", f"another line of names ({listed(cells)}): the columns change "
                             "there", "write the rows below it to a separate file")
        rows.append(cells)
        lines.append(number)
    if not rows:
        common = max(widths, key=widths.__getitem__, default=0)
        raise InputError(place,
                         f"no row fits the header: {common} cells in a row, {len(columns)} names in the header"
                         if widths
                         else truncated or "there is a header but no row",
                         "a decimal comma needs another delimiter" if common > len(columns) else "check the delimiter")
    return TextRows(rows, np.array(lines), len(rows) + len(lost) + bool(truncated), lost, truncated)


def _are_other_names(cells: Sequence[str], columns: Sequence[str]) -> bool:
    """Whether a line below the first row has names, and others than the header, or in another order or unit."""
    if NUMBER.fullmatch(cells[0]):
        return False
    names, header = [clean_name(c) for c in cells], [c.partition("\x00")[0] for c in columns]
    plain = {_UNIT.sub("", c) for c in header}
    return names != header and 2 * sum(_UNIT.sub("", n) in plain for n in names) > len(names)


def _exact(text: TextRows, columns: list[str], dialect: Dialect, numeric: set[str], time: str | None) -> Grid:
    """Cell by cell."""
    grid = Grid({}, text.lines, text.rows_in_file, lost=text.lost, truncated=text.truncated)
    for name, cells in zip(columns, zip(*text.rows, strict=True), strict=True):
        values, bad = numbers(cells, dialect.decimal, np.inf if name == time else GIGANTIC)
        if bad is not None and bad.empty.sum() == len(cells):
            grid.empty.append(name)
        elif bad is not None and name not in numeric and 2 * (~bad.empty).sum() > len(cells):
            grid.text.append(name)
        else:
            grid.columns[name] = values
            if bad is not None:
                grid.bad[name] = bad
    return grid
