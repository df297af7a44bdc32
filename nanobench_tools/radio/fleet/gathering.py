"""Vehicles of a fleet wait for each other: before arming, and before take-off."""

import threading
from collections.abc import Callable, Mapping

from ...errors import InputError
from ..fly.prepare import Ready
from ..host_clock import Clock

LOOK_S = 0.02
READY, ARMED = "ready", "armed"


class OtherRefusedError(InputError):
    """This vehicle would fly, but another one of the fleet does not."""


class Gathering:
    """``check`` is called once, with the Ready of every vehicle by name, before any is armed; it raises to refuse."""

    def __init__(self, names: tuple[str, ...], check: Callable[[Mapping[str, Ready]], None]) -> None:
        self._names, self._check = names, check
        self._lock = threading.Lock()
        self._ready: dict[str, Ready] = {}
        self._there: dict[str, set[str]] = {READY: set(), ARMED: set()}
        self._open = {READY: False, ARMED: False}
        self.begin_s = 0.0
        self.refused = ""

    def refuse(self, why: str) -> None:
        """A vehicle does not fly: none does. The first reason counts."""
        self.refused = self.refused or why

    def ready(self, name: str, ready: Ready, clock: Clock) -> None:
        """Waits until all vehicles are ready to be armed. Raises InputError if their plans are refused."""
        with self._lock:
            self._ready[name] = ready
        self._arrive(READY, name, clock, lambda: self._check(dict(self._ready)))

    def armed(self, name: str, clock: Clock, rest_s: float) -> float:
        """Waits until all vehicles are armed; returns the host time at which the first may take off."""
        def begin() -> None:
            self.begin_s = clock.now() + rest_s

        self._arrive(ARMED, name, clock, begin)
        return self.begin_s

    def _arrive(self, place: str, name: str, clock: Clock, last: Callable[[], None]) -> None:
        """The one that comes last calls ``last``."""
        with self._lock:
            self._there[place].add(name)
            is_last = len(self._there[place]) == len(self._names)
        if is_last and not self.refused:
            last()
            self._open[place] = True
        while not self._open[place]:
            if self.refused:
                raise OtherRefusedError(name, f"another vehicle was refused: {self.refused}", "none is armed")
            clock.sleep_until(clock.now() + LOOK_S)
