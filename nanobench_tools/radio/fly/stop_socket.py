"""An emergency stop from another terminal: a flight listens on a local socket whose name follows from the URI."""

import hashlib
import os
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

ANSWER_S, EVERY_S = 1.0, 0.1
REQUEST, ANSWER = b"stop", b"stopping"


def path_of(uri: str) -> Path:
    """Of this user's flight of a vehicle."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    return Path(tempfile.gettempdir()) / f"nanobench-{user}-{hashlib.sha256(uri.encode()).hexdigest()[:16]}.stop"


@contextmanager
def listening(uri: str, stop: Callable[[], None]) -> Iterator[None]:
    """Within a ``with``: ``stop`` is called for every request. Does nothing where there are no such sockets."""
    path, ended = path_of(uri), threading.Event()
    try:
        server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        path.unlink(missing_ok=True)
        server.bind(str(path))
        path.chmod(0o600)
        server.listen()
        server.settimeout(EVERY_S)
    except (AttributeError, OSError):
        yield
        return

    def serve() -> None:
        while not ended.is_set():
            with suppress(OSError):
                client, _ = server.accept()
                with client:
                    client.settimeout(ANSWER_S)
                    if client.recv(16) == REQUEST:
                        stop()
                        client.sendall(ANSWER)

    thread = threading.Thread(target=serve, name="stop socket", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(1.0)
        server.close()
        path.unlink(missing_ok=True)


def request_stop(uri: str) -> bool:
    """Whether a flight of this vehicle on this computer has taken the request."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.settimeout(ANSWER_S)
            client.connect(str(path_of(uri)))
            client.sendall(REQUEST)
            return client.recv(64) == ANSWER
    except (AttributeError, OSError):
        return False


def remove_stale(uri: str) -> None:
    """Removes the socket of a flight whose process was killed; one that somebody listens on stays."""
    path = path_of(uri)
    with suppress(AttributeError, OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(ANSWER_S)
        try:
            client.connect(str(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
