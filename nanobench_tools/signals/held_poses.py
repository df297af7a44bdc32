"""Rows of the motion capture without a measured pose: no numbers, a repeated pose, or a straight line."""

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .context import Context
from .packet_rows import PRINT_RESOLUTION
from .usable_rows import runs, typical_step_s, usable_streams

LEAST_STEP_M = number("audit.held_poses.least_step_m")
CATCHES_UP = number("audit.held_poses.catches_up")
CAUGHT_UP_M = number("audit.held_poses.caught_up_m")
"""And by so much more."""
RESTS_S = number("audit.held_poses.rests_s")
POSITION, ROTATION = ("px", "py", "pz"), ("qx", "qy", "qz", "qw")


@dataclass(frozen=True)
class HeldPoses:
    """(n,) bool each, over the usable rows of the motion capture.

    - lost: no numbers.
    - same: as the row before, or a position that stays constant until it jumps on. The rest before the first motion
      does not count (``first_rest``).
    - drawn: on the chord of its neighbours, moving."""

    lost: np.ndarray
    same: np.ndarray
    drawn: np.ndarray

    @property
    def any(self) -> np.ndarray:
        return np.asarray(self.lost | self.same | self.drawn)


def held_poses(context: Context) -> HeldPoses | None:
    """None without poses, or when one of their columns never holds a number (missing, not occluded).

    Rotations may be filled along an arc, so straight lines are looked for in the position.
    """
    stream = context.once(usable_streams).get("mocap")
    names = [q for q in POSITION + ROTATION if stream is not None and q in stream.quantities]
    if stream is None or len(stream) < 3 or not set(POSITION) <= set(names):
        return None
    pose, t = stream[names], stream.time_s
    finite = np.isfinite(pose)
    if finite.any() and not finite.any(axis=0).all():
        return None
    lost = ~finite.all(axis=1)
    same = np.zeros(len(t), dtype=bool)
    same[1:] = (pose[1:] == pose[:-1]).all(axis=1)
    p = pose[:, :3]
    same[:first_rest(context)] = False
    same |= _stands(t, p)
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    bend = np.abs(p[1:-1] - (p[:-2] + (p[2:] - p[:-2]) * share))
    drawn = np.zeros(len(t), dtype=bool)
    drawn[1:-1] = (bend <= PRINT_RESOLUTION).all(axis=1) & (np.abs(p[1:-1] - p[:-2]) > LEAST_STEP_M).any(axis=1)
    return HeldPoses(lost, same & ~lost, drawn & ~same & ~lost)


def first_rest(context: Context) -> int:
    """Rows before the first motion in which a body rests and every pose is the same; 0 where they differ by noise.

    The poses then go on without a jump, so the body was there. A tracker without noise at rest (a filter, a rounding, a
    simulator) repeats the pose of a body on the ground. That is no occlusion."""
    stream = context.once(usable_streams).get("mocap")
    if stream is None or not all(q in stream.quantities for q in POSITION):
        return 0
    pose = stream[[q for q in POSITION + ROTATION if q in stream.quantities]]
    moved = np.flatnonzero((pose[1:] != pose[:-1]).any(axis=1))
    if not len(moved) or not np.isfinite(pose[: moved[0] + 2]).all():
        return 0
    rows = int(moved[0]) + 1
    step = np.linalg.norm(np.diff(stream[POSITION], axis=0), axis=1)
    rests = stream.time_s[rows - 1] - stream.time_s[0] >= RESTS_S and step[rows - 1] <= _jump_m(step)
    return rows if rests else 0


def _jump_m(step: np.ndarray) -> float:
    """A step that is larger than this went on from where the body had moved meanwhile."""
    usual = step[np.isfinite(step) & (step > 0.0)]
    return CAUGHT_UP_M + CATCHES_UP * float(np.median(usual)) if len(usual) else np.inf


def _stands(time_s: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(n,) bool: rows of a position that repeats exactly and then goes on by more than usual steps, as if it had moved
    meanwhile. The rotation is not used. A tracker that rests and rounds goes on by one step."""
    flags = np.zeros(len(position), dtype=bool)
    with np.errstate(invalid="ignore"):
        step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    least = _jump_m(step)
    for a, b in runs(np.concatenate(([False], step == 0.0))):
        flags[a:b] = b - a > 1 and b < len(position) and step[b - 1] > least and (
            time_s[b] - time_s[b - 1] < 2.0 * typical_step_s(time_s))  # over a gap any position goes on
    return flags
