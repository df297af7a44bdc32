"""Leaps of the tracked pose between two frames and the stretches they displace; limits and reasons stand in
``faults.mocap_jump``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from .context import Context
from .crashes import crash_of
from .held_poses import filled_poses
from .plausible_ranges import tracker_scale
from .spikes import spikes
from .step_removal import grouped, steps
from .usable_rows import tables, usable_streams, whole_span

LIMIT_RAD = number("audit.pose_jumps.limit_rad")
BEND_RAD_S2 = number("audit.pose_jumps.bend_rad_s2")
LONGEST_S = number("audit.pose_jumps.longest_s")
"""Over longer holes no leap is looked for."""
BROKEN_S = number("audit.pose_jumps.broken_s")
"""Rows this near to a broken stamp are not judged."""


@dataclass(frozen=True)
class Leap:
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
    """From start_s to end_s the poses are off those of the rest; before, after: the leaps at its ends, None at an end
    of the recording."""

    start_s: float
    end_s: float
    before: Leap | None
    after: Leap | None

    @property
    def leap(self) -> Leap:
        """The one that leads into it, else the one out of it."""
        found = self.before or self.after
        if found is None:
            raise ValueError("a displaced stretch has a leap at one of its ends")
        return found


def displaced_stretches(context: Context) -> list[Displaced]:
    """The stretches between leaps whose poses stand in another frame than the longest consistent part.

    A leap that a later one undoes leads back to the same frame, so stretches with the same sum of leaps belong
    together. Leaps are known to within their limits; half of the smallest one is the most that counts as the same.
    """
    leaps = context.once(mocap_leaps)
    if not leaps:
        return []
    span = context.once(whole_span)
    starts = np.array([span.start_s, *(leap.end_s for leap in leaps)])
    ends = np.array([*(leap.start_s for leap in leaps), span.end_s])
    same = np.ones((len(starts), len(starts)), dtype=bool)
    for rotation in (False, True):
        kind = [leap for leap in leaps if leap.rotation == rotation]
        if not kind:
            continue
        steps = np.array([leap.offset if leap.rotation == rotation else (0.0, 0.0, 0.0) for leap in leaps])
        at = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        off = np.linalg.norm(at[:, None] - at[None, :], axis=2)
        same &= off < min(2.0 * max(leap.limit for leap in kind), 0.5 * min(leap.size for leap in kind))
    kept = same[int(np.argmax(same @ np.maximum(ends - starts, 0.0)))]
    return [
        Displaced(
            float(start if before is None else before.start_s),
            float(end if after is None else after.end_s),
            before,
            after,
        )
        for rest, start, end, before, after in zip(kept, starts, ends, [None, *leaps], [*leaps, None], strict=True)
        if not rest
    ]


def mocap_leaps(context: Context) -> list[Leap]:
    """Every leap of the tracked pose, in rising order of time."""
    stream = context.once(usable_streams).get("mocap")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    filled = context.once(filled_poses)
    if stream is None or len(stream) < 20 or filled is None:
        return []
    turned = all(n in stream.quantities for n in names[3:])
    pose = stream[names if turned else names[:3]]
    keep = ~filled.any
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
    leap, turn = np.zeros(len(i)), np.zeros((len(i), 3))
    if turned:
        q = pose[:, 3:] / np.maximum(np.linalg.norm(pose[:, 3:], axis=1, keepdims=True), 1e-9)
        angle = so3.geodesic_angle(q[:-1], q[1:])
        rate = angle / np.diff(t)
        leap = angle[i] - 0.5 * (rate[i - 1] + rate[i + 1]) * dt
        turn = so3.log(so3.multiply(so3.conjugate(q[i]), q[i + 1]))
    leaps = [
        Leap(float(t[i[k]]), float(t[i[k] + 1]), float(step[k]), float(limit[k]), False, tuple(map(float, offset[k])))
        for k in _peaks(moved, step)
    ]
    limit = LIMIT_RAD + BEND_RAD_S2 * dt**2
    leaps += [
        Leap(float(t[i[k]]), float(t[i[k] + 1]), float(leap[k]), float(limit[k]), True, tuple(map(float, turn[k])))
        for k in _peaks((leap > limit) & judged & ~moved, leap)
    ]
    return sorted(leaps, key=lambda x: x.start_s)


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
