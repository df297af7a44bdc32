"""Simulated vehicles of a fleet in this process, on one clock: repeatable, and as fast as possible.

The threads of the flights take turns. A thread that waits passes the turn to the one that is due next, and the world
goes on until then. Only one thread runs at a time, so that a flight does not depend on the machine.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from ..fly.virtual import START_S, STEP_S, VirtualWorld

AFTER_S = 86_400.0 * 365
"""Fleets begin a year after single worlds."""


class FleetWorld(VirtualWorld):
    """One vehicle of a fleet; ``fleet`` lets time pass for all."""

    fleet: VirtualFleet

    def sleep_until(self, time_s: float) -> None:
        """Passes the turn on until then."""
        self.fleet.sleep_until(time_s)

    def go_on(self, time_s: float) -> None:
        """A step of this vehicle's world."""
        self._step(time_s)


class VirtualFleet:
    """``make(uri, start_s)`` makes the world of a vehicle."""

    _fleets = 0

    def __init__(self, count: int, make: Callable[[int, str, float], FleetWorld]) -> None:
        start_s = START_S + AFTER_S + 3600.0 * VirtualFleet._fleets
        VirtualFleet._fleets += 1
        self.worlds = [make(i, f"virtual://{i}", start_s) for i in range(count)]
        waiting: dict[Any, Any] = {}
        for world in self.worlds:
            world.fleet = self
            world._waiting_for = waiting
        self.after_step: Callable[[float], None] = lambda time_s: None
        self._start_s, self._steps = start_s, 0
        self._turn = threading.Condition()
        self._due = dict.fromkeys(range(count), start_s)
        self._running = 0
        self._numbers: dict[int, int] = {}

    @contextmanager
    def turn(self, number: int) -> Iterator[None]:
        """Within a ``with``: this thread is the flight of vehicle ``number``."""
        with self._turn:
            self._numbers[threading.get_ident()] = number
            self._turn.wait_for(lambda: self._running == number)
        try:
            yield
        finally:
            with self._turn:
                del self._due[number]
                self._pass_on()

    @contextmanager
    def served(self) -> Iterator[None]:
        """Within a ``with``: cflib finds all vehicles."""
        with ExitStack() as stack:
            for world in self.worlds:
                stack.enter_context(world.served())
            yield

    def sleep_until(self, time_s: float) -> None:
        """Of the running thread: waits, and lets others run."""
        number = self._numbers[threading.get_ident()]
        with self._turn:
            self._due[number] = time_s
            self._pass_on()
            self._turn.wait_for(lambda: self._running == number)

    def run_on(self, seconds: float) -> None:
        """After all flights: time passes."""
        self._go_on(self.worlds[0].now() + seconds)

    def _pass_on(self) -> None:
        if not self._due:
            return
        following = min(self._due, key=lambda number: (self._due[number], number))
        self._go_on(self._due[following])
        self._running = following
        self._turn.notify_all()

    def _go_on(self, time_s: float) -> None:
        while self.worlds[0].now() < time_s - 1e-6:
            self._steps += 1
            now = self._start_s + STEP_S * self._steps
            for world in self.worlds:
                world.go_on(now)
            self.after_step(now)


def on_clock(requests: Sequence[Any], fleet: VirtualFleet) -> list[Any]:
    """Requests for the vehicles of a simulated fleet instead of those at their addresses."""
    from dataclasses import replace

    return [replace(request, uri=world.uri, source=world, clock=world)
            for request, world in zip(requests, fleet.worlds, strict=True)]
