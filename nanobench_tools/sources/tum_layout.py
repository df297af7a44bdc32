"""Which cell of a TUM line is what: the line of names above the poses is believed, and the format's order without one.

Files that call themselves TUM differ: time in nanoseconds, w before x, covariances behind the pose, a column before it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ..units import factor
from .cells import parse_number
from .dialect import COMMA_NUMBER, NUMBER, normalise_text
from .names import listed, quantity_of, split_names
from .units_as_written import unit_as_written

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
ORDER = ("time", *POSE)
TIME_UNITS, LENGTH_UNITS = ("s", "ms", "us", "ns"), ("m", "cm", "mm", "in", "ft")
ROWS_SEEN = 50
SAMPLE = 1 << 13
"""Characters that are searched for decimal commas."""
WHOLE = re.compile(r"[+-]?\d+")
NORM_TOLERANCE = 0.05
"""A row is a pose only when its quaternion has unit length to within this."""


@dataclass(frozen=True)
class Layout:
    """Layout of a trajectory file.

    - order (8,): which cell is time, px .. pz, qx .. qw.
    - widths: numbers of cells a row may have.
    - factors to s and m, ``time_unit`` empty where the file does not state it.
    - left: names of columns that are not read."""

    order: tuple[int, ...] = tuple(range(8))
    widths: tuple[int, ...] = (8,)
    time_unit: str = ""
    length: float = 1.0
    left: tuple[str, ...] = ()


@dataclass(frozen=True)
class Seen:
    """Result for the beginning of a file: ``layout``, or why it has none; ``poses`` of ``rows`` were unit poses."""

    layout: Layout | None
    why: str
    poses: int
    rows: int


def text_of(data: bytes) -> str:
    """The text of a file, with points where all its numbers between blanks have decimal commas."""
    text = normalise_text(data).decode("utf-8", errors="replace")
    rows = [cells for line in text[:SAMPLE].split("\n")[:-1] if (cells := line.split("#", 1)[0].split())
            and any(map(COMMA_NUMBER.fullmatch, cells))]
    commas = rows and all(COMMA_NUMBER.fullmatch(c) or WHOLE.fullmatch(c) for cells in rows for c in cells)
    return text.replace(",", ".") if commas else text


def look(lines: list[str]) -> Seen:
    """The layout of a text, from its first lines (whole ones). A text that is no trajectory has no poses."""
    header = ""
    rows: list[list[str]] = []
    for line in lines:
        cells = line.split("#", 1)[0].split()
        if "," not in line and any(NUMBER.fullmatch(c) for c in cells):
            rows.append(cells)
        elif not rows and line.strip() and not (header and _prose(line)):
            header = line
        if len(rows) == ROWS_SEEN:
            break
    comment = header.lstrip().startswith("#")
    layout: Layout | None = Layout()
    why = ""
    if header and not (comment and _prose(header)):
        layout, why = _from_names(header)
    if layout is not None and layout.left and not comment:
        why = f"its first line is no comment, and names {listed(layout.left)} as well"
        layout = None
    if layout is None:
        return Seen(None, "" if _prose(header) else why, 0, len(rows))
    fit = [r for r in rows if len(r) in layout.widths]
    numbers = [[parse_number(r[k]) for k in layout.order[4:]] for r in fit]
    unit = sum(abs(np.linalg.norm(q) - 1.0) < NORM_TOLERANCE for q in numbers)
    if not fit and rows and not _prose(header):
        why = f"its line of names has {layout.widths[0]} of them, and a row {len(rows[0])} cells"
    return Seen(layout, why, int(unit), len(rows))


def _prose(line: str) -> bool:
    """Whether a comment is no line of names: it names neither two elements of a quaternion nor, first, a time."""
    found = [quantity_of(name)[0] for name, _ in split_names(line)]
    return sum(q is not None and q[0] == "q" for q in found) < 2 and not (found[:1] == ["time"] and len(found) >= 8)


def _from_names(line: str) -> tuple[Layout | None, str]:
    named = split_names(line)
    found = [quantity_of(name) for name, _ in named]
    at: dict[str, int] = {}
    for k, (quantity, _) in enumerate(found):
        if quantity is not None and at.setdefault(quantity, k) != k:
            return None, f"its line of names gives {quantity} twice ({listed([n for n, _ in named])})"
    if missing := [q for q in ORDER if q not in at]:
        return None, f"its line of names lacks {', '.join(missing)} ({listed([n for n, _ in named])})"
    units = {q: named[k][1] or found[k][1] for q, k in at.items()}
    time_unit = unit_as_written(units["time"]) or ""
    lengths = {units[q] and (unit_as_written(units[q]) or units[q]) for q in ("px", "py", "pz")}
    if units["time"] and time_unit not in TIME_UNITS:
        return None, f"its time is in {units['time']!r} (known: {', '.join(TIME_UNITS)})"
    if len(lengths) > 1 or not lengths <= {"", *LENGTH_UNITS}:
        return None, f"its positions are in {', '.join(sorted(map(repr, lengths)))} (known: {', '.join(LENGTH_UNITS)})"
    if strange := [units[q] for q in ("qx", "qy", "qz", "qw") if units[q] not in ("", "1", "-")]:
        return None, f"its quaternion is in {strange[0]!r}"
    order = tuple(at[q] for q in ORDER)
    widths = (len(named), 8) if max(order) < 8 else (len(named),)
    left = tuple(name for k, (name, _) in enumerate(named) if k not in order)
    return Layout(order, widths, time_unit, factor(lengths.pop() or "m"), left), ""
