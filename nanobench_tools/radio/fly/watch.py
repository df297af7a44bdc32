"""A flight in the terminal while it flies: error as a sparkline, battery, link, loop. Nothing without a terminal."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np

from ..host_clock import HostClock
from ..vehicle_link import Link
from .flight_loop import Beat
from .pose_tracker import Believed

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

HOST = HostClock()
BARS = "▁▂▃▄▅▆▇█"
WIDTH, EVERY_S, SHOWN_HZ = 60, 0.2, 5.0
FULL_M = 0.25
"""Error of a full bar, or the largest shown if that is more."""


def sparkline(values: list[float], full: float) -> str:
    """One bar a value, ``full`` high; nan is a gap."""
    top = max([full, *[v for v in values if np.isfinite(v)]])
    return "".join(BARS[min(int(v / top * len(BARS)), len(BARS) - 1)] if np.isfinite(v) else " " for v in values)


class Watch:
    """A listener of ``fly.Flight``; a thread of rich draws, the loop only leaves numbers here."""

    def __init__(self, link: Link, beat: Callable[[], Beat | None] = lambda: None, quiet: bool = False) -> None:
        self._link, self.beat_of = link, beat
        self._on = not quiet and sys.stderr.isatty()
        self._errors: deque[float] = deque(maxlen=WIDTH)
        self._next_s, self._phase, self._time_s = 0.0, "", 0.0
        self._live: Live | None = None

    def __enter__(self) -> Watch:
        if self._on:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(get_renderable=self.render, console=Console(stderr=True), refresh_per_second=SHOWN_HZ,
                              transient=True)
            self._live.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, trace)

    def tick(self, time_s: float, phase: str, believed: Believed | None, commanded_m: np.ndarray | None,
             yaw_rad: float) -> None:
        self._phase, self._time_s = phase, time_s
        if self._live is None or time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + EVERY_S
        error = float("nan")
        if believed is not None and commanded_m is not None:
            error = float(np.linalg.norm(believed.position_m - commanded_m))
        self._errors.append(error)

    def note(self, text: str) -> None:
        self._phase = text

    def render(self) -> Table:
        """Text that is in the terminal now."""
        from rich.table import Table

        link, errors = self._link, list(self._errors)
        last = f"{100.0 * errors[-1]:.1f} cm" if errors and np.isfinite(errors[-1]) else "no set-point"
        trips = list(link.round_trips_s)
        table = Table.grid(padding=(0, 2))
        table.add_row("phase", f"{self._phase}, {self._time_s:.1f} s")
        table.add_row("error", f"{sparkline(errors, FULL_M)} {last}".lstrip())
        battery = link.values.get("pm.vbat")
        table.add_row("battery", "not known yet" if battery is None else f"{battery:.2f} V")
        quality = f"round trip {1e3 * float(np.median(trips)):.1f} ms" if trips else "no echo"
        table.add_row("link", f"{quality}, last packet {1e3 * max(HOST.now() - link.heard_s, 0.0):.0f} ms ago")
        beat = self.beat_of()
        if beat is not None and beat.late_s:
            recent = np.array(beat.call_s[-100:] or [0.0])
            table.add_row("loop", f"controller {1e3 * float(recent.mean()):.2f} ms, "
                          f"late {1e3 * float(np.percentile(beat.late_s[-500:], 99)):.2f} ms (p99), "
                          f"{beat.missed} of {beat.ticks} missed")
        return table
