"""Information at a moment from the past only: velocity from earlier poses, vehicle streams as far as they had arrived.

The published start of Task 1 contains some of the future. Its velocity is a centred filter over eleven poses, and
every row of a stream interpolated between packets contains part of the next packet.
"""

import numpy as np

from ..flight import Flight, Stream
from ..settings import count
from ..sources.interpolation import carries_no_packet

ORDER = count("prediction.backward.order")
ROWS = count("prediction.backward.rows")
CENTRED_ROWS = 5
"""A centred velocity of the recordings looks as many rows ahead (Savitzky-Golay, 11 rows)."""


def velocity(time_s: np.ndarray, position_m: np.ndarray, rows: np.ndarray, back: int = 0) -> np.ndarray:
    """(n, back + 1, 3) m/s at ``rows`` (n,) and the ``back`` rows before each, oldest first.

    It is the derivative of the polynomial of ORDER through the last ROWS positions up to ``rows``, at their
    timestamps.

    time_s (m,) s, position_m (m, 3) m. The first rows of a recording have fewer predecessors: the first is repeated
    there with weight zero in the fit.
    """
    index = rows[:, None] + np.arange(1 - ROWS, 1)
    there = index >= 0
    index = np.maximum(index, 0)
    since = time_s[index] - time_s[rows][:, None]
    scale = np.maximum(-since[:, :1], 1e-9)
    powers = (since / scale)[..., None] ** np.arange(ORDER + 1)
    fitted = np.linalg.pinv(powers * there[..., None]) @ (position_m[index] - position_m[rows][:, None])
    at = (time_s[np.maximum(rows[:, None] + np.arange(-back, 1), 0)] - time_s[rows][:, None]) / scale
    order = np.arange(1, ORDER + 1)
    slopes = order * at[..., None] ** (order - 1)
    return np.asarray(slopes @ fitted[:, 1:] / scale[..., None])


def newest(flight: Flight, stream: Stream, at_s: np.ndarray) -> np.ndarray:
    """(n,) newest row of ``stream`` that was whole at ``at_s`` (n,) s.

    For a stream with its own timestamps, the last row not later. For one on the rows of the motion capture, a row is
    whole when the packet after it has arrived. A bend of a later row shows that. The packet may have come on either
    side of the bend, so the row before it counts.
    """
    last = np.searchsorted(stream.time_s, at_s + 1e-9, side="right") - 1
    if not np.array_equal(stream.time_s, flight["mocap"].time_s):
        return np.maximum(last, 0)
    bent = np.flatnonzero(~carries_no_packet(stream.time_s, stream.values))
    found = np.searchsorted(bent, last - 1, side="right") - 1
    return np.maximum(np.where(found >= 0, bent[np.maximum(found, 0)] - 1, 0), 0)
