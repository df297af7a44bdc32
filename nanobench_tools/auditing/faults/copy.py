"""copy: two recordings hold the same numbers.

Found by a fingerprint of stamps and values of all streams: not of bytes, names, sheets or the time of day. One
recording alone cannot show it, so ``audit.find_copies`` compares many. Then ``audit.with_copies`` writes the fault
into the verdicts of all but the first of a group. A recording that is a stretch of another (the slices of a benchmark)
is no copy. The function ``parts`` finds these, so that no flight is counted twice.

Size: none. Smallest found: equality to 1e-9 of every number.
"""

import hashlib
import math
from collections.abc import Sequence

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from .kind import FaultKind

KIND = "copy"

SAME_TIME_S = 1e-4
"""Absolute stamps of one frame in two files agree to the rounding of a double of 1.7e9 s."""


def fingerprint(flight: Flight) -> str:
    """SHA-256 over stream names, quantities, stamps and values (rounded to 1e-6 s and 1e-9)."""
    digest = hashlib.sha256()
    for name in sorted(flight.streams):
        stream = flight.streams[name]
        order = np.argsort(stream.quantities)
        digest.update(repr((name, sorted(stream.quantities), stream.values.shape)).encode())
        digest.update((np.round(stream.time_s, 6) + 0.0).tobytes())
        digest.update((np.round(stream.values[:, order], 9) + 0.0).tobytes())
    return digest.hexdigest()


def copies(flights: Sequence[Flight]) -> list[list[int]]:
    """Groups of two or more indices into ``flights`` with equal numbers; in rising order."""
    groups: dict[str, list[int]] = {}
    for i, flight in enumerate(flights):
        groups.setdefault(fingerprint(flight), []).append(i)
    return [group for group in groups.values() if len(group) > 1]


def parts(flights: Sequence[Flight]) -> list[tuple[int, int]]:
    """(part, whole): recordings whose first and last tracked poses are in a longer one at the same time of day."""
    spans = [(f.epoch_s + f.span.start_s, f.epoch_s + f.span.end_s) for f in flights]
    found = []
    for i, (start, end) in enumerate(spans):
        for j, (first, last) in enumerate(spans):
            longer = last - first > end - start + SAME_TIME_S
            if (
                longer
                and first <= start + SAME_TIME_S
                and end <= last + SAME_TIME_S
                and _stands_in(flights[i], flights[j])
            ):
                found.append((i, j))
    return found


def _stands_in(part: Flight, whole: Flight) -> bool:
    """Whether the first and last pose of ``part`` are rows of ``whole``."""
    names = ("px", "py", "pz")
    if not all("mocap" in f and len(f["mocap"]) and set(names) <= set(f["mocap"].quantities) for f in (part, whole)):
        return False
    own, other = part["mocap"], whole["mocap"]
    for row in (0, -1):
        at = own.time_s[row] + part.epoch_s - whole.epoch_s
        k = int(np.argmin(np.abs(other.time_s - at)))
        if abs(other.time_s[k] - at) > SAME_TIME_S or not np.array_equal(other[names][k], own[names][row]):
            return False
    return True


def fault_of(flight: Flight, first: str) -> Fault:
    """The fault of a recording that repeats the one called ``first``."""
    span = flight.span
    return Fault(KIND, "", (), span.start_s, span.end_s, math.nan, "", f"every number equals {first}")


def find(flight: Flight, context: Context) -> list[Fault]:
    """Nothing: one recording alone is no copy."""
    return []


FAULT = FaultKind(KIND, find, __doc__,
                  told="the same numbers as another recording",
                  group="flight", whole=True, in_diagnosis=False,
                  injection="nanobench_tools.practice.inject.whole:COPY")
