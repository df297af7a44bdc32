"""When the vehicle was in the air: first to last crossing of 5 cm above the resting height."""

from __future__ import annotations

import numpy as np

from ..flight import Span
from .context import Context

HEIGHT_M = 0.05
"""Above the resting height; a vehicle of 40 g stands within 1 mm and rebounds by 2-14 cm after touch-down."""


def resting_height_m(z: np.ndarray) -> float:
    """The lowest height it stood at: median of the start, of the end, or the 2 % point where neither is lower."""
    n = min(len(z), 50)
    return float(min(np.median(z[:n]), np.median(z[-n:]), np.quantile(z, 0.02) + 0.01))


def airborne_spans(context: Context) -> tuple[Span, ...]:
    """One span, or none if it never left the ground or there is no height to tell."""
    flight = context.flight
    for stream, column in (("mocap", "pz"), ("estimator", "z")):
        if stream in flight and column in flight[stream] and len(flight[stream]) > 1:
            s = flight[stream]
            z = s[column]
            good = np.isfinite(z)
            if not good.any():
                continue
            up = np.flatnonzero(good & (z > resting_height_m(z[good]) + HEIGHT_M))
            return (Span(float(s.time_s[up[0]]), float(s.time_s[up[-1]])),) if len(up) > 1 else ()
    return ()
