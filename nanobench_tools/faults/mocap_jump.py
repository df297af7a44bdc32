"""mocap_jump: between two frames the tracked pose leaps and stays there (markers mixed up, model slipped).

Found by the step between two frames beyond what the mean velocity of the three frames on either side explains. A
vehicle bends its path by up to 9 mm in a frame (72 real flights, hard landings included), more over lost frames; so
the limit is 12 mm + 60 m/s^2 dt^2 (18 mm for a frame of 10 ms), and 0.2 rad for the rotation (noise of single frames
reaches 0.07). Samples that leap and come back within three rows are ``spike``. One entry per jump.

Size: metres, or radians for a rotation alone. Smallest found: the limit plus the noise of the poses.
"""

from __future__ import annotations

import numpy as np

from .. import so3
from ..content.context import Context
from ..content.ranges import tracker_scale
from ..content.rows import usable_streams
from ..flight import Fault, Flight
from .spike import spikes

KIND = "mocap_jump"

LIMIT_M, BEND_M_S2 = 0.012, 60.0
LIMIT_RAD = 0.2
SIDE = 3
"""Frames on either side that give the velocity."""


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per jump."""
    stream = context.once(usable_streams).get("mocap")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    if stream is None or not all(n in stream.quantities for n in names[:3]) or len(stream) < 20:
        return []
    turned = all(n in stream.quantities for n in names[3:])
    pose = stream[names if turned else names[:3]]
    keep = np.isfinite(pose).all(axis=1)
    for name, _, _, _, first, last in context.once(spikes):
        if name == "mocap":
            keep[first:last + 1] = False
    t, pose = stream.time_s[keep], pose[keep]
    if len(t) < 20:
        return []
    p = pose[:, :3] / context.once(tracker_scale)
    i = np.arange(SIDE, len(t) - SIDE - 1)
    before = (p[i] - p[i - SIDE]) / (t[i] - t[i - SIDE])[:, None]
    after = (p[i + 1 + SIDE] - p[i + 1]) / (t[i + 1 + SIDE] - t[i + 1])[:, None]
    dt = t[i + 1] - t[i]
    step = np.linalg.norm(p[i + 1] - p[i] - 0.5 * (before + after) * dt[:, None], axis=1)
    limit = LIMIT_M + BEND_M_S2 * dt**2
    moved = (step > limit) & (dt < 0.5)
    leap = np.zeros(len(i))
    if turned:
        q = pose[:, 3:] / np.maximum(np.linalg.norm(pose[:, 3:], axis=1, keepdims=True), 1e-9)
        angle = so3.geodesic_angle(q[:-1], q[1:])
        usual = 0.5 * (angle[i - 1] + angle[i + 1])
        leap = np.where(dt < 0.05, angle[i] - usual, 0.0)
    faults = []
    for k in _peaks(moved, step):
        faults.append(_fault(stream, names[:3], t[i[k]], t[i[k] + 1], step[k], "m", limit[k]))
    for k in _peaks((leap > LIMIT_RAD) & ~moved, leap):
        faults.append(_fault(stream, names[3:], t[i[k]], t[i[k] + 1], leap[k], "rad", LIMIT_RAD))
    return faults


def _peaks(flags: np.ndarray, size: np.ndarray) -> list[int]:
    """The largest of every group of flags that are closer than the frames a step disturbs."""
    rows = np.flatnonzero(flags)
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > SIDE + 1) + 1) if len(rows) else []
    return [int(g[np.argmax(size[g])]) for g in groups]


def _fault(stream, names, start, end, size, unit, limit) -> Fault:
    columns = tuple(stream.columns[stream.index(n)] for n in names)
    return Fault(KIND, "mocap", columns, float(start), float(end), float(size), unit,
                 f"the tracked pose leaps by {size:.3f} {unit} between the frames at {start:.3f} and {end:.3f} s", float(limit))
