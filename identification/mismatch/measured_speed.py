"""Simulators that take measured rotor speeds (``input = "rpm"`` in simulator.toml), and recordings that hold them.

The speeds replace the commands that other simulators take: the rest of a diagnosis sees one stream of inputs. Commands
are not turned into speeds, since the map and the lag between them would be judged as the simulator's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, make_stream, motors_of

SPEED, WRONG = "rpm", "wrong_speed"


def with_speed(flight: Flight) -> Flight:
    """The flight with its measured rotor speeds [rad/s] as inputs; without inputs if it has no speeds."""
    if SPEED not in flight:
        return flight.without_streams("motor") if "motor" in flight else flight
    stream = flight[SPEED]
    names = motors_of(stream)
    return flight.with_streams(motor=make_stream("motor", stream.time_s, stream[names], names, rate_hz=stream.rate_hz,
                                                 samples=stream.samples))


def of_speed(audit: Audit) -> Audit:
    """A verdict on the data in which faults of the speeds are those of the inputs, and commands do not matter. Speeds
    that are inconsistent with the commands are treated as missing; this fault does not matter to other simulators."""
    faults = (f for f in audit.faults if f.stream != "motor")
    return replace(audit, faults=tuple(
        replace(f, stream="motor", kind="gap" if f.kind == WRONG else f.kind) if f.stream == SPEED else f
        for f in faults))


def check(flights: Sequence[Flight]) -> None:
    """InputError if no recording contains the inputs of the simulator."""
    if flights and not any(SPEED in f for f in flights):
        raise InputError(flights[0].provenance.path, "has no measured rotor speed (stream rpm), and the simulator "
                         "takes rotor speeds", "give recordings that hold them, or a simulator with input = \"pwm\"")


def seen_by(flights: Sequence[Flight], audits: Mapping[str, Audit],
            takes: str) -> tuple[dict[str, Flight], dict[str, Audit]]:
    """Flights and audits by name, as seen by a simulator that takes ``pwm``, ``rpm`` or ``thrust``."""
    if takes != SPEED:
        return {f.name: f for f in flights}, dict(audits)
    check(flights)
    return {f.name: with_speed(f) for f in flights}, {name: of_speed(audit) for name, audit in audits.items()}
