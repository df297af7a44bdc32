"""The simulated Crazyflie behind UDP sockets: one client at a time, poses to whoever asked, real time."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Callable
from types import TracebackType

from ...errors import InputError
from ..crtp import NULL, Port, parse
from ..mocap.pose_datagram import PORT_OFFSET, SUBSCRIPTION_S
from .channel import RadioOptions
from .motion_capture import MocapOptions
from .onboard_services import Build
from .simulation import Simulation
from .supervisor import State
from .vehicle_protocol import Vehicle

SILENCE_S, CLOSED_S = 1.0, 0.3  # of the host's own clock
"""A client that is silent for so long has gone; the shorter one holds after the zero set-point cflib closes with."""
WAITING_S = 2.0
"""How long a refused client is remembered."""
LATE_S, MOST_BEHIND_S, STOP_S = 0.010, 0.5, 5.0
_MOST_AT_ONCE = 64
_CLOSING = bytes(14)

Address = tuple[str, int]


class SimulatedCrazyflie:
    """A vehicle that is served at ``uri`` from ``start`` to ``stop``, or within a ``with``.

    port 0 takes a free one; poses are at port + 100. drift_ppm of the vehicle's ticks against the host's clock.
    ``build``: special properties of its firmware (a positioning deck, another protocol version). ``pace``: seconds of
    the vehicle's world in one of the host. ``report``: receives one line on every event of clients. ``swap_battery``:
    every client finds the vehicle at its start with a battery as at first, unless it flies. With ``own_clock``
    there is no thread and no socket: time passes in ``advance``. ``start`` raises InputError when an address cannot be
    had.
    """

    def __init__(self, vehicle: Vehicle, host: str = "127.0.0.1", port: int = 0, *, radio: RadioOptions | None = None,
                 mocap: MocapOptions | None = None, drift_ppm: float = 0.0, build: Build | None = None,
                 pace: float = 1.0, own_clock: bool = False, report: Callable[[str], None] = lambda line: None,
                 swap_battery: bool = False) -> None:
        self._host, self._port, self._report, self._own_clock, self._pace = host, port, report, own_clock, pace
        self._swap_battery = swap_battery
        self._make: Callable[[float], Simulation] = lambda start_s: Simulation(
            vehicle, start_s, radio or RadioOptions(), mocap or MocapOptions(), drift_ppm, build)
        self.simulation = self._make(0.0)
        self._client: Address | None = None
        self._heard_s = 0.0
        self._closing = False
        self._waiting: tuple[Address, bytes, float] | None = None
        self._refused: set[Address] = set()
        self._viewers: dict[Address, float] = {}
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self.turns = self.late = 0
        self.stood_s = 0.0
        self.broken: Exception | None = None

    @property
    def uri(self) -> str:
        """For cflib."""
        return f"udp://{self._host}:{self._port}"

    @property
    def mocap_address(self) -> Address:
        """Where poses are to be had."""
        return self._host, self._mocap_port

    def __enter__(self) -> SimulatedCrazyflie:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.stop()

    def start(self) -> None:
        """Takes the addresses and begins to serve in a separate thread."""
        if self._own_clock:
            return
        self._radio_socket = _bound(self._host, self._port)
        self._port = self._radio_socket.getsockname()[1]
        wanted = self._port + PORT_OFFSET
        try:
            self._mocap_socket = _bound(self._host, wanted if wanted < 65536 else 0)
        except InputError:
            self._radio_socket.close()
            raise
        self._mocap_port = self._mocap_socket.getsockname()[1]
        self._zero_s, self._zero_monotonic_s = time.time(), time.monotonic()
        self.simulation = self._make(self._now())
        self._stopping.clear()
        self._thread = threading.Thread(target=self._serve, name=f"simulated {self.uri}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread and gives the addresses back."""
        if self._thread is None:
            return
        self._stopping.set()
        self._thread.join(STOP_S)
        self._thread = None
        self._radio_socket.close()
        self._mocap_socket.close()

    def summary(self) -> str:
        """What went over the air and how late the server was, in one line."""
        down, up = self.simulation.down, self.simulation.up
        return (f"{self.turns} turns, {self.late} more than {1e3 * LATE_S:.0f} ms late, stood still for "
                f"{self.stood_s:.1f} s; packets lost: up {up.lost}, down {down.lost}, full queue {down.full}")

    def _now(self) -> float:
        """The clock of this world: Unix time that does not jump, from the start on at its own pace."""
        return self._zero_s + self._pace * (time.monotonic() - self._zero_monotonic_s)

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                self._turn()
        except Exception as error:  # a bug, which must not be silent in a thread
            self.broken = error
            self._report(f"the simulated vehicle stopped: {type(error).__name__}: {error}")
            raise

    def _turn(self) -> None:
        simulation = self.simulation
        due = simulation.next_s()
        wait = min(max(due - self._now(), 0.0) / self._pace, 0.05)
        ready, _, _ = select.select([self._radio_socket, self._mocap_socket], [], [], wait)
        now = self._now()
        self.turns += 1
        self.late += now - due > LATE_S * self._pace
        if self._radio_socket in ready:
            self._receive(now)
        if self._mocap_socket in ready:
            self._subscribe(now)
        self._change_client()
        self._not_too_far(now)
        simulation.run_until(now)
        for datagram in simulation.outgoing(now):
            if self._client is not None:
                _send(self._radio_socket, datagram, self._client)
        poses = simulation.mocap.due(now)
        self._viewers = {viewer: until for viewer, until in self._viewers.items() if until > now}
        for datagram in poses:
            for viewer in self._viewers:
                _send(self._mocap_socket, datagram, viewer)

    def _not_too_far(self, now: float) -> None:
        """A machine that is too busy, or was asleep, lets the world stand still; else it would never catch up."""
        behind = now - self.simulation.time_s
        if behind > MOST_BEHIND_S * self._pace:
            self.simulation.stand_still_until(now)
            self.stood_s += behind

    def _receive(self, now: float) -> None:
        """Datagrams of the client, of those who scan, and of strangers."""
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram, sender = self._radio_socket.recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                return
            if datagram[:1] == NULL or parse(datagram) is None:
                if len(datagram) == 1 and datagram[0] & 0xF3 == 0xF3:
                    _send(self._radio_socket, NULL, sender)
                continue
            if self._client is None:
                self._accept(sender)
            if sender != self._client:
                self._refuse(sender, datagram)
                continue
            self._heard_s = time.monotonic()
            packet = parse(datagram)
            self._closing = packet is not None and packet.port == Port.RPYT and packet.data == _CLOSING
            self.simulation.post(now, datagram)

    def _accept(self, sender: Address) -> None:
        self._client, self._closing, self._heard_s = sender, False, time.monotonic()
        if self.simulation.onboard.supervisor.state in (State.LOCKED, State.CRASHED):
            self._report("the vehicle was locked or had crashed: it is put back and switched on again")
            self.simulation.restart()
        elif self._swap_battery and not self.simulation.onboard.supervisor.flying:
            self.simulation.restart()
        self._refused.discard(sender)
        self._report(f"{sender[0]}:{sender[1]} is connected")

    def _refuse(self, sender: Address, datagram: bytes) -> None:
        """A stranger while there is a client: not answered; its wish to connect is remembered for a while."""
        packet = parse(datagram)
        if packet is not None and packet.port == Port.LINK and packet.channel == 1:
            self._waiting = (sender, datagram, time.monotonic())
        if sender not in self._refused:
            if len(self._refused) > 1000:
                self._refused.clear()
            self._refused.add(sender)
            self._report(f"{sender[0]}:{sender[1]} is not answered: the vehicle has a client")

    def _change_client(self) -> None:
        """A client that is silent has gone; who asked in the meantime is next."""
        now = time.monotonic()
        if self._client is None or now - self._heard_s < (CLOSED_S if self._closing else SILENCE_S):
            return
        self._report(f"{self._client[0]}:{self._client[1]} has gone")
        self._client = None
        if self._waiting is not None:
            sender, datagram, requested = self._waiting
            self._waiting = None
            if now - requested < WAITING_S:
                self._accept(sender)
                self.simulation.post(self._now(), datagram)

    def _subscribe(self, now: float) -> None:
        for _ in range(_MOST_AT_ONCE):
            try:
                _, sender = self._mocap_socket.recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                return
            if len(self._viewers) < 100 or sender in self._viewers:
                self._viewers[sender] = now + SUBSCRIPTION_S

    def advance(self, seconds: float) -> list[bytes]:
        """Own clock only: so much time passes; the datagrams that reach the client in it."""
        simulation = self.simulation
        if not self._own_clock:
            raise ValueError("a vehicle that is served in real time cannot be advanced")
        until = simulation.time_s + seconds
        simulation.run_until(until)
        return simulation.outgoing(until)

    def post(self, datagram: bytes) -> bool:
        """Own clock only: a datagram of the client now."""
        if not self._own_clock:
            raise ValueError("a vehicle that is served in real time hears its socket")
        return self.simulation.post(self.simulation.time_s, datagram)


def _bound(host: str, port: int) -> socket.socket:
    """A UDP socket at an address; InputError when it cannot be had."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind((host, port))
    except (OSError, OverflowError) as error:
        made.close()
        raise InputError(f"udp://{host}:{port}", f"cannot be served: {error}",
                         "give another port, or an address of this machine") from error
    made.setblocking(False)
    return made


def _send(through: socket.socket, datagram: bytes, to: Address) -> None:
    """What cannot be sent is lost, as on the air."""
    try:
        through.sendto(datagram, to)
    except OSError:
        return
