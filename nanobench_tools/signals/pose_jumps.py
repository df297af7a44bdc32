"""Jumps of the tracked pose between two frames and the stretches they displace; limits and reasons stand in
``faults.mocap_jump``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from .context import Context
from .crashes import crash_of
from .held_poses import held_poses
from .plausible_ranges import tracker_scale
from .spikes import spikes
from .step_removal import grouped, steps
from .usable_rows import tables, usable_streams, whole_span

LIMIT_RAD = number("audit.pose_jumps.limit_rad")
BEND_RAD_S2 = number("audit.pose_jumps.bend_rad_s2")
LONGEST_S = number("audit.pose_jumps.longest_s")
"""Over longer holes no jump is looked for."""
BROKEN_S = number("audit.pose_jumps.broken_s")
"""Rows this near to a broken stamp are not judged."""


@dataclass(frozen=True)
class PoseJump:
    """Between the frames at start_s and end_s; size and limit in m, or rad when ``rotation``; offset (3,) the step in
    m, world, or the rotation vector in rad, body."""

    start_s: float
    end_s: float
    size: float
    limit: float
    rotation: bool
    offset: tuple[float, ...]


@dataclass(frozen=True)
class Displaced:
    """From start_s to end_s the poses are off those of the rest; before, after: the jumps at its ends, None at an end
    of the recording."""

    start_s: float
    end_s: float
    before: PoseJump | None
    after: PoseJump | None

    @property
    def jump(self) -> PoseJump:
        """The one that leads into it, else the one out of it."""
        found = self.before or self.after
        if found is None:
            raise ValueError("a displaced stretch has a jump at one of its ends")
        return found


def displaced_stretches(context: Context) -> list[Displaced]:
    """The stretches between jumps whose poses stand in another frame than the longest consistent part.

    A jump that a later one undoes leads back to the same frame, so stretches with the same sum of jumps belong
    together. Jumps are known to within their limits; half of the smallest one is the most that counts as the same.
    """
    jumps = context.once(mocap_jumps)
    if not jumps:
        return []
    span = context.once(whole_span)
    starts = np.array([span.start_s, *(jump.end_s for jump in jumps)])
    ends = np.array([*(jump.start_s for jump in jumps), span.end_s])
    same = np.ones((len(starts), len(starts)), dtype=bool)
    for rotation in (False, True):
        kind = [jump for jump in jumps if jump.rotation == rotation]
        if not kind:
            continue
        steps = np.array([jump.offset if jump.rotation == rotation else (0.0, 0.0, 0.0) for jump in jumps])
        at = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        off = np.linalg.norm(at[:, None] - at[None, :], axis=2)
        same &= off < min(2.0 * max(jump.limit for jump in kind), 0.5 * min(jump.size for jump in kind))
    kept = same[int(np.argmax(same @ np.maximum(ends - starts, 0.0)))]
    return [
        Displaced(
            float(start if before is None else before.start_s),
            float(end if after is None else after.end_s),
            before,
            after,
        )
        for rest, start, end, before, after in zip(kept, starts, ends, [None, *jumps], [*jumps, None], strict=True)
        if not rest
    ]


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
    jumps = [
        PoseJump(float(t[i[k]]), float(t[i[k] + 1]), float(step[k]), float(limit[k]), False,
                 tuple(map(float, offset[k])))
        for k in _peaks(moved, step)
    ]
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
    """(n,) bool: beside rows whose stamps were wrong, so that the time between two frames is not known."""
    broken = np.zeros(len(at_s), dtype=bool)
    for _, t in context.once(tables):
        for k in np.flatnonzero(np.diff(t) <= 0.0):
            broken |= (at_s > t[k + 1] - BROKEN_S) & (at_s < t[k] + BROKEN_S)
    return broken


def _peaks(flags: np.ndarray, size: np.ndarray) -> list[int]:
    """The largest of every group of flags that are closer than the frames a step disturbs."""
    return [int(g[np.argmax(size[g])]) for g in grouped(np.flatnonzero(flags))]
