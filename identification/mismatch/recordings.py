"""Data first: what is wrong with the recordings is found, said and left out before physics is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from nanobench_tools.audit import Audit
from nanobench_tools.flight import Fault, Flight
from nanobench_tools.protocols.selection import distinct

from .track import Track, missing, tracks_of

INFORMATION = ("interpolated", "clock_wander", "extra_column", "missing_column", "copy")
"""Kinds that are said but are no reason to call the data faulty: a clock that wanders is re-timed."""


@dataclass(frozen=True)
class Recordings:
    """flights, on the motion capture's clock where that can be told; audits by name, of the same clock; tracks of what
    can be judged; faults (flight, fault) of all; left_out {flight: why}."""

    flights: tuple[Flight, ...]
    audits: Mapping[str, Audit]
    tracks: tuple[Track, ...]
    faults: tuple[tuple[str, Fault], ...]
    left_out: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f.name for f in self.flights)

    @property
    def judged_s(self) -> float:
        """Seconds of flight that are judged."""
        return 0.01 * sum(int(t.counts.sum()) for t in self.tracks)


def look_over(flights: Sequence[Flight], audits: Mapping[str, Audit],
              on_clock: Sequence[Flight], on_clock_audits: Mapping[str, Audit],
              with_battery: bool = True) -> Recordings:
    """Flights as recorded with their audits, and the same on the motion capture's clock (``harness.clocks``).
    with_battery: whether the simulator asks for the battery's voltage."""
    kept = distinct(list(flights))[0]
    moved = {f.name: f for f in on_clock}
    left_out = {f.name: "the same numbers as another recording" for f in flights if f not in kept}
    tracks: list[Track] = []
    for number, flight in enumerate(kept):
        flight = moved.get(flight.name, flight)
        audit = on_clock_audits.get(flight.name, audits[flight.name])
        lacks = missing(flight, with_battery)
        found = [] if lacks else tracks_of(flight, audit, number, with_battery)
        if not found:
            left_out[flight.name] = (f"no {', '.join(lacks)} stream" if lacks else
                                     "no second in the air without a fault in its data")
        tracks += found
    faults = tuple((f.name, fault) for f in kept for fault in audits[f.name].faults
                   if fault.kind not in INFORMATION)
    return Recordings(tuple(moved.get(f.name, f) for f in kept), dict(on_clock_audits), tuple(tracks), faults, left_out)
