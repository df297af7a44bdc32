"""Link service (crtpservice.c) and platform service (platformservice.c)."""

from collections.abc import Callable

from ..crtp import MAX_DATA, Packet, Port

PROTOCOL_VERSION = 10
FIRMWARE, DEVICE = b"2025.12.1", b"Crazyflie 2.1"
ECHO, SOURCE = 0, 1
COMMAND, VERSION = 0, 1
ARM, RECOVER = 1, 2


def answer_link(packet: Packet) -> list[Packet]:
    """Port 15: channel 0 echoes, channel 1 says who this is, 2 swallows."""
    if packet.channel == ECHO:
        return [packet]
    if packet.channel == SOURCE:
        return [Packet(Port.LINK, SOURCE, b"Bitcraze Crazyflie".ljust(MAX_DATA, b"\0"))]
    return []


def answer_platform(packet: Packet, arm: Callable[[bool], bool], recover: Callable[[], bool],
                    protocol_version: int = PROTOCOL_VERSION) -> list[Packet]:
    """Port 13: versions, arming, getting up again after a crash."""
    command = packet.data[:1]
    if packet.channel == VERSION and command:
        answer = {0: protocol_version.to_bytes(4, "little"), 1: FIRMWARE, 2: DEVICE}.get(command[0])
        return [] if answer is None else [Packet(Port.PLATFORM, VERSION, command + answer)]
    if packet.channel != COMMAND or not command:
        return []
    if command[0] == ARM and len(packet.data) > 1:
        return [Packet(Port.PLATFORM, COMMAND, command + bytes([arm(packet.data[1] != 0)]))]
    if command[0] == RECOVER:
        return [Packet(Port.PLATFORM, COMMAND, command + bytes([recover()]))]
    return []
