"""Practice flights that several folders of tests use, flown at once: a crowd costs hardly more than one vehicle."""

from dataclasses import dataclass
from typing import Any

from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.practice.clock import ClockError
from nanobench_tools.practice.flights import _recording
from nanobench_tools.practice.flying import Flown, flight_rngs, fly
from nanobench_tools.practice.logging_chain import LoggingChain, record
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.references import path_spec

SEED = 53
VEHICLES = {
    "short circle": ("circle", "slow", 6.0, "pid"),
    "short trefoil": ("trefoil", "slow", 6.0, "pid"),
    "short helix": ("helix", "slow", 6.0, "mellinger"),
    "circle": ("circle", "slow", 8.0, "pid"),
    "trefoil": ("trefoil", "slow", 8.0, "pid"),
    "helix": ("helix", "slow", 8.0, "pid"),
    "mellinger oval": ("oval", "slow", 8.0, "mellinger"),
    "slow figure_eight": ("figure_eight", "slow", 16.0, "pid"),
    "slow trefoil": ("trefoil", "slow", 16.0, "pid"),
    "medium trefoil": ("trefoil", "medium", 14.0, "pid"),
    "fast trefoil": ("trefoil", "fast", 14.0, "pid"),
    "star": ("star", "medium", 14.0, "pid"),
    "fast figure_eight": ("figure_eight", "fast", 16.0, "pid"),
}
"""Family, speed, seconds of path, controller."""


@dataclass(frozen=True)
class Crowd:
    """What flew. Every recording can be taken through any logging chain."""

    flown: Flown

    def flight(self, name: str, chain: LoggingChain | None = None) -> Flight:
        """The recording with its sheet, as ``practice_flights`` gives it."""
        row = list(VEHICLES).index(name)
        return _recording(self.flown, row, row, _spec(name), VEHICLES[name][3], SEED, chain or LoggingChain())

    def log(self, name: str, **chain: Any) -> tuple[Flight, ClockError]:
        """The recording without a sheet, and the clock that its chain (fields of ``LoggingChain``) gave it."""
        row = list(VEHICLES).index(name)
        found = record(self.flown, row, LoggingChain(**chain), flight_rngs(SEED, row, 9)[6:])
        return Flight("practice", found.streams, {}, Provenance("log", "", "practice", synthetic=True)), found.clock


def _spec(name: str):
    family, speed, duration_s, _ = VEHICLES[name]
    return path_spec(family, speed, duration_s=duration_s)


def fly_crowd() -> Crowd:
    """All of them, SYNTHETIC."""
    fleet = OnboardFleet([controller for *_, controller in VEHICLES.values()])
    return Crowd(fly(fleet, [_spec(name) for name in VEHICLES], seed=SEED, indices=list(range(len(VEHICLES)))))
