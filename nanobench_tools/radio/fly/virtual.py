"""A simulated vehicle in this process, flown through cflib on a separate clock: as fast as possible and repeatable.

cflib gets one more link driver, whose other end is the simulated vehicle. Time advances only while the flight waits, a
millisecond at a time, and at every one cflib receives the packets that have come. Its incoming packet handler runs in
the waiting thread, not in its own, whose turn would depend on the machine. The clock also waits for its threads that
request parameters until they have sent what they can.

Computing takes no time here; jitter and deadlines are measured against the real clock only.
"""

import itertools
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..mocap.pose_datagram import unpack
from ..mocap.pose_source import Sink
from ..simulated.channel import RadioOptions
from ..simulated.motion_capture import MocapOptions
from ..simulated.simulation import Simulation
from ..simulated.vehicle_protocol import Vehicle

STEP_S = 0.001
SETTLE_S = 5.0
"""So long at most cflib's threads may take to send their next request, in real time."""
START_S, APART_S = 1_800_000_000.0, 3600.0
"""Worlds begin an hour apart, in the order in which they are made: sheets belong to recordings by time."""
URI = "virtual://0"


class VirtualWorld:
    """A vehicle, its radio and its motion capture; clock (``now``, ``sleep_until``) and source of poses at once."""

    name = "virtual"
    real = False
    synthetic = True
    _worlds = itertools.count()

    def __init__(self, vehicle: Vehicle, radio: RadioOptions | None = None, mocap: MocapOptions | None = None,
                 uri: str = URI, start_s: float | None = None) -> None:
        self.uri = uri
        self._start_s = START_S + APART_S * next(self._worlds) if start_s is None else start_s
        self.simulation = Simulation(vehicle, self._start_s, radio or RadioOptions(), mocap or MocapOptions())
        self.down = False
        """True: the link is gone, nothing passes in either direction."""
        self.blind = False
        """True: no poses come."""
        self.inbox: deque[bytes] = deque()
        self.crazyflie: Any = None
        self._time_s, self._steps = self._start_s, 0
        self._sink: Sink | None = None
        self._waiting_for: dict[threading.Thread, tuple[int, Any]] = {}
        self._in_vain: dict[threading.Thread, tuple[int, int]] = {}

    def now(self) -> float:
        return self._time_s

    def sleep_until(self, time_s: float) -> None:
        """Lets the world go on until then, in whole steps."""
        while self._time_s < time_s - 1e-6:
            self._steps += 1
            self._step(self._start_s + STEP_S * self._steps)

    def _step(self, time_s: float) -> None:
        simulation = self.simulation
        self._settle()
        simulation.run_until(time_s)
        self._time_s = time_s
        came = simulation.outgoing(time_s)
        if came and not self.down and self.crazyflie is not None:
            self.inbox.extend(came)
            self._take_in()
        for datagram in simulation.mocap.due(time_s):
            if self._sink is not None and not self.blind:
                self._sink(unpack(datagram))

    def _take_in(self) -> None:
        """cflib's handler until nothing is left."""
        handler = self.crazyflie.incoming
        handler._stop_event.clear()
        handler.run()
        handler._stop_event.clear()

    def _settle(self) -> None:
        """Waits until cflib's threads that ask for parameters have nothing to send, or wait for answers themselves.

        Threads that an earlier link left behind have nothing to send here, and none is waited for twice in one state.
        """
        if self.crazyflie is None:
            return
        mine: list[Any] = [thread for thread in threading.enumerate() if _asks_for(thread, self.crazyflie)]
        for asker in mine:
            until = time.monotonic() + SETTLE_S
            while asker.is_alive():
                ticket, awaited = self._waiting_for.get(asker, (0, None))
                # its queue is never informed of finished tasks: it counts all that was ever put in
                asked = asker.request_queue.unfinished_tasks
                waits = awaited is not None and _awaited(asker) is awaited
                if waits or ticket >= asked or self._in_vain.get(asker) == (ticket, asked):
                    break
                if time.monotonic() > until:
                    self._in_vain[asker] = ticket, asked
                    break
                time.sleep(1e-4)

    def _sent(self, thread: threading.Thread) -> None:
        """Counts what such a thread has sent, and keeps what it waits for now."""
        if hasattr(thread, "request_queue"):
            self._waiting_for[thread] = self._waiting_for.get(thread, (0, None))[0] + 1, _awaited(thread)

    def post(self, datagram: bytes) -> None:
        """What cflib sends."""
        if not self.down:
            self.simulation.post(self._time_s, datagram)

    # -- source of poses

    def start(self, sink: Sink) -> None:
        self._sink = sink

    def setpoint(self, time_s: float, command: dict[str, object]) -> None:
        """Not of interest here."""

    def close(self) -> None:
        self._sink = None

    @contextmanager
    def served(self) -> Iterator[str]:
        """The URI under which cflib finds this world, within a ``with``."""
        import cflib.crtp

        if not cflib.crtp.CLASSES:
            cflib.crtp.init_drivers()
        driver = _driver(self)
        cflib.crtp.CLASSES.insert(0, driver)
        try:
            yield self.uri
        finally:
            cflib.crtp.CLASSES.remove(driver)


def _asks_for(thread: Any, crazyflie: Any) -> bool:
    """Whether it is one of cflib's threads that ask ``crazyflie`` for parameters."""
    return hasattr(thread, "request_queue") and getattr(thread, "cf", getattr(thread, "_cf", None)) is crazyflie


def _awaited(asker: Any) -> Any:
    """What one of cflib's threads waits for, None if it is free to go on."""
    found = asker._lock_pattern if hasattr(asker, "_lock_pattern") else asker._req_param
    return None if found == -1 else found


def _driver(world: VirtualWorld) -> type:
    from cflib.crtp.crtpdriver import CRTPDriver
    from cflib.crtp.crtpstack import CRTPPacket
    from cflib.crtp.exceptions import WrongUriType

    class VirtualDriver(CRTPDriver):  # type: ignore[misc]
        """The client's end of the radio."""

        def __init__(self) -> None:
            super().__init__()
            self.needs_resending = False
            self._closed = threading.Event()

        def connect(self, uri: str, statistics: Any, error: Any) -> None:
            if uri != world.uri:
                raise WrongUriType
            world.inbox.clear()
            world.crazyflie = error.__self__  # drivers report errors to the Crazyflie that opens them

        def send_packet(self, packet: Any) -> None:
            world.post(bytes([packet.header]) + bytes(packet.data))
            world._sent(threading.current_thread())

        def receive_packet(self, wait: float = 0) -> Any:
            handler = world.crazyflie.incoming
            if threading.current_thread() is handler:  # its own thread has nothing to do
                self._closed.wait(max(wait, 0.01))
                return None
            if world.inbox:
                datagram = world.inbox.popleft()
                return CRTPPacket(header=datagram[0], data=datagram[1:])
            handler._stop_event.set()  # back to who waits
            return None

        def close(self) -> None:
            self._closed.set()
            world.crazyflie = None

    return VirtualDriver
