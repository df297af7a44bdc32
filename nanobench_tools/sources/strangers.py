"""Message for a file that no source reads: the columns found, and what to do.

A file that only looks like one of a format is refused, never read as it. A source that knows why adds a sentence
(``Doubtful``).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Protocol, runtime_checkable

import pyarrow as pa
import pyarrow.parquet as pq

from .base import Source
from .dialect import NUMBER, normalise_text, split_line
from .header import find_header
from .names import listed
from .payload import HEAD_BYTES

STRANGE = "not a recording of any known format"
MAP = ("draft a column map (nanobench columns FILE --out MAP.toml, of several tables of one flight FOLDER) and read it "
       "with --columns MAP.toml")
PARQUET_MAGIC = b"PAR1"
OF_PROGRAMS = {
    re.compile(rb"MATLAB \d"): "a file of MATLAB: write its variables to a CSV there (writetable)",
    re.compile(rb"\xd0\xcf\x11\xe0|PK\x03\x04(?s:.*)(\[Content_Types\]\.xml|opendocument\.spreadsheet)"):
        "a workbook: save its sheet as CSV"}
"""First bytes of files of other programs -> what they are and how to get a table."""


@runtime_checkable
class Doubtful(Protocol):
    """A source that can give the reason why a file which looks like one of its format is not one; None for any other
    file."""

    def why_not(self, head: bytes) -> str | None: ...


def of_program(head: bytes) -> str:
    """What a file of another program is and how to get a table of it; "" for any other file."""
    return next((what for start, what in OF_PROGRAMS.items() if start.match(head)), "")


def why_strange(data: bytes, sources: Iterable[Source]) -> str:
    """One line about a file nobody recognised; ``data`` its unpacked content."""
    head = data[:HEAD_BYTES]
    if what := of_program(head):
        return f"{STRANGE}; {what}"
    doubts = [why for s in sources if isinstance(s, Doubtful) and (why := s.why_not(head)) is not None]
    columns = _columns(data)
    parts = [STRANGE, *doubts]
    if columns is not None:
        parts.append(f"its columns: {columns}" if columns else "a table without a line of names")
        parts.append(MAP if columns else "write one above its rows, and " + MAP)
    return "; ".join(parts)


def _columns(data: bytes) -> str | None:
    """Names of a table's columns in one line; empty for rows of numbers without names, None for no table."""
    if data.startswith(PARQUET_MAGIC):
        try:
            return listed(pq.read_schema(pa.BufferReader(data)).names)
        except (pa.ArrowException, OSError, ValueError):
            return None
    if b"\x00" in data[:HEAD_BYTES]:
        return None
    text = normalise_text(data[:HEAD_BYTES])
    found = find_header(text)
    names, dialect = found.names, found.dialect
    named = [n for n in names if n]
    rows = [line.decode("utf-8", errors="replace") for line in text[found.end:].split(b"\n")]
    rows = [r for r in rows if r.strip() and not r.lstrip().startswith("#")]
    cells = split_line(rows[0].rstrip("\r"), dialect.delimiter) if rows else []
    if len(named) < 2 or len(cells) < 2 or not any(c.lstrip("+-.")[:1].isdigit() for c in cells):
        return None
    if all(NUMBER.fullmatch(n) for n in named):
        return ""
    counted = "" if len(cells) in (len(named), len(names)) else f" ({len(named)} names, {len(cells)} cells in a row)"
    return listed(names if len(cells) == len(names) else named) + counted
