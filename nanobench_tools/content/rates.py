"""How many values a sensor really sent, and how often."""

from __future__ import annotations

from dataclasses import dataclass

from .context import Context


@dataclass(frozen=True)
class RateReading:
    """samples: values the sensor sent (interpolated rows do not count); rate_hz: samples per second while it lived."""

    samples: int
    rate_hz: float


def rates_of(context: Context) -> dict[str, RateReading]:
    """A reading for every stream."""
    return {name: RateReading(len(s) if s.samples is None else s.samples, s.rate_hz)
            for name, s in context.flight.streams.items()}
