"""clock_wander: the time error of a stream moves within the flight, beyond a constant and a line.

Found by scatter that noise does not explain (``clock.moving``): half-second lags of gyro and attitude against a placebo
fit with the same spectrum, and the estimated position along its path against its error across. In the published
recordings the link's clock wanders by 33 ms in steps of tenths of a second; half seconds average part of that out, so
the size of a fast wander is best taken from the track.

Size: standard deviation in s. Smallest found: stated per stream; 4 ms on the track, 4-20 ms from the gyro.
"""

from __future__ import annotations

from ..clock.moving import moving_clocks
from ..content.context import Context
from ..flight import Fault, Flight
from .making import over_stream

KIND = "clock_wander"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream."""
    return [
        over_stream(KIND, flight, name, None, clock.wander_sd_s, "s", clock.wander_evidence, clock.detectable_wander_s)
        for name, clock in context.once(moving_clocks).items()
        if clock.wanders
    ]
