"""A simulated vehicle in this process, flown through cflib on a clock of its own: as fast as the machine can, and the
same every time.

cflib is given one more link driver, whose other end is the simulated vehicle. Time stands while anybody works: it goes
on when the flight waits, a millisecond at a time, and at every one cflib's threads have taken in what has come.
Computing takes no time here; jitter and deadlines are measured against the real clock only.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .mocap import Sink
from .pose_datagram import unpack
from .simulated.channel import RadioOptions
from .simulated.motion_capture import MocapOptions
from .simulated.simulation import Simulation
from .simulated.vehicle import Vehicle

STEP_S = 0.001
SETTLE_S = 0.5
"""So long at most cflib may take over what has come, in real time."""
START_S = 1_800_000_000.0
URI = "virtual://0"


class VirtualWorld:
    """A vehicle, its radio and its motion capture; clock (``now``, ``sleep_until``) and source of poses at once."""

    name = "virtual"
    real = False
    synthetic = True

    def __init__(self, vehicle: Vehicle, radio: RadioOptions | None = None, mocap: MocapOptions | None = None) -> None:
        self.simulation = Simulation(vehicle, START_S, radio or RadioOptions(), mocap or MocapOptions())
        self.down = False
        """True: the link is gone, nothing passes in either direction."""
        self.blind = False
        """True: no poses come."""
        self.inbox: queue.Queue[bytes] = queue.Queue()
        self.idle = threading.Event()
        self._time_s, self._steps = START_S, 0
        self._sink: Sink | None = None

    def now(self) -> float:
        return self._time_s

    def sleep_until(self, time_s: float) -> None:
        """Lets the world go on until then, in whole steps."""
        while self._time_s < time_s - 1e-6:
            self._steps += 1
            self._step(START_S + STEP_S * self._steps)

    def _step(self, time_s: float) -> None:
        simulation = self.simulation
        simulation.run_until(time_s)
        self._time_s = time_s
        came = [] if self.down else simulation.outgoing(time_s)
        if came:
            self.idle.clear()
            for datagram in came:
                self.inbox.put(datagram)
        self.idle.wait(SETTLE_S)
        for datagram in simulation.mocap.due(time_s):
            if self._sink is not None and not self.blind:
                self._sink(unpack(datagram))

    def post(self, datagram: bytes) -> None:
        """What cflib sends."""
        if not self.down:
            self.simulation.post(self._time_s, datagram)

    # -- source of poses

    def start(self, sink: Sink) -> None:
        self._sink = sink

    def setpoint(self, time_s: float, said: dict[str, object]) -> None:
        """Not of interest here."""

    def close(self) -> None:
        self._sink = None

    @contextmanager
    def served(self) -> Iterator[str]:
        """The URI under which cflib finds this world, within a ``with``; one world at a time."""
        import cflib.crtp

        if not cflib.crtp.CLASSES:
            cflib.crtp.init_drivers()
        driver = _driver(self)
        cflib.crtp.CLASSES.insert(0, driver)
        try:
            yield URI
        finally:
            cflib.crtp.CLASSES.remove(driver)


def _driver(world: VirtualWorld) -> type:
    from cflib.crtp.crtpdriver import CRTPDriver
    from cflib.crtp.crtpstack import CRTPPacket
    from cflib.crtp.exceptions import WrongUriType

    class VirtualDriver(CRTPDriver):
        """The client's end of the radio."""

        def __init__(self) -> None:
            super().__init__()
            self.needs_resending = False

        def connect(self, uri: str, statistics: Any, error: Any) -> None:
            if uri != URI:
                raise WrongUriType

        def send_packet(self, packet: Any) -> None:
            world.post(bytes([packet.header]) + bytes(packet.data))

        def receive_packet(self, wait: float = 0) -> Any:
            try:
                datagram = world.inbox.get_nowait()
            except queue.Empty:
                world.idle.set()  # all is taken in: time may go on
                try:
                    datagram = world.inbox.get(timeout=max(wait, 0.01))
                except queue.Empty:
                    return None
            return CRTPPacket(header=datagram[0], data=datagram[1:])

        def close(self) -> None:
            world.idle.set()

    return VirtualDriver
