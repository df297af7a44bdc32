"""When the vehicle was in the air: first to last crossing of 5 cm above the resting height."""

from __future__ import annotations

import numpy as np

from ..flight import Span
from .context import Context
from .ranges import tracker_scale
from .rows import usable_streams

HEIGHT_M = 0.05
"""Above the resting height; a vehicle of 40 g stands within 1 mm and rebounds by 2-14 cm after touch-down."""


def resting_height_m(z: np.ndarray) -> float:
    """The lowest height it stood at: the median of the first or last half second, or the 2 % point if that is lower."""
    n = min(len(z), 50)
    return float(min(np.median(z[:n]), np.median(z[-n:]), np.quantile(z, 0.02) + 0.01))


def height_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,), z (n,) m of the motion capture, else of the estimator; None without either."""
    streams = context.once(usable_streams)
    for name, column in (("mocap", "pz"), ("estimator", "z")):
        if name in streams and column in streams[name].quantities:
            stream = streams[name]
            z = stream[column] / (context.once(tracker_scale) if name == "mocap" else 1.0)
            good = np.isfinite(z)
            if good.sum() > 1:
                return stream.time_s[good], z[good]
    return None


def airborne_spans(context: Context) -> tuple[Span, ...]:
    """One span, or none if it never left the ground or there is no height to tell.

    A recording that starts or ends in the air is airborne from its first or to its last row. Rows that stick out
    alone (spikes of the tracker) do not count: three in a row must be up.
    """
    height = context.once(height_of)
    if height is None:
        return ()
    time_s, z = height
    up = z > resting_height_m(z) + HEIGHT_M
    lasting = up.copy()
    lasting[1:-1] = (up[:-2] & up[1:-1]) | (up[1:-1] & up[2:])
    rows = np.flatnonzero(lasting)
    return (Span(float(time_s[rows[0]]), float(time_s[rows[-1]])),) if len(rows) > 2 else ()
