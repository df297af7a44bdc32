"""The link to a vehicle as flying and recording need it, through cflib (GPL-3.0; imported here and nowhere else).

``Link`` is what ``fly`` and ``record`` are written against; ``CflibLink`` is the one there is.
"""

import logging
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlparse

import numpy as np

from ..errors import InputError, MissingExtraError
from .blocks import HALF, Block, check_half_precision, check_numbers, resolve
from .crazyflie import close, crazyflie
from .host_clock import Clock

ANSWER_S, PARAMETERS_S, SET_S, BLOCKS_S = 5.0, 15.0, 1.0, 2.0
"""How long an answer is waited for: any at all, all tables and parameters, one written parameter, log blocks."""
RETRY_S = 1.0
"""Interval between attempts to reach a vehicle that is still starting."""
PROTOCOLS = (9, 12)
"""Oldest and newest CRTP version whose set-points are known here (9: signs of yaw rates as today's)."""
SCHEMES = ("radio", "udp", "tcp", "usb", "serial", "prrt", "virtual")
"""``virtual`` is a simulated vehicle in this process on a separate clock (``virtual``)."""
GENERIC, HIGH_LEVEL, LOCALIZATION, LOG, PLATFORM, ECHO = 7, 8, 6, 5, 13, 15
VERSION, FIRMWARE = 1, 1
"""Channel of the platform port, and its command that requests the version of the firmware."""
HL_STOP, HL_TAKEOFF, HL_LAND = 3, 7, 8
EMERGENCY_STOP = 3
"""On the localization port: the motors stop, and the vehicle is locked until it is switched off and on."""
FLYING = 1 << 4
"""Bit of ``supervisor.info``: set until two seconds after the motors. Closing a link before would lock the vehicle."""
TICKS_S = 2**24 / 1000.0
"""The tick of a log packet begins anew after so long."""
ECHO_MARK = 1
"""First byte of our echoes; cflib's have 0."""

ALARMS = ("assert", "out of bounds, resetting", "brownout", "i2c bus error", "sensors: fail", "self test [fail]",
          "no setpoint, levelling out")
"""Parts of console lines of firmware 2025.12.1, in lower case, after which a flight should not go on."""



class NotStartedError(InputError):
    """The vehicle does not answer, or not yet completely: it may still be starting."""


LogSink = Callable[[int, float, bytes], None]
"""(number of the block, host time, tick and values as they came)."""


class Link(Protocol):
    """``uri``; ``lost``: why the link is gone, "" while it is up; ``heard_s``: host time of the last packet;
    ``round_trips_s``: the last echoes; ``echoed_s``: when the newest of them was requested; ``values``: last value of
    each logged variable, ``logged_s``: the host time at which it came; ``log_late_s``: by how much later than the
    fastest the newest log packet came, by the vehicle's clock; ``planner_answers``: command of the high-level
    commander -> host time and error of its last answer; ``alarm``: the first console line that reports a failure, ""
    without."""

    uri: str
    lost: str
    heard_s: float
    round_trips_s: deque[float]
    echoed_s: float
    log_late_s: float
    values: Mapping[str, float]
    logged_s: Mapping[str, float]
    alarm: str
    planner_answers: Mapping[int, tuple[float, int]]

    def send_setpoint(self, packet: bytes) -> None: ...

    def release(self) -> None: ...

    def send_pose(self, position_m: np.ndarray, quaternion: np.ndarray) -> None: ...

    def arm(self, on: bool) -> None: ...

    def take_off(self, height_m: float, duration_s: float) -> None: ...

    def land(self, height_m: float, duration_s: float) -> None: ...

    def stop_planner(self) -> None: ...

    def emergency_stop(self) -> None: ...

    def set_parameter(self, name: str, value: float) -> None: ...

    def request_echo(self) -> None: ...


class CflibLink:
    """An open link. Use ``open_link``."""

    def __init__(self, uri: str, cache: Path | None, clock: Clock) -> None:
        self.uri, self.lost, self.heard_s, self._clock = uri, "", 0.0, clock
        self.round_trips_s: deque[float] = deque(maxlen=50)
        self.echoed_s = self.log_late_s = 0.0
        self._fastest_s = np.inf
        self._last: dict[str, float] = {}
        self.values: Mapping[str, float] = self._last
        self._came_s: dict[str, float] = {}
        self.logged_s: Mapping[str, float] = self._came_s
        self.blocks: list[Block] = []
        self.on_log: LogSink | None = None
        self.on_echo: Callable[[float, float], None] | None = None
        self.on_sent: Callable[[float, int, bytes], None] | None = None
        self._numbers: dict[int, int] = {}
        self._layouts: list[struct.Struct] = []
        self._complete = threading.Event()
        self._firmware: str | None = None
        self._failed = ""
        self.alarm, self._console = "", ""
        self._cf = crazyflie(cache, self._on_lost)
        self._cf.connection_failed.add_callback(self._on_failed)
        self._cf.console.receivedChar.add_callback(self._on_console)
        self._cf.fully_connected.add_callback(lambda _: self._complete.set())
        self._cf.add_header_callback(self._on_log, LOG, 2)
        self._cf.add_header_callback(self._on_echo, ECHO, 0)
        self._answers: dict[int, tuple[float, int]] = {}
        self.planner_answers: Mapping[int, tuple[float, int]] = self._answers
        self._cf.add_header_callback(self._on_planner, HIGH_LEVEL, 0)
        self._cf.add_header_callback(self._on_version, PLATFORM, VERSION)

    # -- opening

    def open(self, patience_s: float = 0.0) -> None:
        """Raises NotStartedError for no answer or tables that do not come, InputError for a wrong protocol version.
        ``patience_s``: longer limit for the tables of a vehicle that answers."""
        self._cf.packet_received.add_callback(self._on_any)
        clock = self._clock
        started = clock.now()
        self._cf.open_link(self.uri)
        while not self._complete.is_set():
            clock.sleep_until(clock.now() + 0.01)
            waited = clock.now() - started
            if why := self._failed or self.lost:
                raise NotStartedError(self.uri, f"no link ({why})", "is it switched on, in reach, free?")
            if not self.heard_s and waited > ANSWER_S:
                raise NotStartedError(self.uri, f"no answer in {ANSWER_S:.0f} s", "is it switched on, in reach, and "
                                        "not connected to another program?")
            if self.heard_s:
                self._check_version()
            if waited > max(ANSWER_S + PARAMETERS_S, patience_s):
                raise NotStartedError(self.uri, f"answers, but its tables did not come within {waited:.0f} s",
                                 "bring it closer, or is another program connected to it?")
        self._check_version(final=True)

    def _check_version(self, final: bool = False) -> None:
        found = self._cf.platform.get_protocol_version()
        if (found >= 0 or final) and not PROTOCOLS[0] <= found <= PROTOCOLS[1]:
            raise InputError(self.uri, f"CRTP protocol version {found}", f"versions {PROTOCOLS[0]} to {PROTOCOLS[1]} "
                             "are known here; flash firmware 2025.12")

    def close(self) -> None:
        """Closes the link; on the ground with a set-point of nothing, which stops motors. A vehicle that flies is left
        to its own planner and watchdog."""
        self.on_log = self.on_echo = self.on_sent = None
        close(self._cf, motors_off=not int(self._last.get("supervisor.info", 0)) & FLYING)

    @property
    def udp_port(self) -> int:
        """Local port of a link over UDP, 0 for others."""
        try:
            return int(self._cf.link.socket.getsockname()[1]) if self.uri.startswith("udp://") else 0
        except (AttributeError, OSError):
            return 0

    @property
    def version(self) -> int:
        return int(self._cf.platform.get_protocol_version())

    def firmware(self) -> str:
        """Version of the firmware in its own words, such as 2025.12.1; "" if it does not answer."""
        until = self._clock.now() + SET_S
        while self._firmware is None and self._clock.now() < until:
            self._send(PLATFORM, VERSION, bytes([FIRMWARE]))
            self._clock.sleep_until(self._clock.now() + 0.1)
        return self._firmware or ""

    def _on_version(self, packet: Any) -> None:
        if packet.data and packet.data[0] == FIRMWARE:
            self._firmware = bytes(packet.data[1:]).split(b"\0")[0].decode("ascii", "replace").strip()

    @property
    def log_types(self) -> dict[str, str]:
        """Log variable -> type on board."""
        return {f"{group}.{name}": found.ctype for group, members in self._cf.log.toc.toc.items()
                for name, found in members.items()}

    @property
    def parameters(self) -> set[str]:
        return {f"{group}.{name}" for group, members in self._cf.param.toc.toc.items() for name in members}

    # -- logging

    def start_blocks(self, blocks: Sequence[Block]) -> list[Block]:
        """Starts further log blocks; returns all that run now, with their types.

        Raises InputError for a variable the vehicle does not have, too large a block, or one that does not start.
        """
        from cflib.crazyflie.log import LogConfig

        wanted = resolve(blocks, self.log_types, self.uri)
        check_numbers([*self.blocks, *wanted], self.uri)
        if any(HALF in block.types for block in wanted):
            check_half_precision(wanted, self.firmware(), self.uri)
        started = []
        for block in wanted:
            config = LogConfig(block.name, block.period_ms)
            for name, kind in zip(block.variables, block.types, strict=True):
                config.add_variable(name, kind)
            self._cf.log.add_config(config)
            self._numbers[config.id] = len(self.blocks)
            self.blocks.append(block)
            self._layouts.append(block.layout)
            config.start()
            started.append(config)
        clock = self._clock
        until = clock.now() + BLOCKS_S
        while late := [config for config in started if not config.started]:
            if clock.now() > until:
                raise InputError(self.uri, f"log block {late[0].name!r} did not start (error {late[0].err_no})",
                                 "take fewer blocks or variables")
            clock.sleep_until(clock.now() + 0.005)
        return list(self.blocks)

    def _on_log(self, packet: Any) -> None:
        now = self._clock.now()
        data = bytes(packet.data)
        number = self._numbers.get(data[0])
        if number is None:
            return
        if self.on_log is not None:
            self.on_log(number, now, data[1:])
        self._note_late(now - int.from_bytes(data[1:4], "little") / 1000.0)
        layout, block = self._layouts[number], self.blocks[number]
        if len(data) == 4 + layout.size:
            self._last.update(zip(block.variables, layout.unpack_from(data, 4), strict=True))
            self._came_s.update(dict.fromkeys(block.variables, now))

    def _note_late(self, offset_s: float) -> None:
        """``offset_s``: of the host's clock to the tick of a log packet. Ticks have 24 bits."""
        if abs(offset_s - self._fastest_s) > TICKS_S / 2.0:  # the first one, or the ticks began anew
            self._fastest_s = offset_s
        self._fastest_s = min(self._fastest_s, offset_s)
        self.log_late_s = offset_s - self._fastest_s

    # -- what is seen of the link

    def _on_any(self, _: Any) -> None:
        self.heard_s = self._clock.now()

    def _on_echo(self, packet: Any) -> None:
        if len(packet.data) == 9 and packet.data[0] == ECHO_MARK:
            now = self._clock.now()
            requested = struct.unpack("<Bd", bytes(packet.data))[1]
            self.round_trips_s.append(now - requested)
            self.echoed_s = requested
            if self.on_echo is not None:
                self.on_echo(now, requested)

    def _on_planner(self, packet: Any) -> None:
        """The firmware answers with the command, and its error in the fourth byte."""
        if len(packet.data) >= 4:
            self._answers[packet.data[0]] = (self._clock.now(), packet.data[3])

    def _on_console(self, text: str) -> None:
        *lines, self._console = (self._console + text).split("\n")
        self.alarm = self.alarm or next((line for line in lines if any(w in line.lower() for w in ALARMS)), "")

    def _on_failed(self, _: str, why: str) -> None:
        self._failed = why.strip().splitlines()[0] if why.strip() else "failed"

    def _on_lost(self, why: str) -> None:
        self.lost = why.strip().splitlines()[0] if why.strip() else "lost"

    def request_echo(self) -> None:
        """Measures the time of a round trip, apart from cflib's own echoes; to be called now and then."""
        self._send(ECHO, 0, struct.pack("<Bd", ECHO_MARK, self._clock.now()))

    # -- sending

    def _send(self, port: int, channel: int, data: bytes) -> None:
        from cflib.crtp.crtpstack import CRTPPacket

        packet = CRTPPacket()
        packet.set_header(port, channel)
        packet.data = data
        self._cf.send_packet(packet)
        if self.on_sent is not None and port not in (LOCALIZATION, ECHO):
            self.on_sent(self._clock.now(), port << 4 | channel, data)

    def send_setpoint(self, packet: bytes) -> None:
        """A packet of ``setpoint_packets``."""
        self._send(GENERIC, 0, packet)

    def release(self) -> None:
        """Set-points end here: the high-level commander may take over at once."""
        self._send(GENERIC, 1, struct.pack("<BI", 0, 0))

    def send_pose(self, position_m: np.ndarray, quaternion: np.ndarray) -> None:
        self._send(LOCALIZATION, 1, struct.pack("<B7f", 8, *position_m, *quaternion))

    def arm(self, on: bool) -> None:
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # cflib warns that older protocols arm another way, and does it
            self._cf.supervisor.send_arming_request(on)

    def take_off(self, height_m: float, duration_s: float) -> None:
        """To an absolute height by the vehicle's own planner, keeping its heading."""
        self._send(HIGH_LEVEL, 0, struct.pack("<BBff?f", HL_TAKEOFF, 0, height_m, 0.0, True, duration_s))

    def land(self, height_m: float, duration_s: float) -> None:
        """The same downwards; its planner switches the motors off at the end."""
        self._send(HIGH_LEVEL, 0, struct.pack("<BBff?f", HL_LAND, 0, height_m, 0.0, True, duration_s))

    def stop_planner(self) -> None:
        """The high-level commander stops: without set-points the motors stop, too."""
        self._send(HIGH_LEVEL, 0, struct.pack("<BB", HL_STOP, 0))

    def emergency_stop(self) -> None:
        self._send(LOCALIZATION, 1, bytes([EMERGENCY_STOP]))

    def write_parameter(self, name: str, value: float) -> None:
        """Writes without waiting for the echo: the vehicle takes back some, such as the start of a test."""
        self._cf.param.set_value(name, str(value))

    def set_parameter(self, name: str, value: float) -> None:
        """Writes and waits for the echo. Raises InputError for an unknown parameter or no echo."""
        if name not in self.parameters:
            raise InputError(self.uri, f"the vehicle has no parameter {name}", "another firmware?")
        seen = threading.Event()
        group, _, short = name.partition(".")

        def note(_: str, found: str) -> None:
            if float(found) == float(value):
                seen.set()

        self._cf.param.add_update_callback(group=group, name=short, cb=note)
        try:
            for _ in range(3):
                self._cf.param.set_value(name, str(value))
                until = self._clock.now() + SET_S
                while not seen.is_set() and self._clock.now() < until:
                    self._clock.sleep_until(self._clock.now() + 0.005)
                if seen.is_set():
                    return
        finally:
            self._cf.param.remove_update_callback(group, short, note)
        raise InputError(self.uri, f"parameter {name} was not taken over", "bring the vehicle closer")


def check_uri(uri: str) -> None:
    """Raises InputError for a URI of no known kind."""
    found = urlparse(uri)
    try:
        port = found.port if found.scheme in ("udp", "tcp") else 1
    except ValueError:
        port = None
    if found.scheme not in SCHEMES or not found.netloc or not port:
        raise InputError(f"--uri {uri}", "no URI of a Crazyflie",
                         "write radio://0/80/2M/E7E7E7E7E7 or udp://127.0.0.1:19850")


@contextmanager
def open_link(uri: str, clock: Clock, cache: Path | None = None, patience_s: float = 0.0,
              say: Callable[[str], None] = lambda text: None) -> Iterator[CflibLink]:
    """A link that is open and whose tables are known; closed at the end. ``cache``: folder for tables of contents.
    ``patience_s``: limit for a vehicle that is still starting; ``say`` takes one line if it has to be waited for.

    Raises InputError for an unknown URI, no answer or a wrong protocol version, MissingExtraError without cflib.
    """
    check_uri(uri)
    try:
        import cflib.crtp
    except ImportError:
        raise MissingExtraError("cflib", "radio") from None
    logging.getLogger("cflib").setLevel(logging.CRITICAL)
    if not cflib.crtp.CLASSES:
        cflib.crtp.init_drivers()
    link = _started(uri, clock, cache, patience_s, say)
    try:
        yield link
    finally:
        link.close()


def _started(uri: str, clock: Clock, cache: Path | None, patience_s: float, say: Callable[[str], None]) -> CflibLink:
    """The link as soon as the vehicle answers completely, tried again until then."""
    until, said = clock.now() + patience_s, False
    while True:
        link = CflibLink(uri, cache, clock)
        try:
            link.open(until - clock.now())
            return link
        except NotStartedError as error:
            link.close()
            left_s = until - clock.now()
            if left_s <= 0.0:
                raise
            if not said:
                say(f"{error.found}; it may still be starting: tried for another {left_s:.0f} s, Ctrl-C ends it")
            said = True
            clock.sleep_until(clock.now() + RETRY_S)
        except BaseException:
            link.close()
            raise
