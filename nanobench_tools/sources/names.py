"""What tables call time and pose, whoever wrote them, and the units behind a name."""

from __future__ import annotations

import re
from collections.abc import Sequence

_PIECE = re.compile(r"([^\s,;|\[\]()]+)[ ]*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?")
_SUFFIX = re.compile(r"(.+)_(ns|us|ms|s|sec|mm|cm|m)")

QUANTITIES: dict[str, tuple[str, ...]] = {
    "time": ("time", "timestamp", "timestamps", "stamp", "t", "ts", "secs", "seconds"),
    **{f"p{a}": (a, f"t{a}", f"p{a}", f"p_{a}", f"p.{a}", f"pos_{a}", f"position_{a}", f"position.{a}") for a in "xyz"},
    **{f"q{a}": (f"q{a}", f"q_{a}", f"q.{a}", f"quat_{a}", f"orientation_{a}", f"orientation.{a}") for a in "xyzw"},
}
"""Quantity -> spellings in lower case."""
_OF = {spelling: quantity for quantity, spellings in QUANTITIES.items() for spelling in spellings}


def split_names(line: str) -> list[tuple[str, str]]:
    """(name, unit) of every column of a header line: ``# timestamp [ns] tx(m)`` -> timestamp ns, tx m. The unit is
    empty where none is there."""
    return [(match[1], (match[2] or "").strip()) for match in _PIECE.finditer(line.strip().lstrip("#"))]


def quantity_of(name: str) -> tuple[str | None, str]:
    """time, px .. pz, qx .. qw or None for a column, and the unit that its name ends in (``timestamp_ns``). Without a
    unit it is ""."""
    name = name.strip().lower()
    if name in _OF:
        return _OF[name], ""
    if (match := _SUFFIX.fullmatch(name)) and match[1] in _OF:
        return _OF[match[1]], match[2]
    return None, ""


def listed(names: Sequence[str], most: int = 16) -> str:
    """Names for a message of one line: printable, and not all of a long list."""
    shown = ["".join(c if c.isprintable() else "?" for c in name[:40]) or "(no name)" for name in names[:most]]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(shown) + more
