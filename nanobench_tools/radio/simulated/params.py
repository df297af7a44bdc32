"""Parameters: table, read, write, and what is kept over a restart (param_task.c, param_logic.c)."""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..crtp import Packet, Port
from .toc import Contents

TOC, READ, WRITE, MISC = range(4)
SET_BY_NAME, VALUE_UPDATED, EXTENDED, STORE, STATE, CLEAR, DEFAULT = range(7)
ENOENT = 2
_KINDS = {"u1": (0x08, "B"), "u2": (0x09, "H"), "u4": (0x0A, "I"), "i1": (0x00, "b"), "i2": (0x01, "h"),
          "i4": (0x02, "i"), "f4": (0x06, "f")}
_EXTENDED, _CORE, _READ_ONLY = 0x10, 0x20, 0x40


@dataclass(frozen=True)
class Parameter:
    """kind u1 u2 u4 i1 i2 i4 f4; ``read`` gives the value, ``write`` takes one (None: read only); ``persistent``: may
    be stored."""

    kind: str
    read: Callable[[], float]
    write: Callable[[float], None] | None = None
    persistent: bool = False

    @property
    def code(self) -> int:
        """Type byte of the table."""
        return (_KINDS[self.kind][0] | (_EXTENDED if self.persistent else 0) | (_READ_ONLY if self.write is None else 0)
                | _CORE)

    @property
    def format(self) -> str:
        """Of ``struct``."""
        return "<" + _KINDS[self.kind][1]

    def packed(self, value: float) -> bytes:
        """The value as it travels; integers as far as they fit."""
        if self.kind == "f4":
            return struct.pack("<f", value)
        size = struct.calcsize(self.format)
        whole = int(value) if math.isfinite(value) else 0
        return (whole & (1 << 8 * size) - 1).to_bytes(size, "little")


class Parameters:
    """Answers on port 2. ``stored`` holds what a client had stored, by name."""

    def __init__(self, parameters: Mapping[str, Parameter]) -> None:
        self._by_name = dict(parameters)
        self._names, self._all = list(self._by_name), list(self._by_name.values())
        self._defaults = [p.packed(p.read()) for p in self._all]
        self._contents = Contents(self._names, [p.code for p in self._all])
        self.stored: dict[str, bytes] = {}

    def __len__(self) -> int:
        return len(self._all)

    def value(self, name: str) -> float:
        """As the vehicle has it; KeyError."""
        return self._by_name[name].read()

    def set(self, name: str, value: float) -> None:
        """From inside the vehicle; KeyError."""
        write = self._by_name[name].write
        if write is not None:
            write(value)

    def answer(self, packet: Packet) -> list[Packet]:
        """Packets in answer to one on the port."""
        found = {TOC: self._contents.answer, READ: self._read, WRITE: self._write, MISC: self._misc}[packet.channel](
            packet.data)
        return [] if found is None else [Packet(Port.PARAM, packet.channel, found)]

    def _which(self, data: bytes, at: int = 0) -> int | None:
        """Index in two bytes of data, None for one that does not exist."""
        if len(data) < at + 2:
            return None
        which = int.from_bytes(data[at:at + 2], "little")
        return which if which < len(self._all) else None

    def _read(self, data: bytes) -> bytes | None:
        which = self._which(data)
        if which is None:
            return data[:2] + bytes([ENOENT]) if len(data) >= 2 else None
        parameter = self._all[which]
        return data[:2] + b"\0" + parameter.packed(parameter.read())

    def _write(self, data: bytes) -> bytes | None:
        which = self._which(data)
        if which is None or not self._put(self._all[which], data[2:]):
            return None
        return data[:2] + self._all[which].packed(self._all[which].read())

    def _put(self, parameter: Parameter, value: bytes) -> bool:
        """Writes, if it may be written and the bytes are as many as the type has."""
        if parameter.write is None or len(value) != struct.calcsize(parameter.format):
            return False
        number = struct.unpack(parameter.format, value)[0]
        if not math.isfinite(number):
            return False
        parameter.write(number)
        return True

    def _misc(self, data: bytes) -> bytes | None:
        if data[:1] == bytes([SET_BY_NAME]):
            return self._set_by_name(data)
        which = self._which(data, 1)
        command = data[0] if data else -1
        if command not in (EXTENDED, STORE, STATE, CLEAR, DEFAULT):
            return None
        if which is None:
            return data[:3] + bytes([ENOENT]) if len(data) >= 3 else None
        parameter, name, default = self._all[which], self._names[which], self._defaults[which]
        if command == EXTENDED:
            return data[:3] + bytes([1 if parameter.persistent else 0])
        if command == DEFAULT:
            return data[:3] + default
        if not parameter.persistent:
            return data[:3] + bytes([ENOENT])
        if command == STATE:
            kept = self.stored.get(name)
            return data[:3] + (b"\0" + default if kept is None else b"\1" + default + kept)
        if command == STORE:
            self.stored[name] = parameter.packed(parameter.read())
        else:
            self.stored.pop(name, None)
        return data[:3] + b"\0"

    def _set_by_name(self, data: bytes) -> bytes | None:
        group, _, rest = data[1:].partition(b"\0")
        name, _, rest = rest.partition(b"\0")
        parameter = self._by_name.get(f"{group.decode('ascii', 'replace')}.{name.decode('ascii', 'replace')}")
        if not rest:
            return None
        good = parameter is not None and self._put(parameter, rest[1:])
        return data[:len(data) - len(rest)] + bytes([0 if good else ENOENT])
