"""Memory subsystem as far as clients need it to connect and to bring trajectories (crtp_mem.c, mem.c)."""

from ..crtp import Packet, Port

INFO, READ, WRITE = range(3)
TRAJECTORY_BYTES = 4096
_TRAJECTORY_KIND = 0x12
MOST = 24
EIO, ENOENT = 5, 2


class Memory:
    """One memory: that of trajectories. Answers on port 4."""

    def __init__(self) -> None:
        self.trajectory = bytearray(TRAJECTORY_BYTES)

    def answer(self, packet: Packet) -> list[Packet]:
        """Packets in answer to one on the port."""
        data = packet.data
        found: bytes | None = None
        if packet.channel == INFO and data[:1] == b"\1":
            found = bytes([1, 1])
        elif packet.channel == INFO and data[:1] == b"\2" and len(data) > 1:
            found = data[:2]
            if data[1] == 0:
                found += bytes([_TRAJECTORY_KIND]) + TRAJECTORY_BYTES.to_bytes(4, "little") + bytes(8)
        elif packet.channel in (READ, WRITE) and len(data) >= 5:
            found = data[:5] + (self._read(data) if packet.channel == READ else self._write(data))
        return [] if found is None else [Packet(Port.MEMORY, packet.channel, found)]

    def _read(self, data: bytes) -> bytes:
        address, length = int.from_bytes(data[1:5], "little"), data[5] if len(data) > 5 else 0
        if data[0] != 0:
            return bytes([ENOENT])
        if length > MOST or address + length > TRAJECTORY_BYTES:
            return bytes([EIO])
        return b"\0" + bytes(self.trajectory[address:address + length])

    def _write(self, data: bytes) -> bytes:
        address, value = int.from_bytes(data[1:5], "little"), data[5:]
        if data[0] != 0:
            return bytes([ENOENT])
        if address + len(value) > TRAJECTORY_BYTES:
            return bytes([EIO])
        self.trajectory[address:address + len(value)] = value
        return b"\0"
