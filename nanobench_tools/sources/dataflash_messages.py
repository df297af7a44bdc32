"""Messages of an ArduPilot log (.bin): each begins with two fixed bytes and its type; FMT messages define the types.

The format has no checksums. A message counts as whole where another follows it at once. Other bytes are skipped and
counted. pymavlink's DFReader reads these logs, too, message by message. It prints on stderr what it skips, while
findings of damage need these bytes as numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

START = b"\xa3\x95"
FMT, FMT_LENGTH = 0x80, 89
MAGIC = START + bytes([FMT])
TYPES = {"b": "i1", "B": "u1", "g": "<f2", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8",
         "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "M": "u1",
         "q": "<i8", "Q": "<u8", "a": "(32,)<i2"}
"""Letter of a format -> dtype."""
SCALED = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}
HEAD = [("_start", "S2"), ("_type", "u1")]


@dataclass(frozen=True)
class Kind:
    """A type of message: name, dtype with its head, and factors of scaled columns."""

    name: str
    dtype: np.dtype
    scales: Mapping[str, float]


@dataclass(frozen=True)
class Messages:
    """``rows``: name -> records; ``skipped`` bytes that belong to no whole message, the first at ``first_skipped``;
    ``cut``: bytes after the last whole message; ``kinds`` by name."""

    rows: dict[str, np.ndarray]
    kinds: dict[str, Kind]
    skipped: int
    first_skipped: int
    cut: int

    def column(self, name: str, column: str) -> np.ndarray:
        """(n,) float, in the unit of the log."""
        values = self.rows[name][column].astype(float)
        return values * self.kinds[name].scales.get(column, 1.0)


def messages_of(data: bytes) -> Messages:
    """All whole messages of a log."""
    kinds: dict[int, Kind] = {}
    lengths = [0] * 256
    lengths[FMT] = FMT_LENGTH
    places: dict[int, list[int]] = {}
    at, end, skipped, first, cut = 0, len(data), 0, -1, 0
    while at < end:
        if data[at] == START[0] and data[at:at + 2] == START and at + 2 < end and (length := lengths[data[at + 2]]):
            if at + length > end:
                cut = end - at
                break
            kind = data[at + 2]
            if START.startswith(data[at + length:at + length + 2]):  # else it was cut, and holds bytes of the next
                if kind == FMT:
                    _define(data[at:at + length], kinds, lengths)
                else:
                    places.setdefault(kind, []).append(at)
                at += length
                continue
        following = _next(data, at + 1, lengths)
        first = at if first < 0 else first
        if following < 0:
            cut = end - at
            break
        skipped += following - at
        at = following
    raw = np.frombuffer(data, dtype=np.uint8)
    rows, named = {}, {}
    for number, found in places.items():
        kind_of = kinds[number]
        cells = raw[np.asarray(found)[:, None] + np.arange(kind_of.dtype.itemsize)]
        rows[kind_of.name] = np.ascontiguousarray(cells).view(kind_of.dtype)[:, 0]
        named[kind_of.name] = kind_of
    return Messages(rows, named, skipped, first, cut)


def _next(data: bytes, at: int, lengths: list[int]) -> int:
    """The next place that begins a message of a known type, followed by another or by the end; -1 without one."""
    while (at := data.find(START, at)) >= 0:
        length = lengths[data[at + 2]] if at + 2 < len(data) else 0
        if length and (at + length == len(data) or data[at + length:at + length + 2] == START):
            return at
        at += 1
    return -1


def _define(message: bytes, kinds: dict[int, Kind], lengths: list[int]) -> None:
    number, length = message[3], message[4]
    name, letters, columns = (message[a:b].split(b"\x00")[0].decode("ascii", errors="replace")
                              for a, b in ((5, 9), (9, 25), (25, 89)))
    names = columns.split(",") if columns else []
    if number == FMT or len(names) != len(letters) or len(set(names)) != len(names) or any(
            c not in TYPES for c in letters):
        return
    dtype = np.dtype([*HEAD, *((n, TYPES[c]) for n, c in zip(names, letters, strict=True))])
    if dtype.itemsize != length or lengths[number] not in (0, length):
        return
    lengths[number] = length
    kinds[number] = Kind(name, dtype, {n: SCALED[c] for n, c in zip(names, letters, strict=True) if c in SCALED})
