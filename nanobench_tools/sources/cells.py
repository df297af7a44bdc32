"""Text tables to numbers: a fast path through pyarrow, and an exact one, cell by cell, for files that are broken.

Both return the same Grid. A cell that holds no number is NaN and listed; a row whose cells cannot be told apart
is left out and listed; nothing is guessed.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection
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
    """Unreadable cells of one column: ``rows`` (m,) indices into the Grid, ``what`` describes the first few by row."""

    rows: np.ndarray
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
    if '"' in line:
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


def read_grid(data: bytes, place: str, numeric: Collection[str] = ()) -> Grid:
    """Parse a delimited text table with a header line.

    ``numeric`` are names that must hold numbers; other columns may hold text and are then only listed. Raises
    InputError at ``place`` when there is no header, no row, or no line that fits the header.
    """
    data = normalise_text(data)
    data = data.lstrip(b"\n")
    names, dialect = header_of(data[:1 << 16])
    if len(names) < 2:
        raise InputError(place, "no header line with column names" if data.strip() else "the file is empty",
                         "give a table with a header")
    first_end = data.find(b"\n")
    body = data[first_end + 1:] if first_end >= 0 else b""
    if not body.strip():
        raise InputError(place, "there is a header but no row", "the recording is empty")
    dialect = _with_decimal(dialect, body)
    columns, repeated = _unique(names)
    grid = _fast(body, columns, dialect, set(numeric))
    if grid is None:
        grid = _exact(body, columns, dialect, set(numeric), place)
    grid.repeated = repeated
    for name in repeated:
        for key in [k for k in grid.columns if k.startswith(f"{name}\x00")]:
            del grid.columns[key]
            grid.bad.pop(key, None)
    if dialect.delimiter != ",":
        shown = {None: "blanks", "\t": "tab"}.get(dialect.delimiter, repr(dialect.delimiter))
        grid.notes.append(f"cells are separated by {shown}" + (", decimal comma" if dialect.decimal == "," else ""))
    return grid


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


def _fast(body: bytes, columns: list[str], dialect: Dialect, numeric: set[str]) -> Grid | None:
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
        _note_unreadable(grid, name, column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), column)
    grid.decimals = _decimals_of(body.rstrip(b"\n").rpartition(b"\n")[2], columns, dialect)
    return grid


def _note_unreadable(grid: Grid, name: str, values: np.ndarray, column: pa.Array) -> None:
    """Store a column of the fast path; nulls, infinities and gigantic values become NaN and are listed."""
    wrong = ~(np.abs(values) < GIGANTIC)
    if wrong.any():
        rows = np.flatnonzero(wrong)
        what = {}
        for row in rows[:5]:
            what[int(row)] = "an empty cell" if not column[int(row)].is_valid else _describe(repr(float(values[row])))
        values = np.where(wrong, np.nan, values)
        grid.bad[name] = BadCells(rows, what)
    grid.columns[name] = values


def _describe(cell: str) -> str:
    """What stands where a number belongs, printable and short."""
    if cell.strip() in EMPTY_CELLS or cell.strip() == "nan":
        return "an empty cell" if not cell.strip() else "no number (nan)"
    shown = "".join(c if c.isprintable() else "?" for c in cell[:20]) + ("..." if len(cell) > 20 else "")
    if _NUMBER.fullmatch(cell.strip()) or cell.strip().lstrip("+-") in ("inf", "Infinity"):
        return f"a value beyond any measurement ({shown})"
    return f"text '{shown}' where a number belongs"


def parse_number(cell: str, decimal: str = ".") -> float:
    """The number in a cell, or NaN. Stricter than float(): no underscores, no digits of other scripts."""
    if decimal == ",":
        if "." in cell:
            return float("nan")
        cell = cell.replace(",", ".", 1)
    if not _NUMBER.fullmatch(cell):
        return float("nan")
    value = float(cell)
    return value if abs(value) < GIGANTIC else float("nan")


def _exact(body: bytes, columns: list[str], dialect: Dialect, numeric: set[str], place: str) -> Grid:
    """Line by line, cell by cell."""
    body, truncated = _cut_last_line(body, columns, dialect)
    rows: list[list[str]] = []
    lines: list[int] = []
    lost: list[LostRow] = []
    total = 0
    widths: dict[int, int] = {}
    for number, raw in enumerate(body.split(b"\n"), start=2):
        text = raw.decode("utf-8", errors="replace").rstrip("\r")
        if not text.strip():
            continue
        total += 1
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
    grid = Grid({}, np.array(lines), total + bool(truncated), lost=lost, truncated=truncated)
    for name, cells in zip(columns, zip(*rows, strict=True), strict=True):
        if all(c in EMPTY_CELLS for c in cells):
            grid.empty.append(name)
            continue
        values = np.array([parse_number(c, dialect.decimal) for c in cells])
        wrong = np.flatnonzero(np.isnan(values))
        if name not in numeric and 2 * sum(cells[i] not in EMPTY_CELLS for i in wrong) > len(cells):
            grid.text.append(name)
            continue
        grid.columns[name] = values
        if len(wrong):
            grid.bad[name] = BadCells(wrong, {int(i): _describe(cells[i]) for i in wrong[:5]})
    grid.decimals = _decimals_of(body.rstrip(b"\n").rpartition(b"\n")[2], columns, dialect)
    return grid
