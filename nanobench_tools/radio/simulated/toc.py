"""Tables of contents of parameters and log variables (log.c, param_logic.c; version 2 of their protocol)."""

import struct
import zlib
from collections.abc import Sequence

INFO, ITEM = 3, 2
MOST_NAME = 24
"""Group and name together have so many characters at most, for an item to fit into a packet."""


class Contents:
    """``names`` group.name in order, ``kinds`` their type bytes, ``tail``: what INFO says beyond count and checksum.

    The checksum is over all of it, as clients keep tables by it.
    """

    def __init__(self, names: Sequence[str], kinds: Sequence[int], tail: bytes = b"") -> None:
        self.index = {name: i for i, name in enumerate(names)}
        self._items = [bytes([kind]) + _text(name) for name, kind in zip(names, kinds, strict=True)]
        self._info = struct.pack("<HI", len(names), zlib.crc32(b"".join(self._items))) + tail

    def __len__(self) -> int:
        return len(self._items)

    def answer(self, data: bytes) -> bytes | None:
        """The answer to a question on the table's channel, None for one that the firmware does not answer."""
        if data[:1] == bytes([INFO]):
            return data[:1] + self._info
        if data[:1] == bytes([ITEM]) and len(data) >= 3:
            which = int.from_bytes(data[1:3], "little")
            return data[:3] + self._items[which] if which < len(self._items) else data[:1]
        return None


def _text(name: str) -> bytes:
    group, _, own = name.partition(".")
    if not group or not own or len(group + own) > MOST_NAME:
        raise ValueError(f"{name!r} is no group.name of {MOST_NAME} characters at most")
    return group.encode() + b"\0" + own.encode() + b"\0"
