"""A parameter with its interval, and a recording that takes no part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .result import OPTIONAL, Result


@dataclass(frozen=True, repr=False)
class Value(Result):
    """A parameter without an interval."""

    value: float
    unit: str


@dataclass(frozen=True, repr=False)
class Estimate(Result):
    """A parameter; ``ci95``: 95 % interval; ``ci_why``: why it is missing or not to be trusted; ``prior_share``: how
    much of the value is prior knowledge, 1 where the flights cannot identify it, None where no prior was weighed."""

    value: float
    ci95: tuple[float, float] | None
    unit: str
    ci_why: str = field(default="", metadata=OPTIONAL)
    prior_share: float | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class LeftOut(Result):
    """A recording, and why it takes no part."""

    flight: str
    reason: str

    @classmethod
    def of(cls, reasons: Mapping[str, str]) -> tuple[LeftOut, ...]:
        """From reasons by name of the recording."""
        return tuple(cls(name, reason) for name, reason in reasons.items())
