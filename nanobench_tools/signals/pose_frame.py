"""The frame of the tracked poses: which axis of its world and which axis of its body points up.

Every other check uses poses with z up in both (``posed``). A turned frame is thus one finding and not many.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..flight import Stream
from ..settings import number
from ..sources.axes import Frame, frame_of, in_our_axes
from .context import Context
from .dropouts import alive_until
from .flown_axes import AXES, NAMES, UP, UPRIGHT, Axis, Tilt, first_up, ground_axes, seen_poses, tilts, tilts_of
from .held_poses import ROTATION
from .quaternion_lengths import STREAMS
from .quaternions import UNIT_WITHIN, quaternion_orders
from .usable_rows import usable_streams

WORLDS = {(2, 1): "ENU", (2, -1): "NED", (1, 1): "EUS", (1, -1): "EDN", (0, 1): "UNW", (0, -1): "DNE"}
"""Axis of a world that is up -> what its axes are called, its heading being anyone's choice."""
BODIES = {(2, 1): "FLU", (2, -1): "FRD", (1, 1): "FUR", (1, -1): "FDL", (0, 1): "ULB", (0, -1): "DLF"}
"""The same of a body; its heading stays that of the tracker."""
DOWN: Axis = (2, -1)
ALMOST_ALL = 0.01
"""Quantile of a height that is taken as its least."""
FOREIGN_RAD = number("audit.pose_frame.foreign_rad")
CLEARLY = number("audit.pose_frame.clearly")
OTHER_FOLLOWS = number("audit.pose_frame.other_follows")


@dataclass(frozen=True)
class PoseFrame:
    """world, body: axes of the tracked world and body that point up; None where it is unknown.

    - evidence: a sentence, empty where both are z.
    - foreign_rad: tilt, from the first moment on, of a body with no axis up; else 0."""

    world: Axis | None = UP
    body: Axis | None = UP
    evidence: str = ""
    foreign_rad: float = 0.0

    @property
    def turned(self) -> bool:
        """Whether it is known how to turn the poses."""
        return self.world is not None and self.body is not None and (self.world, self.body) != (UP, UP)


    @property
    def axes(self) -> Frame:
        """The axes of world and body by name."""
        return frame_of(f"{WORLDS[self.world or UP]}/{BODIES[self.body or UP]}")


def pose_frame(context: Context) -> PoseFrame:
    """The frame of the tracked poses; z up in world and body where nothing clearly shows another."""
    order = context.once(quaternion_orders).get("mocap")
    time_s, position, stored = context.once(seen_poses)
    read = order.reading.of(stored) if order and stored.shape[1] else stored
    as_stored = order is None or order.reading.as_stored
    found = context.once(tilts)["x, y, z, w"] if as_stored else tilts_of(time_s, position, read)
    usual, ground = found.get((UP, UP)), context.once(ground_axes)
    if usual is not None and usual.flies:
        return PoseFrame()
    better = max(OTHER_FOLLOWS, usual.follows + CLEARLY if usual is not None and usual.upright > UPRIGHT else 0.0)
    flying = {axes: tilt for axes, tilt in found.items()
              if tilt.flies and tilt.follows > better and (not ground or axes[0] in ground)}
    if not ground and len(position) and np.quantile(position[:, 2], ALMOST_ALL) > 0.0:
        flying.pop((DOWN, DOWN), None)  # inverted, or of another heading: a path above 0 has z up
    if flying:
        best = max(flying, key=lambda axes: flying[axes].follows)
        return PoseFrame(*best, _why_tilt(best, flying[best], usual))
    if ground and UP not in ground:
        world = next(iter(ground)) if len(ground) == 1 else None
        upright = {body: tilt.upright for (w, body), tilt in found.items() if w == world and (
            tilt.upright > UPRIGHT or (tilt.upright > 0.0 and tilt.follows > OTHER_FOLLOWS))}
        body = max(upright, key=lambda b: upright[b]) if upright else world if not found else None
        return PoseFrame(world, body, _why_ground(ground))
    if order is None or not len(stored):
        return PoseFrame()
    up = first_up(time_s, read)
    tilt_rad = float(np.arccos(np.clip(up[2] / max(float(np.linalg.norm(up)), 1e-9), -1.0, 1.0)))
    if tilt_rad < FOREIGN_RAD:
        return PoseFrame()
    body = next((axis for axis in AXES if axis[1] * up[axis[0]] > UPRIGHT), None)
    if body is not None and (not found or found[UP, body].upright > UPRIGHT):
        return PoseFrame(UP, body, f"the {NAMES[body]} axis of the tracked body points up from the first row on, its "
                                   f"z axis is tilted by {np.degrees(tilt_rad):.0f} deg")
    return PoseFrame(UP, None, f"the tracked body is tilted by {np.degrees(tilt_rad):.0f} deg from the first row on, "
                               "and none of its axes points up", tilt_rad)


def _why_tilt(axes: tuple[Axis, Axis], tilt: Tilt, usual: Tilt | None) -> str:
    as_read = "" if usual is None else f", z of both gives {usual.follows:+.2f}"
    return (f"the vehicle speeds up towards the side to which it tilts if {NAMES[axes[0]]} of the world and "
            f"{NAMES[axes[1]]} of the body point up (correlation {tilt.follows:+.2f}{as_read})")


def _why_ground(ground: dict[Axis, float]) -> str:
    return ("pz goes below the resting place of the vehicle before and after the flight; "
            + " or ".join(f"{NAMES[axis]} rises by {ground[axis]:.2f} m above it" for axis in ground))


def posed(context: Context) -> Stream | None:
    """The tracked poses as every other check takes them, None without poses.

    Quaternions in the order x, y, z, w, body to world, z up in world and body."""
    stream, frame = context.once(usable_streams).get("mocap"), context.once(pose_frame)
    if stream is None:
        return None
    order = context.once(quaternion_orders).get("mocap")
    if order is not None and not order.reading.as_stored:
        values, columns = stream.values.copy(), [stream.index(q) for q in ROTATION]
        values[:, columns] = order.reading.of(stream[ROTATION])
        stream = replace(stream, values=values)
    if not frame.turned:
        return stream
    return in_our_axes(stream, frame.axes)


def orientation_of(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """time_s (n,) and quaternions (n, 4) x, y, z, w of the motion capture (``posed``), else of the estimator."""
    orders = context.once(quaternion_orders)
    for name, quantities in STREAMS.items():
        stream = context.once(posed) if name == "mocap" else context.once(usable_streams).get(name)
        if name in orders and stream is not None:
            keep = stream.time_s <= context.once(alive_until)[name]
            q = stream[quantities][keep] if name == "mocap" else orders[name].reading.of(stream[quantities][keep])
            fine = np.isfinite(q).all(axis=1) & (np.abs(np.linalg.norm(q, axis=1) - 1.0) < UNIT_WITHIN)
            return stream.time_s[keep][fine], q[fine]
    return None
