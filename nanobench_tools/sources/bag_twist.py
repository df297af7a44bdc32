"""The velocity of an Odometry in the world. It should be in the body (``nav_msgs/Odometry``); many programs write it in
the world, which its positions show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import so3

STEP_S = 0.1
"""Over which the path is compared: the time in which a quadrotor turns little and moves further than its noise."""
BETTER = 2.0
"""The velocity is in the world where its error, so read, is smaller by this factor, at least."""


def twist_in_world(velocity: np.ndarray, messages: Sequence[Any], time_ns: np.ndarray) -> tuple[np.ndarray, str]:
    """``velocity`` (n, 3) as written, in the world, and a note where it was so written.

    messages: Odometry each; time_ns (n,): their times.
    """
    poses = [m.pose.pose for m in messages]
    turn = np.array([[p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w] for p in poses], float)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = so3.rotate(turn / np.linalg.norm(turn, axis=1, keepdims=True), velocity)
    place = np.array([[p.position.x, p.position.y, p.position.z] for p in poses], float)
    as_written, as_defined = (error_m_s(v, place, 1e-9 * (time_ns - time_ns[0])) for v in (velocity, turned))
    if as_written * BETTER < as_defined:
        return velocity, ("its velocity is in the world, not in the body: its positions move by it "
                          f"(median error {as_written:.2g} m/s, turned from the body {as_defined:.2g} m/s)")
    return turned, ""


def error_m_s(velocity: np.ndarray, place: np.ndarray, time_s: np.ndarray) -> float:
    """Median difference between ``velocity`` and the motion of the path in ``STEP_S``, in its faster half. It is 0
    where the path is too short."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    rows = round(STEP_S / step) if step > 0.0 else 0
    rows = max(rows, 1)
    if len(time_s) < 2 * rows + 2:
        return 0.0
    passed = time_s[rows:] - time_s[:-rows]
    total = np.vstack([np.zeros((1, 3)), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0)])
    mean = (total[rows:] - total[:-rows]) / rows
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = (place[rows:] - place[:-rows]) / passed[:, None]
    speed, error = np.linalg.norm(moves, axis=1), np.linalg.norm(moves - mean, axis=1)
    known = (passed > 0.0) & np.isfinite(error)
    if not known.any():
        return 0.0
    return float(np.median(error[known & (speed >= np.median(speed[known]))]))
