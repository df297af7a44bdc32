"""A world in which packets of a kind vanish or come late once the vehicle has been in the air for a while."""

import numpy as np

from controllers.plants.served_vehicle import served
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions
from nanobench_tools.radio.simulated.packet_faults import Kind, PacketFaults, every, kind

__all__ = ["FaultyWorld", "every", "kind"]

ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)
IN_THE_AIR_M = 0.8


class FaultyWorld(VirtualWorld):
    """``up``, ``down``: the packets that the fault is about, of what is sent to and by the vehicle; ``after_s`` in the
    air it begins and ``lasts_s``; ``share`` of them it strikes: they vanish, or come ``late_s`` later. ``struck``
    counts; ``sank_m_s`` is the fastest that the vehicle ever sank."""

    def __init__(self, up: Kind | None = None, down: Kind | None = None, after_s: float = 4.0, lasts_s: float = np.inf,
                 share: float = 1.0, late_s: float = 0.0, radio: RadioOptions | None = None) -> None:
        super().__init__(served(), radio or RadioOptions(latency_s=0.010), ROOM)
        self._high_s, self.sank_m_s = np.inf, 0.0
        self._packets = PacketFaults(lambda: self.now() - self._high_s - after_s, np.random.default_rng(0), up, down,
                                     lasts_s, share, late_s)
        came = self.simulation.outgoing
        self.simulation.outgoing = lambda t: self._packets.arriving(t, came(t))  # type: ignore[method-assign]

    @property
    def struck(self) -> int:
        return self._packets.struck

    def post(self, datagram: bytes) -> None:
        self._packets.post(self.now(), datagram, super().post)

    def _step(self, time_s: float) -> None:
        self._packets.release(time_s, super().post)
        super()._step(time_s)
        place, velocity, _ = self.simulation.onboard.vehicle.true_pose()
        if place[2] > IN_THE_AIR_M:
            self._high_s = min(self._high_s, time_s)
        self.sank_m_s = max(self.sank_m_s, -float(velocity[2]))
