"""Text tables to numbers: a fast path through pyarrow, and an exact one, cell by cell, for files that are broken.

Both return the same Grid. A cell that holds no number is NaN and listed; a row whose cells cannot be told apart
is left out and listed; nothing is guessed.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..errors import InputError

GIGANTIC = 1e12
"""Larger magnitudes are not measurements of anything here; such a cell is listed and NaN."""

EMPTY_CELLS = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)


@dataclass
class BadCells:
    """Cells of one column without a number: ``rows`` (m,) indices into the Grid; ``empty`` (m,) bool: nothing stands
    there at all; ``what`` describes the first few by row."""

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
    rows too; ``empty`` are columns without any cell filled, ``text`` columns that hold text, ``repeated`` names that
    came twice (the first is kept); ``decimals`` the digits printed behind the point per column (the last line's)."""

    columns: dict[str, np.ndarray]
    lines: np.ndarray
    rows_in_file: int
    bad: dict[str, BadCells] = field(default_factory=dict)
    lost: list[LostRow] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    repeated: list[str] = field(default_factory=list)
    decimals: dict[str, int] = field(default_factory=dict)
    truncated: str = ""
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Dialect:
    delimiter: str | None
    """None: any run of blanks."""
    decimal: str = "."


def normalise_text(data: bytes) -> bytes:
    """UTF-8 bytes without byte order mark, lines ended by a line feed."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", errors="replace").encode()
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n")
        if b"\n" not in data:
            data = data.replace(b"\r", b"\n")
    return data


def clean_name(name: str) -> str:
    return name.strip().strip("\"'").strip().lstrip("#").strip()


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Cells of one line, stripped. Quotes never reach beyond a line: noise must not swallow the rows after it."""
    if delimiter is None:
        return line.split()
    if '"' in line and "\r" not in line:
        with contextlib.suppress(csv.Error):
            return [c.strip() for c in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    return [c.strip() for c in line.split(delimiter)]


def header_of(head: bytes) -> tuple[list[str], Dialect]:
    """Column names of the first line that is not empty, and the delimiter that gives the most of them."""
    text = normalise_text(head).lstrip(b"\n \t").split(b"\n", 1)[0].decode("utf-8", errors="replace").rstrip("\r")
    best: tuple[list[str], Dialect] = ([clean_name(text)] if text.strip() else [], Dialect(","))
    for delimiter in (",", ";", "\t", "|", None):
        names = [clean_name(c) for c in split_line(text, delimiter)]
        if len(names) > len(best[0]):
            best = names, Dialect(delimiter)
    return best


def read_grid(data: bytes, place: str, numeric: Collection[str] = (), time: str | None = None) -> Grid:
    """Parse a delimited text table with a header line.

    ``numeric`` are names that must hold numbers; other columns may hold text and are then only listed. The column
    ``time`` may hold gigantic numbers (stamps in nanoseconds). Raises InputError at ``place`` when there is no
    header, no row, or no line that fits the header.
    """
    body, columns, repeated, dialect = _open(data, place)
    grid = _fast(body, columns, dialect, set(numeric), time)
    if grid is None:
        grid = _exact(_split_rows(body, columns, dialect, place), columns, dialect, set(numeric), time)
        grid.decimals = _decimals_of(body.rstrip(b"\n").rpartition(b"\n")[2], columns, dialect)
    grid.repeated = repeated
    for name in [n for n in grid.columns if "\x00" in n]:
        del grid.columns[name]
        grid.bad.pop(name, None)
    grid.empty = [n for n in grid.empty if "\x00" not in n]
    grid.text = [n for n in grid.text if "\x00" not in n]
    grid.notes += _dialect_notes(dialect)
    return grid


@dataclass(frozen=True)
class TextRows:
    """Cells of a table as text, row by row: ``lines`` (n,) of the file, the rest as in Grid."""

    rows: list[list[str]]
    lines: np.ndarray
    rows_in_file: int
    lost: list[LostRow]
    truncated: str


def read_text_columns(data: bytes, place: str, wanted: Collection[str]) -> tuple[dict[str, list[str]], TextRows, Dialect]:
    """The cells of some columns as text (for cells that hold lists). Raises InputError as ``read_grid`` does."""
    body, columns, _, dialect = _open(data, place)
    text = _split_rows(body, columns, dialect, place)
    return {n: [row[i] for row in text.rows] for i, n in enumerate(columns) if n in wanted}, text, dialect


def _open(data: bytes, place: str) -> tuple[bytes, list[str], list[str], Dialect]:
    """Body, unique column names, repeated names and dialect of a table."""
    data = normalise_text(data).lstrip(b"\n")
    names, dialect = header_of(data[:1 << 16])
    if len(names) < 2:
        raise InputError(place, "no header line with column names" if data.strip() else "the file is empty",
                         "give a table with a header")
    first_end = data.find(b"\n")
    body = data[first_end + 1:] if first_end >= 0 else b""
    if not body.strip():
        raise InputError(place, "there is a header but no row", "the recording is empty")
    columns, repeated = _unique(names)
    return body, columns, repeated, _with_decimal(dialect, body)


def _dialect_notes(dialect: Dialect) -> list[str]:
    if dialect.delimiter == ",":
        return []
    shown = {None: "blanks", "\t": "tab"}.get(dialect.delimiter, repr(dialect.delimiter))
    return [f"cells are separated by {shown}" + (", decimal comma" if dialect.decimal == "," else "")]


def _unique(names: list[str]) -> tuple[list[str], list[str]]:
    """Names made unique; a repeated name gets a NUL and a number, so that no real column can be called the same."""
    seen: dict[str, int] = {}
    unique, repeated = [], []
    for i, name in enumerate(names):
        name = name or f"unnamed {i + 1}"
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            repeated.append(name)
            name = f"{name}\x00{seen[name]}"
        unique.append(name)
    return unique, sorted(set(repeated))


def _with_decimal(dialect: Dialect, body: bytes) -> Dialect:
    """Decimal comma: the first rows hold numbers with a comma and none with a point."""
    if dialect.delimiter == ",":
        return dialect
    sample = body[:1 << 14].decode("utf-8", errors="replace").split("\n")[:20]
    cells = [c for line in sample for c in split_line(line.rstrip("\r"), dialect.delimiter)]
    commas = sum(bool(_COMMA_NUMBER.fullmatch(c)) for c in cells)
    points = sum("." in c and bool(_NUMBER.fullmatch(c)) for c in cells)
    return Dialect(dialect.delimiter, ",") if commas and not points else dialect


def _decimals_of(line: bytes, columns: list[str], dialect: Dialect) -> dict[str, int]:
    cells = split_line(line.decode("utf-8", errors="replace").rstrip("\r"), dialect.delimiter)
    if len(cells) != len(columns):
        return {}
    return {n: len(c.rpartition(dialect.decimal)[2]) for n, c in zip(columns, cells, strict=True)
            if dialect.decimal in c and "e" not in c.lower()}


def _cut_last_line(body: bytes, columns: list[str], dialect: Dialect) -> tuple[bytes, str]:
    """A last line without line end may be cut inside a number; keep it only when it is as long as the one before."""
    if body.endswith(b"\n"):
        return body, ""
    start = body.rfind(b"\n") + 1
    last = body[start:]
    if not last.strip():
        return body[:start], ""
    cells = split_line(last.decode("utf-8", errors="replace"), dialect.delimiter)
    if len(cells) >= len(columns):
        earlier = {_decimals_of(line, columns, dialect).get(columns[-1], 0)
                   for line in body[max(start - 8192, 0):start].split(b"\n")[-21:-1]}
        fixed_format = len(earlier) == 1  # else the lengths vary anyway, and a short one proves nothing
        if not fixed_format or _decimals_of(last, columns, dialect).get(columns[-1], 0) >= max(earlier):
            return body, ""
        return body[:start], "the last line is cut off: its last cell is shorter than in the lines before"
    return body[:start], f"the last line is cut off: {len(cells)} of {len(columns)} cells"


def _fast(body: bytes, columns: list[str], dialect: Dialect, numeric: set[str],
          time: str | None) -> Grid | None:
    """pyarrow; None when the file is not clean enough for it."""
    if b'"' in body or b"\x00" in body or b"\r" in body or dialect.delimiter is None:
        return None
    body, truncated = _cut_last_line(body, columns, dialect)
    if not body.strip():
        return None
    try:
        table = pacsv.read_csv(
            pa.BufferReader(body),
            read_options=pacsv.ReadOptions(column_names=columns, use_threads=False, block_size=len(body) + 1),
            parse_options=pacsv.ParseOptions(delimiter=dialect.delimiter, quote_char=False),
            convert_options=pacsv.ConvertOptions(
                column_types={c: pa.float64() for c in columns if c in numeric}, decimal_point=dialect.decimal,
                null_values=list(EMPTY_CELLS), auto_dict_encode=False, timestamp_parsers=[]))
    except pa.ArrowInvalid:
        return None
    rows = table.num_rows
    if body.count(b"\n") + (not body.endswith(b"\n")) != rows:
        return None  # blank lines: let the exact path keep the line numbers
    lines = np.arange(2, rows + 2)
    grid = Grid({}, lines, rows + bool(truncated), truncated=truncated)
    for name in columns:
        column = table.column(name).combine_chunks()
        kind = column.type
        if column.null_count == rows:
            grid.empty.append(name)
            continue
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            return None  # text somewhere in a column: the exact path tells a bad cell from a column of text
        _note_unreadable(grid, name, column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), column,
                         np.inf if name == time else GIGANTIC)
    grid.decimals = _decimals_of(body.rstrip(b"\n").rpartition(b"\n")[2], columns, dialect)
    return grid


def _note_unreadable(grid: Grid, name: str, values: np.ndarray, column: pa.Array, limit: float) -> None:
    """Store a column of the fast path; nulls, infinities and gigantic values become NaN and are listed."""
    wrong = ~(np.abs(values) < limit)
    if wrong.any():
        rows = np.flatnonzero(wrong)
        empty = np.isnan(values[rows])
        what = {int(r): describe_cell("" if e else repr(float(values[r])))
                for r, e in zip(rows[:5], empty[:5], strict=True)}
        values = np.where(wrong, np.nan, values)
        grid.bad[name] = BadCells(rows, empty, what)
    grid.columns[name] = values


def describe_cell(cell: str) -> str:
    """What stands where a number belongs, printable and short."""
    if cell.strip() in EMPTY_CELLS:
        return "an empty cell" if not cell.strip() else f"no number ({cell.strip()})"
    shown = "".join(c if c.isprintable() else "?" for c in cell[:20]) + ("..." if len(cell) > 20 else "")
    if _NUMBER.fullmatch(cell.strip()) or cell.strip().lstrip("+-").lower() in ("inf", "infinity"):
        return f"a value beyond any measurement ({shown})"
    return f"text '{shown}' where a number belongs"


def parse_number(cell: str, decimal: str = ".", limit: float = GIGANTIC) -> float:
    """The number in a cell, or NaN. Stricter than float(): no underscores, no digits of other scripts."""
    if decimal == ",":
        if "." in cell:
            return float("nan")
        cell = cell.replace(",", ".", 1)
    if not _NUMBER.fullmatch(cell):
        return float("nan")
    value = float(cell)
    return value if abs(value) < limit else float("nan")


def numbers(cells: Sequence[str], decimal: str = ".", limit: float = GIGANTIC) -> tuple[np.ndarray, BadCells | None]:
    """(n,) numbers of a column of text, NaN where there is none, and the list of those cells."""
    values = np.array([parse_number(c, decimal, limit) for c in cells])
    wrong = np.flatnonzero(np.isnan(values))
    if not len(wrong):
        return values, None
    empty = np.array([cells[i] in EMPTY_CELLS for i in wrong])
    return values, BadCells(wrong, empty, {int(i): describe_cell(cells[i]) for i in wrong[:5]})


def _split_rows(body: bytes, columns: list[str], dialect: Dialect, place: str) -> TextRows:
    """Line by line; a line whose number of cells is not that of the header is left out and listed."""
    body, truncated = _cut_last_line(body, columns, dialect)
    rows: list[list[str]] = []
    lines: list[int] = []
    lost: list[LostRow] = []
    widths: dict[int, int] = {}
    for number, raw in enumerate(body.split(b"\n"), start=2):
        text = raw.decode("utf-8", errors="replace").rstrip("\r")
        if not text.strip():
            continue
        cells = split_line(text, dialect.delimiter)
        if len(cells) != len(columns):
            widths[len(cells)] = widths.get(len(cells), 0) + 1
            lost.append(LostRow(number, len(rows) - 1, f"{len(cells)} cells where the header has {len(columns)}"))
            continue
        rows.append(cells)
        lines.append(number)
    if not rows:
        common = max(widths, key=widths.__getitem__, default=0)
        raise InputError(place, f"no row fits the header: {common} cells in a row, {len(columns)} names in the header"
                         if widths else truncated or "there is a header but no row",
                         "a decimal comma needs another delimiter" if common > len(columns) else "check the delimiter")
    return TextRows(rows, np.array(lines), len(rows) + len(lost) + bool(truncated), lost, truncated)


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
