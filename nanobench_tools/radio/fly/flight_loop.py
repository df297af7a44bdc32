"""Loop of a flight: a tick every 10 ms by the clock, deadlines and jitter counted.

A tick that still works when the next is due has missed its deadline. Skipped ticks are missed, too, and are not
repeated. Jitter is the delay of a tick's start and of its set-point against the ideal grid.
"""

import gc
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..host_clock import Clock
from ..several_flights import together

PRIORITY = 2
"""Of real time: before all ordinary processes and a simulated vehicle that has the least, behind the system's own."""
SWITCH_S = 0.0001
"""Longest time for which another thread keeps the interpreter while a tick waits for it (5 ms by default)."""


@dataclass
class Beat:
    """Counts of a flight. ``late_s`` and ``sent_s``: of every tick, its begin and its set-point against the grid."""

    period_s: float
    ticks: int = 0
    missed: int = 0
    late_in_a_row: int = 0
    late_s: list[float] = field(default_factory=list)
    sent_s: list[float] = field(default_factory=list)
    call_s: list[float] = field(default_factory=list)

    def summary(self) -> dict[str, float]:
        """Ticks, deadlines missed, percentiles [ms] of begin, sending (about its median) and the controller's calls."""
        found: dict[str, float] = {"ticks": self.ticks, "missed": self.missed}
        sent = np.array(self.sent_s) - np.median(self.sent_s) if self.sent_s else np.zeros(0)
        for name, values in (("begin", np.array(self.late_s)), ("sent", np.abs(sent)), ("call", np.array(self.call_s))):
            for percent in (50, 99, 100):
                found[f"{name}_p{percent}_ms"] = 1e3 * float(np.percentile(values, percent)) if len(values) else np.nan
        return found


class Pacer:
    """``wait`` returns the due time of the next tick. Call ``sent`` and ``done`` when a tick has sent and ended."""

    def __init__(self, clock: Clock, period_s: float) -> None:
        self.clock, self.beat = clock, Beat(period_s)
        self._due = clock.now()

    def wait(self) -> float:
        self._due += self.beat.period_s
        now = self.clock.now()
        behind = int((now - self._due) / self.beat.period_s)
        if behind > 0:  # whole ticks were missed while the last one worked
            self.beat.missed += behind
            self._due += behind * self.beat.period_s
        self.clock.sleep_until(self._due)
        self.beat.late_s.append(self.clock.now() - self._due)
        self.beat.ticks += 1
        return self._due

    def sent(self, call_s: float) -> None:
        self.beat.sent_s.append(self.clock.now() - self._due)
        self.beat.call_s.append(call_s)

    def done(self) -> None:
        late = self.clock.now() > self._due + self.beat.period_s
        self.beat.late_in_a_row = self.beat.late_in_a_row + 1 if late else 0
        self.beat.missed += late


@together
@contextmanager
def ahead_of_others() -> Iterator[None]:
    """Run this process's threads before those of others, where the system allows it (Linux: root, CAP_SYS_NICE or a
    limit of rtprio). All threads, since any may hold the interpreter that a tick waits for. Round robin, so that a
    hanging controller does not block the guardian."""
    before: dict[int, tuple[int, Any]] = {}
    if hasattr(os, "sched_setscheduler"):
        for thread in threading.enumerate():
            number = thread.native_id
            with suppress(OSError):  # not allowed, or ended meanwhile
                if number is not None:
                    was = os.sched_getscheduler(number), os.sched_getparam(number)
                    os.sched_setscheduler(number, os.SCHED_RR | os.SCHED_RESET_ON_FORK,
                                          os.sched_param(PRIORITY))
                    before[number] = was
    try:
        yield
    finally:
        for number, (policy, parameter) in before.items():
            with suppress(OSError):
                os.sched_setscheduler(number, policy, parameter)


@together
@contextmanager
def undisturbed(single: bool = True) -> Iterator[None]:
    """No garbage collection, and other threads give way soon. Without ``single`` several flights are in the program.
    Loops that give way to each other so soon miss far more deadlines."""
    collected, switch = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    if single:
        sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(switch)
        gc.unfreeze()
        if collected:
            gc.enable()
