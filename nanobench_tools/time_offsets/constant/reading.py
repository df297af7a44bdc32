"""Clock of one stream."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ...results.result import Result, named


@dataclass(frozen=True, repr=False)
class ClockReading(Result):
    """``offset_s`` > 0: the stream's timestamps are late against the motion capture; subtract it.

    ``ci95_s``: interval of the constant offset, or None; identifiable False (offset nan) with the reason in words;
    ``wander_sd_s``: standard deviation of what a constant leaves of the time error, nan when unknown; ``warp``: (t_s,
    offset_s, sd_s) of an error that moves, empty when it was not estimated; ``evidence``: the kinds of streams used to
    estimate it.
    """

    offset_s: float
    ci95_s: tuple[float, float] | None
    identifiable: bool
    reason: str
    wander_sd_s: float = math.nan
    warp: tuple[tuple[float, float, float], ...] = ()
    evidence: tuple[str, ...] = field(default=(), metadata=named("clock_evidence"))

    @classmethod
    def unknown(cls, reason: str) -> ClockReading:
        """Not identifiable, because ``reason``."""
        return cls(math.nan, None, False, reason)
