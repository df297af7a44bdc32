"""The turning of the vehicle by its estimated attitude."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..flight import Stream, make_stream
from .context import Context
from .held_poses import ROTATION
from .quaternions import quaternion_orders
from .usable_rows import usable_streams

EULER = ("roll", "pitch", "yaw")


def estimated_attitude(context: Context) -> Stream | None:
    """The vehicle's estimate of its attitude as quaternions x, y, z, w, from whichever form was logged."""
    streams = context.once(usable_streams)
    if "attitude_qw" in streams and all(q in streams["attitude_qw"] for q in ROTATION):
        stream, found = streams["attitude_qw"], context.once(quaternion_orders).get("attitude_qw")
        if found is None or found.reading.as_stored:
            return stream
        return make_stream("attitude_qw", stream.time_s, found.reading.of(stream[ROTATION]), ROTATION)
    angles = streams.get("attitude")
    if angles is None or not all(q in angles for q in EULER):
        return None
    return make_stream("attitude_qw", angles.time_s, so3.from_euler_zyx(*angles[EULER].T), ROTATION)


def rates_of(turn: Stream) -> tuple[np.ndarray, np.ndarray]:
    """times (n,) s and body rates (n, 3) rad/s between rows of an attitude."""
    q = so3.make_continuous(turn[ROTATION])
    step = np.diff(turn.time_s)
    known = (step > 0.0) & np.isfinite(q[1:]).all(axis=1) & np.isfinite(q[:-1]).all(axis=1)
    between = so3.multiply(so3.conjugate(q[:-1][known]), q[1:][known])
    return 0.5 * (turn.time_s[1:] + turn.time_s[:-1])[known], so3.log(between) / step[known, None]
