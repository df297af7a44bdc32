"""Velocities that were written in the axes of the body: turned by the attitude, they fit the path of their stream."""

from collections.abc import Iterator

import numpy as np

from .. import so3
from ..flight import Stream, make_stream
from ..sources.bag_twist import BETTER, error_m_s
from .context import Context
from .estimated_turning import known_estimate
from .held_poses import POSITION, ROTATION
from .pose_frame import posed
from .shared_frame import PLACE
from .usable_rows import usable_streams

VELOCITY = ("vx", "vy", "vz")
FEWEST_ROWS = 100
LEAST_M_S = 0.05
"""A velocity that fits the path within it is in the world, or the path is too slow to show more."""


def body_velocities(context: Context) -> list[tuple[str, float, float]]:
    """(stream, median error [m/s] as written, turned from body to world) of each whose velocity is in the body."""
    found = []
    for stream, place, turn in _moving(context):
        rows = np.isfinite(stream[[*place, *VELOCITY]]).all(axis=1)
        if rows.sum() < FEWEST_ROWS or not (np.diff(stream.time_s[rows]) > 0.0).all():
            continue
        time_s, path, velocity = stream.time_s[rows], stream[place][rows], stream[VELOCITY][rows]
        at = so3.rotate(so3.interpolate(turn.time_s, turn[ROTATION], time_s), velocity)
        written, turned = error_m_s(velocity, path, time_s), error_m_s(at, path, time_s)
        if written > LEAST_M_S and turned * BETTER < written:
            found.append(("mocap" if place == POSITION else "estimator", written, turned))
    return found


def _moving(context: Context) -> Iterator[tuple[Stream, tuple[str, ...], Stream]]:
    """Streams with position and velocity, the names of the position, and attitudes."""
    poses, estimate = context.once(posed), known_estimate(context)
    if poses is not None and all(q in poses for q in (*POSITION, *VELOCITY, *ROTATION)):
        good = np.isfinite(poses[ROTATION]).all(axis=1)
        if good.sum() > FEWEST_ROWS:
            yield poses, POSITION, make_stream("mocap", poses.time_s[good], poses[ROTATION][good], ROTATION)
    own = context.once(usable_streams).get("estimator")
    if own is not None and estimate is not None and all(q in own for q in (*PLACE, *VELOCITY)):
        yield own, PLACE, estimate
