"""Ctrl-C while something is in the air: it asks for a landing, and does not tear the program out of it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Hung(BaseException):
    """Raised into a call that the guardian has given up on."""


class Interrupts:
    """Ctrl-C and SIGTERM ask for the end; the third Ctrl-C gives up at once (the vehicle's watchdog is left)."""

    def __init__(self) -> None:
        self.asked = ""
        self.hung = False
        self._count = 0

    @contextmanager
    def caught(self) -> Iterator[Interrupts]:
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        before = {which: signal.signal(which, self._note) for which in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield self
        finally:
            for which, handler in before.items():
                signal.signal(which, handler)

    def _note(self, which: int, frame: FrameType | None) -> None:
        if self.hung:
            raise Hung
        self.asked = "Ctrl-C" if which == signal.SIGINT else "the program was told to end"
        self._count += 1
        if self._count >= 3:
            raise KeyboardInterrupt
