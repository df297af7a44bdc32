"""Faults of a whole stream, and those that only a reader can see."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..flight import Fault, Flight


def over_stream(
    kind: str,
    flight: Flight,
    name: str,
    quantities: Iterable[str] | None,
    size: float,
    unit: str,
    evidence: str,
    minimum_detectable: float = math.nan,
) -> Fault:
    """A fault from the first to the last row of a stream; ``quantities`` None means all its columns."""
    stream = flight[name]
    # stamps may go backwards
    start, end = (float(np.min(stream.time_s)), float(np.max(stream.time_s))) if len(stream) else (0.0, 0.0)
    columns = stream.columns if quantities is None else tuple(stream.columns[stream.index(q)] for q in quantities)
    return Fault(kind, name, columns, start, end, float(size), unit, evidence, minimum_detectable)


def findings(flight: Flight, kind: str) -> list[Fault]:
    """What the reader found of one kind and left in ``provenance.findings``."""
    return [fault for fault in flight.provenance.findings if fault.kind == kind]
