"""How a text table is written: delimiter, decimal mark, line ends, cells of a line."""

from __future__ import annotations

import contextlib
import csv
import re
from dataclasses import dataclass

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)

MINUS = "\N{MINUS SIGN}".encode()
"""Word processors and plotting programs write it for a hyphen."""


@dataclass(frozen=True)
class Dialect:
    delimiter: str | None
    """None: any run of blanks."""
    decimal: str = "."


def normalise_text(data: bytes) -> bytes:
    """UTF-8 bytes without byte order mark, lines ended by a line feed."""
    data = data.removeprefix(b"\xef\xbb\xbf").replace(MINUS, b"-")
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


def unique_names(names: list[str]) -> tuple[list[str], list[str]]:
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


def with_decimal(dialect: Dialect, body: bytes) -> Dialect:
    """Decimal comma: the first rows hold numbers with a comma and none with a point."""
    if dialect.delimiter == ",":
        return dialect
    sample = body[: 1 << 14].decode("utf-8", errors="replace").split("\n")[:20]
    cells = [c for line in sample for c in split_line(line.rstrip("\r"), dialect.delimiter)]
    commas = sum(bool(COMMA_NUMBER.fullmatch(c)) for c in cells)
    points = sum("." in c and bool(NUMBER.fullmatch(c)) for c in cells)
    return Dialect(dialect.delimiter, ",") if commas and not points else dialect


def decimals_of(line: bytes, columns: list[str], dialect: Dialect) -> dict[str, int]:
    cells = split_line(line.decode("utf-8", errors="replace").rstrip("\r"), dialect.delimiter)
    if len(cells) != len(columns):
        return {}
    return {
        n: len(c.rpartition(dialect.decimal)[2])
        for n, c in zip(columns, cells, strict=True)
        if dialect.decimal in c and "e" not in c.lower()
    }


def cut_last_line(body: bytes, columns: list[str], dialect: Dialect) -> tuple[bytes, str]:
    """A last line without line end may be cut inside a number; keep it only when it is as long as the one before."""
    if body.endswith(b"\n"):
        return body, ""
    start = body.rfind(b"\n") + 1
    last = body[start:]
    if not last.strip():
        return body[:start], ""
    cells = split_line(last.decode("utf-8", errors="replace"), dialect.delimiter)
    if len(cells) >= len(columns):
        lines = body[max(start - 8192, 0) : start].split(b"\n")[-21:-1]
        earlier = {decimals_of(line, columns, dialect).get(columns[-1], 0) for line in lines}
        if not lines:  # the only row: compare with its own other cells
            earlier = set(list(decimals_of(last, columns, dialect).values())[:-1]) or {0}
        fixed_format = len(earlier) == 1  # else the lengths vary anyway, and a short one proves nothing
        if not fixed_format or decimals_of(last, columns, dialect).get(columns[-1], 0) >= max(earlier):
            return body, ""
        return body[:start], "the last line is cut off: its last cell is shorter than in the lines before"
    return body[:start], f"the last line is cut off: {len(cells)} of {len(columns)} cells"


def dialect_notes(dialect: Dialect) -> list[str]:
    if dialect.delimiter == ",":
        return []
    shown = {None: "blanks", "\t": "tab"}.get(dialect.delimiter, repr(dialect.delimiter))
    return [f"cells are separated by {shown}" + (", decimal comma" if dialect.decimal == "," else "")]
