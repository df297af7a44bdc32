"""The place of the line of names in a text table: not always first, and not always alone.

Lines above it may contain ``sep=;`` (Excel), comments and prose. The line itself may begin with ``#`` or ``%``, and a
row of units may follow it. The names are the line that is followed by a row of numbers with as many cells, otherwise
the first line. Names in several lines, groups above their parts, are joined.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from ..errors import InputError
from .dialect import (
    COMMA_NUMBER,
    NUMBER,
    Dialect,
    clean_name,
    normalise_text,
    split_line,
    unique_names,
    with_decimal,
)
from .units_as_written import unit_as_written

DELIMITERS = (",", ";", "\t", "|", None)
LINES_SEEN = 60
"""Lines of a preamble, at most."""
_SEPARATOR = re.compile(rb"\s*\"?sep=(.)\"?\s*", re.IGNORECASE)
_MARK = re.compile(r"^\s*(?:#+|%+|//)\s*")


@dataclass(frozen=True)
class Header:
    """``names`` as written, without quotes and comment marks; ``units``: of a row of units, as many, else empty;
    ``end``: bytes above the first row; ``lines``: how many lines these are."""

    names: list[str]
    dialect: Dialect
    units: tuple[str, ...] = ()
    end: int = 0
    lines: int = 0


def find_header(text: bytes) -> Header:
    """The header of ``text`` (normalised: UTF-8, lines ended by a line feed)."""
    lines, ends = _first_lines(text)
    given = None
    at = next((k for k, line in enumerate(lines) if line.strip()), None)
    if at is not None and (match := _SEPARATOR.fullmatch(lines[at])):
        given = match[1].decode("latin-1")
        at = next((k for k in range(at + 1, len(lines)) if lines[k].strip()), None)
    if at is None:
        return Header([], Dialect(given or ","))
    written = [_decoded(line) for line in lines]
    first = _names(written[at], given)
    if (joined := _joined([(k, written[k]) for k in range(at, len(lines)) if written[k].strip()], first)) is not None:
        return replace(joined, end=ends[joined.lines - 1])
    for k in range(at, len(lines)):
        found = _names(written[k], given)
        below = next((j for j in range(k + 1, len(lines)) if lines[j].strip()), None)
        if below is None:
            break
        units: tuple[str, ...] = ()
        end = k
        if len(found.names) > 1 and (row := _units(written[below], found)):
            units, end = row, below
            below = next((j for j in range(below + 1, len(lines)) if lines[j].strip()), None)
        if below is not None and _fits(written[below], found):
            if k > at and _is_the_header(first, written[at], found):
                break  # the rows between are damaged
            return replace(found, units=units, end=ends[end], lines=end + 1)
    return replace(first, end=ends[at], lines=at + 1)


def _joined(lines: list[tuple[int, str]], first: Header) -> Header | None:
    """The header of names in several lines: in the first one groups, each written once or above each of its parts.

    None for any other table. ``lines``: number and text of each line."""
    rows = [[clean_name(c) for c in split_line(line, first.dialect.delimiter)] for _, line in lines]
    levels = next((k for k, row in enumerate(rows) if any(map(is_number, row)) or len(row) != len(first.names)), 0)
    if levels < 2 or len(rows[levels]) != len(first.names) or first.dialect.delimiter is None:
        return None
    units = _units(lines[levels - 1][1], first)
    groups, *parts = rows[: levels - bool(units)]
    if not parts or len({g for g in groups if g}) == len(groups):
        return None
    for k in range(1, len(groups)):
        groups[k] = groups[k] or groups[k - 1]
    names = [".".join(filter(None, column)) for column in zip(groups, *parts, strict=True)]
    if len(set(names)) < len(names):
        return None
    return Header(names, first.dialect, units, lines=lines[levels - 1][0] + 1)


def _is_the_header(first: Header, line: str, found: Header) -> bool:
    """Whether the first line has as many names as the rows, and is no comment above another line of names."""
    named = [n for n in first.names if n]
    return (len(first.names) == len(found.names) and 2 * sum(map(is_number, named)) < len(named)
            and (not _MARK.match(line) or any(map(is_number, found.names))))


def _first_lines(text: bytes) -> tuple[list[bytes], list[int]]:
    """Lines, and where each ends, its line feed included."""
    if b"\x00" in text[:4096]:
        first = text.split(b"\n", 1)[0]
        return [first], [len(first) + 1]
    lines, ends, end = [], [], 0
    for line in text.split(b"\n", LINES_SEEN)[:LINES_SEEN]:
        end += len(line) + 1
        lines.append(line.rstrip(b"\r"))
        ends.append(min(end, len(text)))
    return lines, ends


def _decoded(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")  # what spreadsheets write on other systems


def _names(line: str, given: str | None) -> Header:
    """The names of a line by the delimiter that gives most of them."""
    line = _MARK.sub("", line)
    best = Header([clean_name(line)] if line.strip() else [], Dialect(","))
    for delimiter in (given,) if given else DELIMITERS:
        if delimiter is None and len(best.names) > 1:
            break  # names may hold blanks
        names = [clean_name(c) for c in split_line(line, delimiter)]
        if len(names) > len(best.names) or given:
            best = Header(names, Dialect(delimiter))
    return best


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, with a point or a comma."""
    return bool(NUMBER.fullmatch(cell) or COMMA_NUMBER.fullmatch(cell))


def _fits(row: str, header: Header) -> bool:
    """Whether ``row`` holds numbers, one below each name, and the names are none."""
    cells = split_line(row, header.dialect.delimiter)
    named = [n for n in header.names if n]
    if len(header.names) < 2 or len(cells) != len(header.names) or 2 * sum(map(is_number, named)) >= len(named):
        return False
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(map(is_number, filled)) >= len(filled)


def _units(row: str, header: Header) -> tuple[str, ...]:
    """Units of a row of units, one for each name. An unknown unit is kept as written, and the draft of a map asks for
    it."""
    cells = [c.strip("[](){} ") for c in split_line(_MARK.sub("", row), header.dialect.delimiter)]
    if len(cells) != len(header.names) or not any(cells):
        return ()
    written = [c for c in cells if c not in ("", "-")]
    known = sum(unit_as_written(c) is not None for c in written)
    if 2 * known <= len(written) or any(is_number(c) and c != "1" for c in written):
        return ()
    return tuple("" if c == "-" else unit_as_written(c) or c for c in cells)


def header_of(head: bytes) -> tuple[list[str], Dialect]:
    """Column names and delimiter of a table, from its first bytes."""
    found = find_header(normalise_text(head))
    return found.names, found.dialect


NO_NAMES = ("no header: its first line holds numbers, not the names of columns",
            "write a line of names above the rows, such as t,x,y,z,qx,qy,qz,qw in the order of the file")


@dataclass(frozen=True)
class Opened:
    """A table cut at its header.

    - ``body``: the rows; ``columns``: unique names; ``repeated``: those that came twice.
    - ``units``: by column if the table has a row of units.
    - ``first_line``: the number of the first row's line."""

    body: bytes
    columns: list[str]
    repeated: list[str]
    dialect: Dialect
    units: dict[str, str]
    first_line: int


def open_table(data: bytes, place: str) -> Opened:
    """The table in ``data``. Raises InputError where there is no line of names, or no row."""
    data = normalise_text(data)
    found = find_header(data[: 1 << 16])
    named = [n for n in found.names if n]
    if len(found.names) < 2:
        raise InputError(place, "no header line with column names" if data.strip() else "the file is empty",
                         "give a table with a header")
    if 2 * sum(map(is_number, named)) > len(named):
        raise InputError(place, *NO_NAMES)
    body = data[found.end:]
    if not body.strip():
        raise InputError(place, "there is a header but no row", "the recording is empty")
    columns, repeated = unique_names(found.names)
    units = {c: u for c, u in zip(columns, found.units, strict=False) if u}
    return Opened(body, columns, repeated, with_decimal(found.dialect, body), units, found.lines + 1)
