"""Packets of the Crazy RealTime Protocol: one header byte (port, channel) and up to 30 bytes of data.

Source: crazyflie-firmware 2025.12.1, crtp.h; over UDP a datagram is one packet, without a checksum.
"""

from enum import IntEnum
from typing import NamedTuple

MAX_DATA = 30
NULL = b"\xff"
"""Sent when the queue is empty; a scan sends it and accepts any answer."""


class Port(IntEnum):
    """Who is talked to."""

    CONSOLE = 0
    PARAM = 2
    RPYT = 3
    MEMORY = 4
    LOG = 5
    LOCALIZATION = 6
    GENERIC = 7
    HIGH_LEVEL = 8
    PLATFORM = 13
    LINK = 15


class Packet(NamedTuple):
    """port 0..15, channel 0..3, data of at most MAX_DATA bytes."""

    port: int
    channel: int
    data: bytes


def parse(datagram: bytes) -> Packet | None:
    """The packet in a datagram; None for the null packet and for what is none. The two reserved bits are ignored."""
    if not 1 <= len(datagram) <= 1 + MAX_DATA or datagram[0] & 0xF3 == 0xF3:
        return None
    return Packet(datagram[0] >> 4, datagram[0] & 0x3, bytes(datagram[1:]))


def pack(packet: Packet) -> bytes:
    """A datagram; the reserved bits are set, as cflib sets them."""
    return bytes([packet.port << 4 | 0x0C | packet.channel]) + packet.data
