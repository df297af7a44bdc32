"""Family and speed of a recording as the reader found them: from its sheet, else from its path."""

from __future__ import annotations

from ..flight import Flight

UNKNOWN = "unknown"

FILTERS_SEARCHED_ON = ("circle", "trefoil")
"""Families whose recordings set noise and drag of the inertial filters (``benchmarks/studies/tune_filters.py``)."""
OTHER_FAMILIES = "other_families"
"""Group of the flights of all others: they judge the filters and set nothing of them."""


def family_of(flight: Flight) -> str:
    """``circle`` ``figure_eight`` ``oval`` ``star`` ``trefoil`` ... or unknown; never from the name."""
    return str(flight.metadata.get("family") or UNKNOWN)


def speed_of(flight: Flight) -> str | None:
    """``slow`` ``medium`` ``fast``, or None."""
    speed = flight.metadata.get("speed")
    return str(speed) if speed else None
