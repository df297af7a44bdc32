"""copy: two recordings hold the same numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from ..content.context import Context
from ..flight import Fault, Flight

KIND = "copy"


def fingerprint(flight: Flight) -> str:
    """SHA-256 over stream names, quantities, stamps and values (rounded to 1e-9): not of bytes, names or sheets."""
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


def find(flight: Flight, context: Context) -> list[Fault]:
    """Nothing: one recording alone is no copy; ``audit.find_copies`` compares many."""
    return []
