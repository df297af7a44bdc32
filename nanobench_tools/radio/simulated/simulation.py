"""Vehicle, radio and motion capture on one clock of the host, without sockets: datagrams in, datagrams out."""

from ..crtp import Packet, pack, parse
from .channel import Channel, RadioOptions, repeated
from .motion_capture import MocapOptions, MotionCapture
from .onboard_services import SLICE_MS, Build, Onboard
from .vehicle_protocol import Vehicle


class Simulation:
    """Begins at the host's time ``start_s``; ``run_until`` goes on from there, as fast as it can.

    drift_ppm: the vehicle's ticks are this much faster than the host's clock; the world goes by the ticks.
    """

    def __init__(self, vehicle: Vehicle, start_s: float, radio: RadioOptions, mocap: MocapOptions,
                 drift_ppm: float = 0.0, build: Build | None = None) -> None:
        self.onboard = Onboard(vehicle, build)
        self.up: Channel[Packet] = Channel(radio, 1, False, start_s)
        self.down: Channel[Packet] = Channel(radio, 2, True, start_s)
        self.mocap = MotionCapture(mocap, start_s)
        self.time_s = self._start_s = start_s
        self._start_ms = self.onboard.tick_ms
        self._rate = 1000.0 * (1.0 + 1e-6 * drift_ppm)

    def restart(self) -> None:
        """The vehicle is put back and switched on again; nothing is on the air."""
        vehicle, build = self.onboard.vehicle, self.onboard.build
        vehicle.restart()
        self.onboard = Onboard(vehicle, build)
        self.up.clear()
        self.down.clear()
        self._start_s, self._start_ms = self.time_s, self.onboard.tick_ms

    def stand_still_until(self, time_s: float) -> None:
        """The world does not go on between the last ``run_until`` and a time of the host."""
        self._start_s += time_s - self.time_s
        self.time_s = time_s
        self.mocap.skip_to(time_s)

    def tick_at(self, time_s: float) -> int:
        """The vehicle's tick at a time of the host."""
        return self._start_ms + int((time_s - self._start_s) * self._rate + 1e-6)

    def time_of(self, tick_ms: int) -> float:
        """The host's time at the beginning of a tick."""
        return self._start_s + (tick_ms - self._start_ms) / self._rate

    def post(self, time_s: float, datagram: bytes) -> bool:
        """A client's datagram enters the air at a time; False for what is no packet."""
        packet = parse(datagram)
        if packet is None:
            return False
        self.up.send(time_s, packet, repeated(packet))
        return True

    def run_until(self, time_s: float) -> None:
        """Everything up to a time of the host, in order."""
        while True:
            arrival, exposure = self.up.next_s(), self.mocap.next_s
            at = min(arrival, exposure, time_s)
            self._advance(at)
            if exposure <= at:
                self._expose(exposure)
            for packet in self.up.due(at):
                self._reply(at, self.onboard.receive(packet))
            if at >= time_s:
                self.time_s = max(self.time_s, time_s)
                return

    def outgoing(self, time_s: float) -> list[bytes]:
        """Datagrams that have arrived at the client by a time."""
        return [pack(packet) for packet in self.down.due(time_s)]

    def next_s(self) -> float:
        """When there is something to do next."""
        tick = self.onboard.tick_ms
        due = self.onboard.log.due_ms()
        beat = tick - tick % SLICE_MS + SLICE_MS
        return min(self.up.next_s(), self.down.next_s(), self.mocap.next_s, self.mocap.sent_s(),
                   self.time_of(beat if due is None else min(beat, due)))

    def _advance(self, time_s: float) -> None:
        for sent in self.onboard.advance(self.tick_at(time_s)):
            self.down.send(self.time_of(sent.tick_ms), sent.packet, repeated(sent.packet))

    def _expose(self, time_s: float) -> None:
        """The pose between two ticks, from the velocity at the first."""
        position, velocity, quaternion = self.onboard.vehicle.true_pose()
        since = time_s - self.time_of(self.onboard.tick_ms)
        self.mocap.expose(position + since * velocity, quaternion)

    def _reply(self, time_s: float, packets: list[Packet]) -> None:
        for packet in packets:
            self.down.send(time_s, packet, repeated(packet))


