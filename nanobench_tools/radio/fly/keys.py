"""The space bar while a vehicle flies: an emergency stop from the terminal."""

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

STOP_KEY = b" "
EVERY_S = 0.1


@contextmanager
def space_stops(stop: Callable[[], None], fd: int | None = None) -> Iterator[None]:
    """Call ``stop`` when space is pressed, within a ``with``. ``fd``: the terminal, by default stdin. Does nothing
    without a terminal or on Windows."""
    try:
        import termios
        import tty

        terminal = sys.stdin.fileno() if fd is None else fd
        before = termios.tcgetattr(terminal)
    except Exception:  # no terminal: termios.error, ImportError, OSError, ValueError
        yield
        return
    ended = threading.Event()

    def listen() -> None:
        while not ended.is_set():
            if select.select([terminal], [], [], EVERY_S)[0] and STOP_KEY in os.read(terminal, 64):
                stop()

    thread = threading.Thread(target=listen, name="space bar", daemon=True)
    try:
        tty.setcbreak(terminal)  # Ctrl-C remains a signal
        thread.start()
        yield
    finally:
        ended.set()
        thread.join(1.0)
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
