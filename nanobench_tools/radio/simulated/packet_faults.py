"""Packets of one kind that vanish or come late in a simulated flight, for tests and studies of ``fly``."""

from collections.abc import Callable

import numpy as np

from ..crtp import Packet, Port, parse

Kind = Callable[[Packet], bool]
Deliver = Callable[[bytes], None]


def kind(port: Port, channel: int | None = None) -> Kind:
    """Packets of a port, and of a channel of it."""
    return lambda packet: packet.port == port and channel in (None, packet.channel)


def every(packet: Packet) -> bool:
    return True


class PacketFaults:
    """``up``, ``down``: kinds of packets to and from the vehicle. The fault lasts from 0 to ``lasts_s`` of ``since()``.
    A ``share`` of them vanishes meanwhile, or comes ``late_s`` later. ``struck`` counts them."""

    def __init__(self, since: Callable[[], float], rng: np.random.Generator, up: Kind | None = None,
                 down: Kind | None = None, lasts_s: float = np.inf, share: float = 1.0, late_s: float = 0.0) -> None:
        self._since, self._rng, self._up, self._down = since, rng, up, down
        self._lasts_s, self._share, self._late_s = lasts_s, share, late_s
        self._held: list[tuple[float, bytes]] = []
        self._held_down: list[tuple[float, bytes]] = []
        self.struck = 0

    def _strikes(self, which: Kind | None, datagram: bytes) -> bool:
        packet = parse(datagram)
        if which is None or packet is None or not 0.0 <= self._since() < self._lasts_s or not which(packet):
            return False
        strikes = bool(self._rng.random() < self._share)
        self.struck += strikes
        return strikes

    def post(self, now_s: float, datagram: bytes, deliver: Deliver) -> None:
        """A datagram to the vehicle."""
        if not self._strikes(self._up, datagram):
            deliver(datagram)
        elif self._late_s:
            self._held.append((now_s + self._late_s, datagram))

    def release(self, now_s: float, deliver: Deliver) -> None:
        """Late datagrams to the vehicle that are due."""
        due = [datagram for due_s, datagram in self._held if due_s <= now_s]
        self._held = [held for held in self._held if held[0] > now_s]
        for datagram in due:
            deliver(datagram)

    def arriving(self, now_s: float, came: list[bytes]) -> list[bytes]:
        """The datagrams from the vehicle that arrive now."""
        arrived = []
        for datagram in came:
            if not self._strikes(self._down, datagram):
                arrived.append(datagram)
            elif self._late_s:
                self._held_down.append((now_s + self._late_s, datagram))
        arrived += [datagram for due_s, datagram in self._held_down if due_s <= now_s]
        self._held_down = [held for held in self._held_down if held[0] > now_s]
        return arrived
