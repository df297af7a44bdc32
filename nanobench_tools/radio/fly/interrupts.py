"""Ctrl-C while something is in the air: it asks for a landing, and does not tear the program out of it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

AT_ONCE = 2
"""The second time it is the person in front of it who knows better."""


class Hung(BaseException):
    """Raised into a call that the guardian has given up on."""


class Interrupts:
    """Ctrl-C and SIGTERM ask for the end: the first for a landing (``requested``), the second is a
    KeyboardInterrupt. ``emergency``: the motors are to stop at once, by a second Ctrl-C or ``stop``."""

    def __init__(self) -> None:
        self.requested = ""
        self.emergency = ""
        self._count = self._pressed = 0
        self._waking = self._raised = False
        self._flying: int | None = None
        self._lock = threading.Lock()

    @contextmanager
    def caught(self) -> Iterator[Interrupts]:
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        before = {which: signal.signal(which, self._note) for which in (signal.SIGINT, signal.SIGTERM)}
        self._flying = threading.get_ident()
        try:
            yield self
        finally:
            with self._lock:
                self._flying = None
            for which, handler in before.items():
                signal.signal(which, handler)

    def wake(self) -> None:
        """From another thread: raise Hung in the flight's thread, in any wait, until ``caught`` ends."""
        with self._lock:
            if self._flying is not None:
                self._waking = True
                signal.pthread_kill(self._flying, signal.SIGINT)  # only this thread's own waiting is cut short by it

    def stop(self, why: str) -> None:
        """From any thread: an emergency stop. It cuts any wait of the flight short."""
        with self._lock:
            self.emergency = self.emergency or why
            self._count = AT_ONCE
            if self._flying is not None:
                signal.pthread_kill(self._flying, signal.SIGTERM)

    def raise_if_asked(self) -> None:
        """In a thread that gets no signals: raise KeyboardInterrupt once after a second request."""
        if self._flying is None and self._count >= AT_ONCE and not self._raised:
            self._raised = True
            raise KeyboardInterrupt

    def leave(self, why: str) -> None:
        """From any thread, for a flight in a thread without signals: as a second request to end."""
        self.requested, self._count = self.requested or why, AT_ONCE

    def _note(self, which: int, frame: FrameType | None) -> None:
        if self._waking:
            self._waking = False
            if self._flying is not None:
                raise Hung
            return
        self.requested = "Ctrl-C" if which == signal.SIGINT else "the program was terminated"
        self._count += 1
        self._pressed += which == signal.SIGINT
        if self._pressed >= AT_ONCE:
            self.emergency = self.emergency or "Ctrl-C twice"
        if self._count >= AT_ONCE and self._flying is not None:
            self._raised = True
            raise KeyboardInterrupt
