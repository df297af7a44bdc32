"""Estimated angles against a tracked path without an attitude: a vehicle speeds up towards the side to which it tilts.

Angles and a gyro that agree may both be wrong, and one of the two may be where they contradict each other. The path
decides, at any heading between the two worlds. The reading of the angles that it shows must be clearly better than the
stored one at every such heading. Roll and pitch that are both negated look like a heading of half a turn, and stay.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from ..flight import make_stream
from .context import Context
from .dropouts import alive_until
from .estimated_turning import EULER, GYRO
from .flown_axes import UP, tilts_of, tracker_scale
from .held_poses import POSITION, ROTATION
from .own_turning import own_turning
from .pose_frame import PoseFrame, pose_frame
from .quaternion_reading import CLEARLY, FITS
from .usable_rows import advancing, usable_streams

HEADINGS = np.radians(np.arange(0.0, 360.0, 15.0))
MIRRORED = ((1.0, -1.0, 1.0), (1.0, -1.0, -1.0))
"""Signs of roll, pitch and yaw: one of the two that tilt, alone or with the yaw (a compass)."""
AS_GOOD = 0.02
"""Of two readings that follow within this, the one with fewer changes is taken: a yaw that stays shows no sign."""


@dataclass(frozen=True)
class TiltReading:
    """``angles``: names of the negated angles, ``gyro``: of the axes of the gyro that turn with them. Correlations of
    tilt and acceleration as ``stored`` at the best heading, and with these angles negated."""

    angles: tuple[str, ...]
    gyro: tuple[str, ...]
    stored: float
    follows: float


def tracked_tilt(context: Context) -> TiltReading | None:
    """The signs of the angles of ``attitude`` that the path shows; None where they are as stored, or nothing shows."""
    found = _tracked(context)
    if found is None:
        return None
    time_s, path, angles = found
    follows = {signs: _follows(time_s, path, angles * signs) for signs in product((1.0, -1.0), repeat=3)}
    if max(follows.values()) < FITS:  # as a mirror image in a world of another heading, a roll looks like a pitch
        follows = {signs: _at_any_heading(time_s, path, angles * signs) for signs in MIRRORED}
    most = max(follows.values())
    best = max((s for s in follows if follows[s] > most - AS_GOOD), key=sum)
    if most < FITS or sum(best) == 3.0:
        return None
    stored = _at_any_heading(time_s, path, angles)
    if most < stored + CLEARLY:
        return None
    own = context.once(own_turning)
    negated = [k for k in range(3) if best[k] < 0.0]
    with_it = [] if own is None or own.order != (0, 1, 2) else [k for k in negated if own.follows[k, k] > FITS]
    return TiltReading(tuple(EULER[k] for k in negated), tuple(GYRO[k] for k in with_it), stored, follows[best])


def completed_poses(context: Context) -> Context | None:
    """The recording with the estimated angles as the attitude of the tracked path, as they are stored."""
    found = _tracked(context)
    if found is None:
        return None
    time_s, path, angles = found
    turn = Rotation.from_euler("ZYX", angles[:, ::-1]).as_quat()
    poses = make_stream("mocap", time_s, np.column_stack([path, turn]), (*POSITION, *ROTATION))
    return Context(context.flight.with_streams(mocap=poses), {tracker_scale: 1.0, pose_frame: PoseFrame()})


def _tracked(context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Times, path (n, 3) and angles (n, 3) of a motion capture without an attitude; None without one."""
    streams = context.once(usable_streams)
    poses, stream = streams.get("mocap"), streams.get("attitude")
    if poses is None or stream is None or any(q in poses for q in ROTATION):
        return None
    if not all(q in poses for q in POSITION) or not all(q in stream for q in EULER):
        return None
    known = np.isfinite(stream[EULER]).all(axis=1) & advancing(stream.time_s)
    at, angles = stream.time_s[known], np.unwrap(stream[EULER][known], axis=0)
    if len(at) < 2:
        return None
    end = min(at[-1], *(context.once(alive_until)[name] for name in ("mocap", "attitude")))
    t = poses.time_s
    use = np.isfinite(poses[POSITION]).all(axis=1) & advancing(t) & (t >= at[0]) & (t <= end)
    return t[use], poses[POSITION][use], np.stack([np.interp(t[use], at, a) for a in angles.T], axis=1)


def _at_any_heading(time_s: np.ndarray, path: np.ndarray, angles: np.ndarray) -> float:
    return max(_follows(time_s, path, angles + np.array([0.0, 0.0, heading])) for heading in HEADINGS)


def _follows(time_s: np.ndarray, path: np.ndarray, angles: np.ndarray) -> float:
    """Correlation of tilt and acceleration along the axis that follows least; -1 without motion."""
    if len(time_s) < 2:
        return -1.0
    tilt = tilts_of(time_s, path, Rotation.from_euler("ZYX", angles[:, ::-1]).as_quat()).get((UP, UP))
    return -1.0 if tilt is None or math.isnan(tilt.each) else tilt.each
