"""Which of the two diagnoses judges by default: the one that was right more often on such recordings.

Wrong simulators on flights of six vehicles (``nanobench prove --corrupted``): without set-points, or with collective
commands, the posterior identifies more effects than the rules on four of five vehicles and as many on the fifth, with
no more false ones. Where moments have to be compared through set-points it has as many, and more false ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from nanobench_tools.flight import Flight
from nanobench_tools.physics import Model

from .diagnosis import diagnose as by_rules
from .diagnosis import verdict_of_flights
from .posterior.posterior_engine import diagnose as by_posterior
from .recordings import Recordings
from .verdict import Verdict


def through_set_points(recordings: Recordings) -> bool:
    """Whether moments are compared, and set-points move in judged rows."""
    return any(not t.forces_only and t.asked_rad_s2[t.counts].any() for t in recordings.tracks)


def diagnose(recordings: Recordings, simulator: Model, **how: Any) -> Verdict:
    """As ``identification.mismatch.diagnosis.diagnose``."""
    return (by_rules if through_set_points(recordings) else by_posterior)(recordings, simulator, **how)


def diagnose_flights(flights: Sequence[Flight], simulator: Model, *, seed: int = 0,
                     progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """As ``identification.mismatch.diagnosis.diagnose_flights``."""
    return verdict_of_flights(diagnose, flights, simulator, seed=seed, progress=progress)


__all__ = ["by_posterior", "by_rules", "diagnose", "diagnose_flights", "through_set_points"]
