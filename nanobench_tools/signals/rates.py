"""How many values a sensor really sent, and how often."""

from dataclasses import dataclass

import numpy as np

from ..sources.interpolation import count_packets
from .context import Context
from .dropouts import alive_until


@dataclass(frozen=True)
class RateReading:
    """samples: values the sensor sent (interpolated rows do not count); rate_hz: samples per second while it lived."""

    samples: int
    rate_hz: float


def rates_of(context: Context) -> dict[str, RateReading]:
    """A reading for every stream: the count of the recording's sheet, else the chord test's."""
    alive = context.once(alive_until)
    readings = {}
    for name, stream in context.flight.streams.items():
        samples = stream.samples
        if samples is None:
            samples = len(stream) if name in ("mocap", "stand") else count_packets(stream.time_s, stream.values).count
        lived = alive.get(name, np.nan) - (stream.time_s[0] if len(stream) else np.nan)
        readings[name] = RateReading(int(samples), float(samples / lived) if lived > 0.0 else float("nan"))
    return readings
