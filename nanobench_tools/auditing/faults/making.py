"""Faults of a whole stream, and those that only a reader can see."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context

SINCE = ", since "
"""In an evidence: the finding, and what shows it."""
OR = "; or "
"""In an evidence: a finding that the recording does not decide, and the other possibility."""


def over_stream(kind: str, flight: Flight, name: str, quantities: Iterable[str] | None, size: float, unit: str,
                evidence: str, minimum_detectable: float = math.nan) -> Fault:
    """A fault from the first to the last row of a stream; ``quantities`` None means all its columns."""
    stream = flight[name]
    # stamps may go backwards
    start, end = (float(np.min(stream.time_s)), float(np.max(stream.time_s))) if len(stream) else (0.0, 0.0)
    columns = stream.columns if quantities is None else tuple(stream.columns[stream.index(q)] for q in quantities)
    return Fault(kind, name, columns, start, end, float(size), unit, evidence, minimum_detectable)


def findings(flight: Flight, kind: str) -> list[Fault]:
    """What the reader found of one kind and left in ``provenance.findings``, within the recording."""
    found = [fault for fault in flight.provenance.findings if fault.kind == kind]
    if not found:
        return []
    # the reader puts borders halfway between rows, so that of the first and last row lie outside
    stamps = [s.time_s[np.isfinite(s.time_s)] for s in flight.streams.values()]
    low = min((float(t.min()) for t in stamps if len(t)), default=-math.inf)
    high = max((float(t.max()) for t in stamps if len(t)), default=math.inf)
    return [replace(fault, start_s=min(max(fault.start_s, low), high), end_s=max(min(fault.end_s, high), low))
            for fault in found]


def found_by_reader(kind: str) -> Callable[[Flight, Context], list[Fault]]:
    """A detector for a kind of fault that only a reader can see: it gives the reader's findings."""
    return lambda flight, context: findings(flight, kind)
