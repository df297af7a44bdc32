"""Guardian of a flight in a separate thread: a hang keeps neither the vehicle up nor the program alive."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..in_time import last_resort, renew


class Guardian:
    """Watches a flight from a separate thread.

    A call that does not end within ``most_s`` (a hanging controller) loses control of the flight to
    ``take_over(why)``. So does a loop without a sign of life for STUCK_S. ``take_over`` runs in this thread. If the
    loop has not ended BACK_S later, ``give_up(why)`` ends the program. The system does so if this thread itself does
    not run (``in_time.last_resort``).
    """

    EVERY_S, STUCK_S, BACK_S = 0.02, 3.0, 2.0
    ALONE_S, TAKE_OVER_S = 10.0, 60.0

    def __init__(self, most_s: float, take_over: Callable[[str], None], give_up: Callable[[str], None]) -> None:
        self.most_s, self._take_over, self._give_up = most_s, take_over, give_up
        self.taken = False
        self._begun: tuple[float, str] | None = None
        self._alive_s = time.monotonic()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="guardian", daemon=True)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Within a ``with``."""
        self.alive()
        with last_resort(self.ALONE_S):
            self._thread.start()
            try:
                yield
            finally:
                with self._lock:
                    self._stop.set()

    def alive(self) -> None:
        """The loop goes on."""
        self._alive_s = time.monotonic()

    def begin(self, who: str) -> None:
        """A call of ``who`` that may hang begins."""
        self._begun = time.monotonic(), who

    def end(self) -> bool:
        """It ended; False if the guardian has taken over and nothing may be sent any more."""
        with self._lock:
            self._begun = None
            return not self.taken

    def _run(self) -> None:
        while not self._stop.wait(self.EVERY_S):
            with self._lock:
                if self._stop.is_set():
                    return
                why = self._why()
                self.taken = bool(why)
                renew(self.TAKE_OVER_S if why else self.ALONE_S)
            if why:
                self._take_over(why)
                if not self._stop.wait(self.BACK_S):
                    self._give_up(why)
                return

    def _why(self) -> str:
        now = time.monotonic()
        if self._begun is not None and now - self._begun[0] >= self.most_s:
            return f"{self._begun[1]} did not answer within {1000.0 * self.most_s:.0f} ms"
        return f"the program stood still for {self.STUCK_S:.0f} s" if now - self._alive_s > self.STUCK_S else ""
