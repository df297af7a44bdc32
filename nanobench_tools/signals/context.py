"""One flight and what was derived from it, each thing computed once, when first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..flight import Flight
from ..sources.lost_poses import without_placeholders

T = TypeVar("T")
LARGEST = 1e8
"""Beyond, in SI units, a number is no measurement, and its square may overflow."""
QUATERNION = ("qx", "qy", "qz", "qw")


class Context:
    """``context.once(f)`` is ``f(context)``, kept: checks that need the same derived signal share it.

    ``context.flight`` has only rows with a numeric timestamp, because other rows have no place in time. Values that
    are missing or larger than any measurement, quaternions of four zeros and placeholders of lost poses are NaN.
    """

    def __init__(self, flight: Flight, known: Mapping[Callable[..., Any], Any] | None = None) -> None:
        """known: values of functions that this flight cannot show."""
        self.flight = _placed(flight)
        self._kept: dict[Callable[..., Any], Any] = dict(known or {})

    def once(self, function: Callable[[Context], T]) -> T:
        """The value of ``function`` for this flight; ``function`` must be pure."""
        if function not in self._kept:
            self._kept[function] = function(self)
        found: T = self._kept[function]
        return found


def _placed(flight: Flight) -> Flight:
    changed = {}
    flight = without_placeholders(flight)
    for name, stream in flight.streams.items():
        there = np.isfinite(stream.time_s)
        if not there.all():
            stream = stream.rows(there)
        with np.errstate(invalid="ignore"):
            measured = np.abs(stream.values) < LARGEST
        if all(q in stream.quantities for q in QUATERNION):
            turn = [stream.index(q) for q in QUATERNION]
            measured[:, turn] &= stream.values[:, turn].any(axis=1, keepdims=True)
        if not measured.all():
            stream = replace(stream, values=np.where(measured, stream.values, np.nan))
        if stream is not flight.streams[name]:
            changed[name] = stream
    return flight.with_streams(**changed) if changed else flight
