"""Messages of a ULog distinguished before they are parsed, so that damage costs only what it hit.

A log is 16 bytes of header, then messages: u16 size, u8 kind, payload. Where a size or kind cannot be, the next place
is searched from which messages follow each other again.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import pairwise

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16
KINDS = b"BFIMPQARSOLCD"
"""Kinds of messages there are."""
LONGEST = 10_000
CHAIN = 3
"""Messages that have to follow each other before a place behind damage is believed."""

_head = struct.Struct("<HB").unpack_from


@dataclass(frozen=True)
class Whole:
    """``data`` holds whole messages only. ``strange`` is the byte at which the first damage begins, ``left_out`` how
    many bytes were; ``cut`` the bytes of a last message that is not whole."""

    data: bytes
    strange: int | None = None
    left_out: int = 0
    cut: int = 0


def whole_messages(data: bytes) -> Whole:
    """The messages of a log; the bytes themselves when nothing is wrong with them."""
    bounds = [HEADER, *_appended(data), len(data)]
    sizes: dict[bytes, int] = {}
    body: list[bytes] = []
    strange, cut = None, 0
    for first, last in pairwise(bounds):
        part = data[first:last]
        places, stop = _places(part, sizes)
        body += [part[a:b] for a, b in places]
        if stop is not None and last == len(data) and _is_cut(part, stop, sizes):
            cut = len(part) - stop
        damage = places[0][1] if len(places) > 1 else stop if not cut else None
        if damage is not None and strange is None:
            strange = first + damage
    if strange is None and not cut:
        return Whole(data)
    kept = b"".join(body)
    return Whole(_without_offsets(data[:HEADER] + kept), strange, len(data) - HEADER - len(kept) - cut, cut)


def _places(part: bytes, sizes: dict[bytes, int]) -> tuple[list[tuple[int, int]], int | None]:
    """Stretches of messages in a row, and where the last one ends early (None: with ``part``)."""
    places = []
    start = at = 0
    while at < len(part):
        after = _next(part, at, sizes)
        if after is not None:
            at = after
            continue
        places.append((start, at))
        found = _resume(part, at + 1, sizes)
        if found is None:
            return places, at
        start = at = found
    return [*places, (start, at)], None


def _appended(data: bytes) -> list[int]:
    """Where data was appended after a crash, as the first message states; the bytes before it may be a cut message."""
    if len(data) < HEADER + 3 + 40 or _head(data, HEADER) != (40, 66) or not data[HEADER + 3 + 8] & 1:
        return []
    offsets = struct.unpack_from("<3Q", data, HEADER + 3 + 16)
    return sorted({o for o in offsets if HEADER + 3 + 40 < o < len(data)})


def _next(data: bytes, at: int, sizes: dict[bytes, int]) -> int | None:
    """Where the message at ``at`` ends, or None. Data messages of one id have one size: another one is
    believed only when more messages follow it."""
    if at + 3 > len(data):
        return None
    size, kind = _head(data, at)
    after: int = at + 3 + size
    if kind not in KINDS or not 0 < size <= LONGEST or after > len(data):
        return None
    if kind == 68:  # D
        known = sizes.setdefault(data[at + 3 : at + 5], size)
        if known != size and not _chain(data, after):
            return None
    return after


def _chain(data: bytes, at: int) -> bool:
    """Whether CHAIN messages, or messages up to the end of the file, follow from ``at``."""
    for _ in range(CHAIN):
        if at == len(data):
            return True
        if at + 3 > len(data):
            return False
        size, kind = _head(data, at)
        at += 3 + size
        if kind not in KINDS or not 0 < size <= LONGEST or at > len(data):
            return False
    return True


def _resume(data: bytes, at: int, sizes: dict[bytes, int]) -> int | None:
    """The next place from which messages follow each other."""
    for place in range(at, len(data) - 3):
        if data[place + 2] not in KINDS:
            continue
        size, kind = _head(data, place)
        if kind == 68 and sizes.get(data[place + 3 : place + 5], size) != size:
            continue
        if _chain(data, place):
            return place
    return None


def _is_cut(data: bytes, at: int, sizes: dict[bytes, int]) -> bool:
    """Whether what is at ``at`` is the beginning of a message that the file ends in."""
    if at + 3 > len(data):
        return True
    size, kind = _head(data, at)
    return kind in KINDS and 0 < size <= LONGEST and (kind != 68 or sizes.get(data[at + 3 : at + 5], size) == size)


def _without_offsets(data: bytes) -> bytes:
    """Places of appended data, in the first message, do not hold once bytes were left out."""
    if len(data) < HEADER + 3 + 40 or _head(data, HEADER) != (40, 66):
        return data
    flags = HEADER + 3
    plain = bytes([data[flags + 8] & 0xFE]) + data[flags + 9 : flags + 16] + bytes(24)
    return data[: flags + 8] + plain + data[flags + 40 :]
