"""Jumps of the tracked pose between two frames; limits and reasons are in ``faults.mocap_jump``."""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from .context import Context
from .crashes import crash_of
from .flown_axes import tracker_scale
from .held_poses import held_poses
from .spikes import spikes
from .step_removal import grouped, steps
from .usable_rows import tables, usable_streams

LIMIT_RAD = number("audit.pose_jumps.limit_rad")
BEND_RAD_S2 = number("audit.pose_jumps.bend_rad_s2")
LONGEST_S = number("audit.pose_jumps.longest_s")
BROKEN_S = number("audit.pose_jumps.broken_s")


@dataclass(frozen=True)
class PoseJump:
    """Jump between the frames at start_s and end_s. Size and limit are in m, or rad when ``rotation``. Offset (3,) is
    the step in m, world, or the rotation vector in rad, body."""

    start_s: float
    end_s: float
    size: float
    limit: float
    rotation: bool
    offset: tuple[float, ...]


def mocap_jumps(context: Context) -> list[PoseJump]:
    """Every jump of the tracked pose, in rising order of time."""
    stream = context.once(usable_streams).get("mocap")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    held = context.once(held_poses)
    if stream is None or len(stream) < 20 or held is None:
        return []
    turned = all(n in stream.quantities for n in names[3:])
    pose = stream[names if turned else names[:3]]
    keep = ~held.any
    for name, *_, first, last in context.once(spikes):
        if name == "mocap":
            keep[first : last + 1] = False
    t, pose = stream.time_s[keep], pose[keep]
    if len(t) < 20:
        return []
    p = pose[:, :3] / context.once(tracker_scale)
    i, offset, limit = steps(t, p)
    dt = t[i + 1] - t[i]
    step = np.linalg.norm(offset, axis=1)
    judged = (dt < LONGEST_S) & ~_stamps_broken(context, t[i]) & (t[i] < _until(context))
    moved = (step > limit) & judged
    jump, turn = np.zeros(len(i)), np.zeros((len(i), 3))
    if turned:
        q = pose[:, 3:] / np.maximum(np.linalg.norm(pose[:, 3:], axis=1, keepdims=True), 1e-9)
        angle = so3.geodesic_angle(q[:-1], q[1:])
        rate = angle / np.diff(t)
        jump = angle[i] - 0.5 * (rate[i - 1] + rate[i + 1]) * dt
        turn = so3.log(so3.multiply(so3.conjugate(q[i]), q[i + 1]))
    jumps = [PoseJump(float(t[i[k]]), float(t[i[k] + 1]), float(step[k]), float(limit[k]), False,
                      tuple(map(float, offset[k])))
             for k in _peaks(moved, step)]
    limit = LIMIT_RAD + BEND_RAD_S2 * dt**2
    jumps += [
        PoseJump(float(t[i[k]]), float(t[i[k] + 1]), float(jump[k]), float(limit[k]), True, tuple(map(float, turn[k])))
        for k in _peaks((jump > limit) & judged & ~moved, jump)
    ]
    return sorted(jumps, key=lambda x: x.start_s)


def _until(context: Context) -> float:
    crash = context.once(crash_of)
    return np.inf if crash is None else crash.start_s


def _stamps_broken(context: Context, at_s: np.ndarray) -> np.ndarray:
    """(n,) bool: next to rows with wrong timestamps, so that the time between two frames is unknown."""
    broken = np.zeros(len(at_s), dtype=bool)
    for _, t in context.once(tables):
        for k in np.flatnonzero(np.diff(t) <= 0.0):
            broken |= (at_s > t[k + 1] - BROKEN_S) & (at_s < t[k] + BROKEN_S)
    return broken


def _peaks(flags: np.ndarray, size: np.ndarray) -> list[int]:
    """The largest of every group of flags that are closer than the frames a step disturbs."""
    return [int(g[np.argmax(size[g])]) for g in grouped(np.flatnonzero(flags))]
