"""Evidence for the axis of the tracked world and of the tracked body that points up: the flight itself, and the
ground.

A multirotor accelerates towards the side to which it tilts. The horizontal part of its thrust axis follows the
horizontal acceleration divided by gravity (correlation 0.94 to 0.98 on real flights). In a world read upside down that
correlation is negative. With another axis up there is no correlation. And a vehicle that stands still before and after
a flight was above that place in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from .. import so3
from ..settings import number, setting
from ..units import GRAVITY_M_S2
from .context import Context
from .held_poses import POSITION, ROTATION, held_poses
from .plausible_ranges import tracker_scale
from .usable_rows import typical_step_s, usable_streams

Axis = tuple[int, int]
"""Signed axis: 0 to 2, and +1 or -1."""
UP: Axis = (2, 1)
AXES: tuple[Axis, ...] = tuple((axis, sign) for axis in (2, 1, 0) for sign in (1, -1))
NAMES = {(axis, sign): ("" if sign > 0 else "-") + "xyz"[axis] for axis, sign in AXES}
ORDERS = {"x, y, z, w": (0, 1, 2, 3), "w, x, y, z": (1, 2, 3, 0)}
"""Order in which the elements of a quaternion are stored -> where x, y, z, w are found."""

STEP_S = number("audit.flown_axes.step_s")
BAND_HZ = setting("audit.flown_axes.band_hz")
SHORTEST_S = number("audit.flown_axes.shortest_s")
SLOWEST_STEP_S = number("audit.flown_axes.slowest_step_s")
UPRIGHT = number("audit.flown_axes.upright")
FOLLOWS = number("audit.flown_axes.follows")
"""Correlation of tilt with acceleration that counts as clear."""
SLOPE = setting("audit.flown_axes.slope")
STANDS_S = number("audit.flown_axes.stands_s")
STILL_M = number("audit.flown_axes.still_m")
"""A vehicle that rests moves by less."""
NEAR_M = number("audit.flown_axes.near_m")
"""It rests so near to the lowest place of the recording."""
CLIMBS_M = number("audit.flown_axes.climbs_m")


@dataclass(frozen=True)
class Tilt:
    """- upright: mean cosine between the body axis and the world axis;
    - follows: correlation of its tilt with the acceleration; slope: their ratio in 1/g;
    - each: correlation along the axis that follows least."""

    upright: float
    follows: float
    slope: float
    each: float

    @property
    def flies(self) -> bool:
        """Whether these are the axes of a multirotor in flight."""
        return self.upright > UPRIGHT and self.follows > FOLLOWS and SLOPE[0] < self.slope < SLOPE[1]


def tilts(context: Context) -> dict[str, dict[tuple[Axis, Axis], Tilt]]:
    """Order of the quaternion's elements -> (world axis, body axis) -> ``Tilt``; empty without attitude or motion."""
    time_s, position, quaternion = context.once(seen_poses)
    known = quaternion.shape[1] == 4
    return {order: tilts_of(time_s, position, quaternion[:, places]) if known else {}
            for order, places in ORDERS.items()}


def first_up(time_s: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """(3,) mean direction of the world's z in a body of attitude (n, 4) x, y, z, w, in the first moments."""
    first = quaternion[time_s <= time_s[0] + STANDS_S]
    return np.asarray(so3.rotate_inverse(first, np.array([0.0, 0.0, 1.0])).mean(axis=0))


def tilts_of(time_s: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> dict[tuple[Axis, Axis], Tilt]:
    """(world axis, body axis) -> ``Tilt`` of positions (n, 3) m and quaternions (n, 4) x, y, z, w; empty without
    motion."""
    few = len(quaternion) < 20 or quaternion.shape[1] < 4 or time_s[-1] - time_s[0] < SHORTEST_S
    if few or typical_step_s(time_s) > SLOWEST_STEP_S:
        return {}
    quaternion = so3.make_continuous(quaternion)
    grid = np.arange(time_s[0], time_s[-1], STEP_S)
    on_grid = np.stack([np.interp(grid, time_s, v) for v in np.hstack([position, quaternion]).T], axis=1)
    turn = on_grid[:, 3:] / np.linalg.norm(on_grid[:, 3:], axis=1, keepdims=True)
    pull = np.gradient(np.gradient(_band(on_grid[:, :3]), STEP_S, axis=0), STEP_S, axis=0) / GRAVITY_M_S2
    found = {}
    for axis in range(3):
        column = so3.rotate(turn, np.eye(3)[axis])
        if not np.ptp(column, axis=0).any():
            return {}
        moving, mean = _band(column), column.mean(axis=0)
        for up in range(3):
            across = [k for k in range(3) if k != up]
            tilt, force = moving[:, across].ravel(), pull[:, across].ravel()
            size = np.sqrt((moving[:, across] ** 2).sum(axis=0) * (pull[:, across] ** 2).sum(axis=0))
            each = (moving[:, across] * pull[:, across]).sum(axis=0) / np.maximum(size, 1e-12)
            power = float(force @ force)
            product = float(tilt @ force)
            follows = product / max(np.sqrt(power * float(tilt @ tilt)), 1e-12)
            for sign in (1, -1):
                for world in (1, -1):
                    found[(up, world), (axis, sign)] = Tilt(world * sign * float(mean[up]), sign * follows,
                                                            sign * product / max(power, 1e-12),
                                                            float((sign * each).min()))
    return found


@cache
def _sos() -> np.ndarray:
    return np.asarray(butter(2, tuple(BAND_HZ), btype="band", fs=1.0 / STEP_S, output="sos"))


def _band(values: np.ndarray) -> np.ndarray:
    return np.asarray(sosfiltfilt(_sos(), values, axis=0, padtype="even", padlen=min(200, len(values) - 1)))


def ground_axes(context: Context) -> dict[Axis, float]:
    """Axis -> climb [m] of every axis that may point up. The vehicle is at rest at both ends of the recording and is
    above that place in between. Only z where z may point up; empty where it is undecided."""
    return ground_axes_of(*context.once(seen_poses)[:2])


def ground_axes_of(time_s: np.ndarray, position: np.ndarray) -> dict[Axis, float]:
    """``ground_axes`` of positions (n, 3) m."""
    ends = [position[time_s <= time_s[0] + STANDS_S], position[time_s >= time_s[-1] - STANDS_S]] if len(time_s) else []
    if len(time_s) < 20 or any(len(end) < 3 or (np.ptp(end, axis=0) > STILL_M).any() for end in ends):
        return {}
    stood = np.stack([np.median(end, axis=0) for end in ends])
    low, high = np.quantile(position, (0.02, 0.98), axis=0)
    found: dict[Axis, float] = {}
    for axis, sign in AXES:
        base, top = (low, high) if sign > 0 else (-high, -low)
        rests = sign * stood[:, axis]
        if rests.max() - base[axis] < NEAR_M and top[axis] - rests.max() > CLIMBS_M:
            found[axis, sign] = float(top[axis] - rests.max())
        elif (axis, sign) == UP and rests.min() - base[axis] < CLIMBS_M:
            return {}
    return {UP: found[UP]} if UP in found else found


def seen_poses(context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """time_s (n,), position (n, 3) m and quaternion (n, 4), or (n, 0) without one, of the rows with a measured pose."""
    stream, held = context.once(usable_streams).get("mocap"), context.once(held_poses)
    if stream is None or not all(q in stream for q in POSITION) or len(stream) < 3:
        return np.empty(0), np.empty((0, 3)), np.empty((0, 0))
    keep = np.isfinite(stream[POSITION]).all(axis=1)
    quaternion = np.empty((len(stream), 0))
    if held is not None:
        keep &= ~held.any
    if all(q in stream for q in ROTATION):
        quaternion = stream[ROTATION]
        if (unit := np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) < 0.05).any():
            keep &= unit
        else:
            quaternion = np.empty((len(stream), 0))
    return stream.time_s[keep], stream[POSITION][keep] / context.once(tracker_scale), quaternion[keep]
