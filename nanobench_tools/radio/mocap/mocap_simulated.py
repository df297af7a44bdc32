"""Poses of a simulated vehicle: datagrams that its server sends to whoever asks."""

import socket
import threading
import time
from urllib.parse import urlparse

from ...errors import InputError, UsageError
from .pose_datagram import HELLO, PORT_OFFSET, SUBSCRIPTION_S, unpack
from .pose_source import Sink

REQUEST_S = 0.25 * SUBSCRIPTION_S


def address_of(spec: str, uri: str) -> tuple[str, int]:
    """Host and port: of ``simulated://host:port``, else PORT_OFFSET above those of the vehicle's URI."""
    given = spec.startswith("simulated://")
    found = urlparse(spec if given else uri)
    try:
        host, port = found.hostname, found.port
    except ValueError:
        host = port = None
    if not given and found.scheme not in ("udp", "tcp"):
        raise UsageError(f"--mocap {spec}: {uri} is no simulated vehicle; give simulated://HOST:PORT")
    if not host or not port:
        place, example = (f"--mocap {spec}", "simulated://127.0.0.1:19950") if given else \
            (f"--uri {uri}", "udp://127.0.0.1:19850")
        raise UsageError(f"{place}: give host and port, such as {example}")
    return host, port if given else port + PORT_OFFSET


class SimulatedMocap:
    """Subscribes, and asks again in time."""

    name = "simulated"
    synthetic = True

    def __init__(self, address: tuple[str, int]) -> None:
        self.address = address
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, sink: Sink) -> None:
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.settimeout(0.1)
            self._socket.connect(self.address)
        except OSError as error:
            host, port = self.address
            raise InputError(f"--mocap simulated ({host}:{port})", f"{error.strerror or error}", "check the URI") \
                from None
        self._thread = threading.Thread(target=self._run, args=(sink,), name="simulated mocap", daemon=True)
        self._thread.start()

    def _run(self, sink: Sink) -> None:
        requested_s = 0.0
        while not self._stop.is_set():
            try:
                if time.monotonic() - requested_s > REQUEST_S:
                    requested_s = time.monotonic()
                    self._socket.send(HELLO)
                sink(unpack(self._socket.recv(256)))
            except TimeoutError:
                continue
            except OSError:  # nobody there yet, or no more: poses that do not come are seen by who waits for them
                self._stop.wait(0.05)

    def setpoint(self, time_s: float, command: dict[str, object]) -> None:
        """Not of interest here."""

    def close(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=1.0)
            self._socket.close()
