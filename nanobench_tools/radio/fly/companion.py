"""A process that has a flight's last word: it lands the vehicle when the process that flies it dies.

It waits for lines on its stdin: ``port N`` (UDP port), ``air GROUND HEIGHT`` [m], ``ground``. When stdin
ends while the vehicle is in the air, it opens the link anew and commands the vehicle's planner to land, repeatedly for
LAND_S. ``kill -9`` of the flight closes stdin, too. cflib is loaded before the flight begins, so that no time is lost.
"""

from __future__ import annotations

import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlparse

from ...errors import MissingExtraError
from .landing_profile import goal_m, lasts_s
from .stop_socket import remove_stale

if TYPE_CHECKING:
    import numpy as np

    from .pose_tracker import Believed

LAND_S, EVERY_S = 4.0, 0.05
ON_THE_GROUND = ("ground", "landed")
GENERIC, HIGH_LEVEL, LOCALIZATION, ECHO = 7, 8, 6, 15
LAND, EMERGENCY_STOP = 8, 3
STOP_S = 2.0


class Companion:
    """The flight's end of it, and a listener of the flight. ``ground_m``: height of a vehicle on the ground."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process, self._said, self.ground_m = process, b"", 0.0

    def tick(self, time_s: float, phase: str, believed: Believed | None, commanded_m: np.ndarray | None,
             yaw_rad: float) -> None:
        if phase in ON_THE_GROUND:
            self.ground()
        elif believed is not None:
            self._tell(b"air %.2f %.1f\n" % (self.ground_m, float(believed.position_m[2])))

    def port(self, number: int) -> None:
        """Of a flight over UDP: a simulated vehicle answers the address that it knows."""
        if number:
            self._tell(b"port %d\n" % number)

    def note(self, text: str) -> None:
        """Not of interest here."""

    def ground(self) -> None:
        self._tell(b"ground\n")

    def _tell(self, line: bytes) -> None:
        if line == self._said or self._process.stdin is None:
            return
        self._said = line
        with suppress(OSError):  # it is gone: the vehicle's watchdog is left
            os.write(self._process.stdin.fileno(), line)


@contextmanager
def companion(uri: str) -> Iterator[Companion]:
    """Within a ``with``: the process runs; it ends with it, without doing anything."""
    process = subprocess.Popen([sys.executable, "-m", __name__, uri], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, start_new_session=True)  # Ctrl-C is not for it
    found = Companion(process)
    try:
        yield found
    finally:
        found.ground()
        with suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()


def packets(ground_m: float, height_m: float) -> list[tuple[int, int, bytes]]:
    """Port, channel and data of: land by the planner, and the end of set-points."""
    landing = struct.pack("<BBff?f", LAND, 0, goal_m(ground_m), 0.0, True, lasts_s(ground_m, height_m, blind=True))
    return [(HIGH_LEVEL, 0, landing), (GENERIC, 1, struct.pack("<BI", 0, 0))]


def send_for(uri: str, what: list[tuple[int, int, bytes]], seconds: float, port: int = 0) -> bool:
    """Opens a link without tables and sends packets every EVERY_S. Whether anything answered. ``port``: local one of
    UDP, 0 for any."""
    from cflib.crtp.crtpstack import CRTPPacket

    until, driver, heard = time.monotonic() + seconds, None, False
    while time.monotonic() < until:
        try:
            driver = driver or _opened(uri, port)
            for to, channel, data in what:
                packet = CRTPPacket()
                packet.set_header(to, channel)
                packet.data = data
                driver.send_packet(packet)
            heard = driver.receive_packet(EVERY_S) is not None or heard
        except Exception:  # the radio is not free yet: the process that died had it
            if driver is not None:
                with suppress(Exception):
                    driver.close()
            driver = None
        time.sleep(EVERY_S)
    if driver is not None:
        driver.close()
    return heard


def send_stop(uri: str) -> bool:
    """An emergency stop over a new link. Raises MissingExtraError without cflib."""
    try:
        import cflib.crtp
    except ImportError:
        raise MissingExtraError("cflib", "radio") from None
    if not cflib.crtp.CLASSES:
        cflib.crtp.init_drivers()
    return send_for(uri, [(LOCALIZATION, 1, bytes([EMERGENCY_STOP])), (ECHO, 0, bytes(9))], STOP_S)


class _Udp:
    """A link over UDP from a given port, once its owner has died."""

    def __init__(self, uri: str, port: int) -> None:
        found = urlparse(uri)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1" if found.hostname in ("localhost", "127.0.0.1") else "", port))
        self._socket.connect((found.hostname, found.port))

    def send_packet(self, packet: Any) -> None:
        with suppress(ConnectionError):
            self._socket.send(bytes([packet.header]) + bytes(packet.data))

    def receive_packet(self, wait_s: float) -> bytes | None:
        self._socket.settimeout(wait_s)
        with suppress(OSError):
            return self._socket.recv(256)
        return None

    def close(self) -> None:
        self._socket.close()


def _opened(uri: str, port: int) -> Any:
    if port and uri.startswith("udp://"):
        return _Udp(uri, port)
    import cflib.crtp

    class Owner:
        """Drivers report errors to it."""

        def error(self, why: str) -> None:
            raise OSError(why)

    driver = cflib.crtp.get_link_driver(uri, lambda *_: None, Owner().error)
    if driver is None:
        raise OSError(uri)
    return driver


def main(uri: str) -> None:
    import cflib.crtp

    cflib.crtp.init_drivers()
    last, port = [b"ground"], 0
    for line in sys.stdin.buffer:
        words = line.split()
        if words[0] == b"port":
            port = int(words[1])
        else:
            last = words
    if last[0] == b"air":
        send_for(uri, packets(float(last[1]), float(last[2])), LAND_S, port)
    remove_stale(uri)


if __name__ == "__main__":
    main(sys.argv[1])
