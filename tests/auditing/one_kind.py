"""Faults of one kind alone: what an audit reports of it, without the work for the other kinds."""

from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.flight import Fault, Flight
from nanobench_tools.signals.context import Context


def faults_of(flight: Flight, *which: str) -> list[Fault]:
    """In the order of an audit, which calls these detectors one after the other."""
    context = Context(flight)
    found = [fault for kind in which for fault in kinds()[kind].find(flight, context)]
    return sorted(found, key=lambda f: (f.start_s, f.kind, f.stream, f.end_s))
