"""Log variables and blocks (log.c, version 2): a client puts variables into blocks, which are sent every few ms."""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..crtp import Packet, Port
from .toc import Contents

TOC, CONTROL, DATA = range(3)
CREATE, APPEND, DELETE, START, STOP, RESET, CREATE_V2, APPEND_V2, START_V2 = range(9)
ENOENT, E2BIG, ENOEXEC, ENOMEM, EEXIST = 2, 7, 8, 12, 17
MOST_BLOCKS, MOST_VARIABLES, MOST_BYTES = 16, 128, 26
SILENCE_MS = 1000
"""Logs stop when the radio has brought nothing for so long."""
_KINDS = {"u1": 1, "u2": 2, "u4": 3, "i1": 4, "i2": 5, "i4": 6, "f4": 7}
_FETCHED = {1: "B", 2: "H", 3: "I", 4: "B", 5: "H", 6: "I", 7: "f", 8: "e"}  # whole numbers are cut to their bits
_SIZES = {kind: struct.calcsize("<" + letter) for kind, letter in _FETCHED.items()}


@dataclass(frozen=True)
class LogVariable:
    """kind u1 u2 u4 i1 i2 i4 f4; ``read`` gives the value now."""

    kind: str
    read: Callable[[], float]


@dataclass
class _Block:
    """What gives the values in their types, and their packing; every ``period_ms`` from ``next_ms`` on while
    started."""

    values: list[Callable[[], float]] = field(default_factory=list)
    letters: str = ""
    packing: struct.Struct = field(default=struct.Struct("<BHB"))
    period_ms: int = 0
    next_ms: int | None = None

    def size(self) -> int:
        return struct.calcsize("<" + self.letters)

    def add(self, read: Callable[[], float], kind: int) -> None:
        self.values.append(_fetched(read, kind))
        self.letters += _FETCHED[kind]
        self.packing = struct.Struct("<BHB" + self.letters)

    def packet(self, number: int, now_ms: int) -> Packet:
        values = [value() for value in self.values]
        return Packet(Port.LOG, DATA, self.packing.pack(number, now_ms & 0xFFFF, now_ms >> 16 & 0xFF, *values))


class Log:
    """Answers on port 5 and sends what is due."""

    def __init__(self, variables: Mapping[str, LogVariable]) -> None:
        self._all = list(variables.values())
        self._contents = Contents(list(variables), [_KINDS[v.kind] for v in self._all],
                                  bytes([MOST_BLOCKS, MOST_VARIABLES]))
        self._blocks: dict[int, _Block] = {}
        self._turn = 0

    def __len__(self) -> int:
        return len(self._all)

    def answer(self, packet: Packet, now_ms: int) -> list[Packet]:
        """Packets in answer to one on the port."""
        if packet.channel == TOC:
            found = self._contents.answer(packet.data)
            return [] if found is None else [Packet(Port.LOG, TOC, found)]
        if packet.channel != CONTROL or not packet.data:
            return []
        command, block = packet.data[0], packet.data[1] if len(packet.data) > 1 else 0
        error = self._control(command, block, packet.data[2:], now_ms)
        return [Packet(Port.LOG, CONTROL, bytes([command, block, error]))]

    def _control(self, command: int, block: int, data: bytes, now_ms: int) -> int:
        """Carries a command out; the firmware's error number or 0."""
        if command == RESET:
            self._blocks.clear()
            return 0
        if command == CREATE_V2:
            return self._create(block, data)
        if block not in self._blocks:
            return ENOENT if command in (APPEND_V2, DELETE, START, STOP, START_V2) else ENOEXEC
        found = self._blocks[block]
        if command == APPEND_V2:
            return self._append(found, data)
        if command == DELETE:
            del self._blocks[block]
        elif command == STOP:
            found.next_ms = None
        elif command in (START, START_V2) and data:
            short = len(data) < 2 or command == START
            found.period_ms = 10 * data[0] if short else int.from_bytes(data[:2], "little")
            found.next_ms = now_ms + found.period_ms
        else:
            return ENOEXEC
        return 0

    def _create(self, block: int, data: bytes) -> int:
        if block in self._blocks:
            return EEXIST
        if len(self._blocks) >= MOST_BLOCKS:
            return ENOMEM
        made = self._blocks[block] = _Block()
        error = self._append(made, data)
        if error:
            del self._blocks[block]
        return error

    def _append(self, block: _Block, data: bytes) -> int:
        """Variables of three bytes each; bytes after the last whole one are ignored."""
        used = sum(len(b.values) for b in self._blocks.values())
        for at in range(0, len(data) // 3 * 3, 3):
            fetched, which = data[at] & 0x0F, int.from_bytes(data[at + 1:at + 3], "little")
            if fetched not in _FETCHED or which >= len(self._all):
                return ENOENT
            if block.size() + _SIZES[fetched] > MOST_BYTES:
                return E2BIG
            if used >= MOST_VARIABLES:
                return ENOMEM
            block.add(self._all[which].read, fetched)
            used += 1
        return 0

    def stop(self) -> None:
        """All blocks stop, as when the link is lost."""
        for block in self._blocks.values():
            block.next_ms = None

    def due_ms(self) -> int | None:
        """When the next block is to be sent."""
        return min((b.next_ms for b in self._blocks.values() if b.next_ms is not None), default=None)

    def due(self, now_ms: int) -> list[Packet]:
        """Packets of the blocks whose time has come. Another block is first every time, so that a full queue does not
        always drop the same ones."""
        found, numbers = [], list(self._blocks)
        self._turn = (self._turn + 1) % max(len(numbers), 1)
        for number in numbers[self._turn:] + numbers[:self._turn]:
            block = self._blocks[number]
            if block.next_ms is None or block.next_ms > now_ms:
                continue
            found.append(block.packet(number, now_ms))
            block.next_ms = now_ms + block.period_ms if block.period_ms else None
        return found


def _fetched(read: Callable[[], float], kind: int) -> Callable[[], float]:
    """Reads a value as the type asked for: whole numbers lose what is behind the point and what does not fit."""
    if kind == 7:
        return read
    if kind == 8:
        return lambda: max(-65504.0, min(65504.0, read()))
    bits = (1 << 8 * _SIZES[kind]) - 1

    def whole() -> int:
        value = read()
        return int(value) & bits if math.isfinite(value) else 0

    return whole
