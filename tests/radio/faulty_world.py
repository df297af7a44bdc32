"""A world in which packets of a kind vanish or come late once the vehicle has been in the air for a while."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controllers.plants.served_vehicle import served
from nanobench_tools.radio.crtp import Packet, Port, parse
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions

ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)
IN_THE_AIR_M = 0.8
Kind = Callable[[Packet], bool]


def kind(port: Port, channel: int | None = None) -> Kind:
    """Packets of a port, and of a channel of it."""
    return lambda packet: packet.port == port and channel in (None, packet.channel)


def every(packet: Packet) -> bool:
    return True


class FaultyWorld(VirtualWorld):
    """``up``, ``down``: the packets that the fault is about, of what is sent to and by the vehicle; ``after_s`` in the
    air it begins and ``lasts_s``; ``share`` of them it strikes: they vanish, or come ``late_s`` later. ``struck``
    counts; ``sank_m_s`` is the fastest that the vehicle ever sank."""

    def __init__(self, up: Kind | None = None, down: Kind | None = None, after_s: float = 4.0, lasts_s: float = np.inf,
                 share: float = 1.0, late_s: float = 0.0, radio: RadioOptions | None = None) -> None:
        super().__init__(served(), radio or RadioOptions(latency_s=0.010), ROOM)
        self._up, self._down, self._after_s, self._lasts_s = up, down, after_s, lasts_s
        self._share, self._late_s, self._rng = share, late_s, np.random.default_rng(0)
        self._high_s = np.inf
        self._held: list[tuple[float, bytes]] = []
        self._held_down: list[tuple[float, bytes]] = []
        self.struck, self.sank_m_s = 0, 0.0
        came = self.simulation.outgoing
        self.simulation.outgoing = lambda time_s: self._arriving(time_s, came(time_s))  # type: ignore[method-assign]

    def _strikes(self, which: Kind | None, datagram: bytes) -> bool:
        since = self.now() - self._high_s - self._after_s
        packet = parse(datagram)
        if which is None or packet is None or not 0.0 <= since < self._lasts_s or not which(packet):
            return False
        strikes = bool(self._rng.random() < self._share)
        self.struck += strikes
        return strikes

    def post(self, datagram: bytes) -> None:
        if not self._strikes(self._up, datagram):
            super().post(datagram)
        elif self._late_s:
            self._held.append((self.now() + self._late_s, datagram))

    def _arriving(self, time_s: float, came: list[bytes]) -> list[bytes]:
        arrived = []
        for datagram in came:
            if not self._strikes(self._down, datagram):
                arrived.append(datagram)
            elif self._late_s:
                self._held_down.append((time_s + self._late_s, datagram))
        arrived += [d for due, d in self._held_down if due <= time_s]
        self._held_down = [(due, d) for due, d in self._held_down if due > time_s]
        return arrived

    def _step(self, time_s: float) -> None:
        for _, datagram in [held for held in self._held if held[0] <= time_s]:
            super().post(datagram)
        self._held = [held for held in self._held if held[0] > time_s]
        super()._step(time_s)
        place, velocity, _ = self.simulation.onboard.vehicle.true_pose()
        if place[2] > IN_THE_AIR_M:
            self._high_s = min(self._high_s, time_s)
        self.sank_m_s = max(self.sank_m_s, -float(velocity[2]))
