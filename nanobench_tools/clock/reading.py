"""What is known about the clock of one stream."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ClockReading:
    """``offset_s`` > 0: the stream's stamps are late against the motion capture; subtract it.

    ci95_s: interval of the constant offset, None when there is none; identifiable False (offset nan) with the reason
    in words; wander_sd_s: standard deviation of what a constant leaves of the time error, nan when unknown; warp:
    (t_s, offset_s, sd_s) of an error that moves, empty when it was not estimated; evidence: the kinds of streams that
    had a vote in it.
    """

    offset_s: float
    ci95_s: tuple[float, float] | None
    identifiable: bool
    reason: str
    wander_sd_s: float = math.nan
    warp: tuple[tuple[float, float, float], ...] = ()
    evidence: tuple[str, ...] = ()

    @classmethod
    def unknown(cls, reason: str) -> ClockReading:
        """Not identifiable, because ``reason``."""
        return cls(math.nan, None, False, reason)

    def to_json(self) -> dict[str, Any]:
        """JSON shape of the audit; numbers that do not exist are None."""

        def number(value: float) -> float | None:
            return float(value) if math.isfinite(value) else None

        return {
            "offset_s": number(self.offset_s),
            "ci95_s": None if self.ci95_s is None else list(self.ci95_s),
            "identifiable": self.identifiable,
            "reason": self.reason,
            "wander_sd_s": number(self.wander_sd_s),
            "warp": [list(point) for point in self.warp],
            "clock_evidence": list(self.evidence),
        }

    @classmethod
    def from_json(cls, body: Mapping[str, Any]) -> ClockReading:
        """The inverse of ``to_json``."""

        def number(value: float | None) -> float:
            return math.nan if value is None else float(value)

        return cls(number(body["offset_s"]), None if body["ci95_s"] is None else tuple(body["ci95_s"]),
                   body["identifiable"], body.get("reason", ""), number(body["wander_sd_s"]),
                   tuple(tuple(point) for point in body["warp"]), tuple(body.get("clock_evidence", ())))
