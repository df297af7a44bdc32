"""Where the time of a flight's ticks goes, and what a tick that missed its deadline waited for (Linux)."""

import resource
import threading
import time
from contextlib import suppress

import numpy as np


class Threads:
    """Time that every thread of this process was on a core, cheaply enough for every tick. (Its own clock is exact;
    ``schedstat`` counts a thread that runs only when the system's timer interrupts it, in steps of some ms.)"""

    def __init__(self) -> None:
        self._clocks: dict[str, int] = {}

    def open(self) -> None:
        """Those that run now, but for the one that asks; one that begins later is not looked at."""
        for thread in threading.enumerate():
            if thread.ident is not None and thread is not threading.current_thread():
                self._clocks[f"{thread.name} {thread.native_id}"] = time.pthread_getcpuclockid(thread.ident)

    def spent_s(self) -> dict[str, float]:
        found = {}
        for name, clock in self._clocks.items():
            with suppress(OSError):  # it has ended
                found[name] = time.clock_gettime(clock)
        return found


def ready_s() -> float:
    """How long this thread was ready and had no core."""
    with open("/proc/thread-self/schedstat") as file:
        return 1e-9 * int(file.read().split()[1])


class Stopwatch:
    """Rows of ticks: from due to done, begun late, on a core, ready without one [s], and parts of it by name. Also
    page faults, voluntary and involuntary switches, and seconds that the other threads were on a core meanwhile."""

    def __init__(self, flight) -> None:
        self.rows: list[tuple[float, float, float, float]] = []
        self.parts: list[dict[str, float]] = []
        self.counts: list[tuple[int, int, int]] = []
        self.others: list[dict[str, float]] = []
        self._threads = Threads()
        self._begun = False
        self._wrap(flight)

    def _wrap(self, flight) -> None:
        pacer = flight.pacer
        wait, done = pacer.wait, pacer.done

        def begun() -> float:
            if not self._begun:
                self._begun = True
                self._threads.open()
            self._due = wait()
            self._late = pacer.clock.now() - self._due
            self._now: dict[str, float] = {}
            self._used = resource.getrusage(resource.RUSAGE_THREAD)
            self._before = self._threads.spent_s(), time.thread_time(), ready_s()
            return self._due

        def ended() -> None:
            on, ready, spent = time.thread_time(), ready_s(), self._threads.spent_s()
            before, on_before, ready_before = self._before
            used, then = resource.getrusage(resource.RUSAGE_THREAD), self._used
            self.rows.append((pacer.clock.now() - self._due, self._late, on - on_before, ready - ready_before))
            self.parts.append(self._now)
            self.counts.append((used.ru_minflt + used.ru_majflt - then.ru_minflt - then.ru_majflt,
                                used.ru_nvcsw - then.ru_nvcsw, used.ru_nivcsw - then.ru_nivcsw))
            self.others.append({name: s - before[name] for name, s in spent.items() if s - before[name] > 1e-4})
            done()

        pacer.wait, pacer.done = begun, ended
        for name, owner, method in (("state", flight, "_look"), ("controller", flight.pilot, "packet"),
                                    ("sending", flight.link, "send_setpoint"), ("telling", flight, "_tell")):
            setattr(owner, method, self._timed(name, getattr(owner, method)))

    def _timed(self, name: str, call):
        def timed(*given, **named):
            begun = time.perf_counter()
            try:
                return call(*given, **named)
            finally:
                now = getattr(self, "_now", {})
                now[name] = now.get(name, 0.0) + time.perf_counter() - begun

        return timed

    def report(self, missed_ms: float = 10.0, most: int = 20) -> None:
        """Prints percentiles of all ticks, and a line for each of the first that missed."""
        if not self.rows:
            return
        rows = 1e3 * np.array(self.rows)
        for k, what in enumerate(("from due to done", "begun late", "on a core", "ready, without a core")):
            print(f"a tick {what}: p50 {np.percentile(rows[:, k], 50):.2f} p99 {np.percentile(rows[:, k], 99):.2f} "
                  f"max {rows[:, k].max():.2f} ms")
        long = np.flatnonzero(rows[:, 0] > missed_ms)
        for i in long[:most]:
            whole, late, on, ready = rows[i]
            faults, asked, not_asked = self.counts[i]
            parts = ", ".join(f"{name} {1e3 * s:.1f}" for name, s in self.parts[i].items())
            others = ", ".join(f"{name} {1e3 * s:.1f}" for name, s in
                               sorted(self.others[i].items(), key=lambda one: -one[1])) or "none"
            print(f"  tick {i}: {whole:.1f} ms = late {late:.1f} + core {on:.1f} + ready {ready:.1f} + blocked "
                  f"{max(whole - late - on - ready, 0.0):.1f}; parts [ms] {parts}; {faults} page faults, {asked} "
                  f"switches asked for, {not_asked} not; others on a core [ms]: {others}")
        if len(long) > most:
            print(f"  ... and {len(long) - most} more")
