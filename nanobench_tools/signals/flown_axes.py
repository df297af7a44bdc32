"""Evidence for the axis of the tracked world and of the tracked body that points up: the flight itself, and the
ground.

A multirotor accelerates towards the side to which it tilts. The horizontal part of its thrust axis follows the
horizontal acceleration divided by gravity (correlation 0.94 to 0.98 on real flights). In a world read upside down that
correlation is negative. With another axis up there is no correlation. And a vehicle that stands still before and after
a flight was above that place in between.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from .. import so3
from ..settings import number, setting
from ..units import FOOT_M, GRAVITY_M_S2, INCH_M
from .column_evidence import MOST_M_S2, pull_of
from .context import Context
from .held_poses import POSITION, ROTATION, held_poses
from .usable_rows import typical_step_s, usable_streams

Axis = tuple[int, int]
"""Signed axis: 0 to 2, and +1 or -1."""
UP: Axis = (2, 1)
AXES: tuple[Axis, ...] = tuple((axis, sign) for axis in (2, 1, 0) for sign in (1, -1))
NAMES = {(axis, sign): ("" if sign > 0 else "-") + "xyz"[axis] for axis, sign in AXES}
ORDERS = {"x, y, z, w": (0, 1, 2, 3), "w, x, y, z": (1, 2, 3, 0)}
"""Order in which the elements of a quaternion are stored -> where x, y, z, w are found."""

SCALES = {1.0: "metres", 1.0 / FOOT_M: "feet", 1.0 / INCH_M: "inches", 100.0: "centimetres", 1000.0: "millimetres"}
"""Values per metre, and their unit."""
ROOM_M = number("audit.flown_axes.room_m")
SLOWEST_M_S2 = number("audit.flown_axes.slowest_m_s2")
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


def tracker_scale(context: Context) -> float:
    """Values of the tracked position per metre, one of ``SCALES``; the largest where several are possible."""
    return context.once(tracker_scales)[-1]


def tracker_scales(context: Context) -> tuple[float, ...]:
    """Every number of values per metre that a path wider than a room may have.

    The tilt decides, else accelerations of a flight: metres if they are in metres, else all of ``SCALES`` that fit."""
    stream = context.flight.streams.get("mocap")  # stamps, usable or not, play no part in the width
    if stream is None or not set(POSITION) <= set(stream.quantities) or len(stream) < 20:
        return (1.0,)
    position = stream[POSITION][np.isfinite(stream[POSITION]).all(axis=1)]
    if len(position) < 20 or np.max(np.ptp(np.quantile(position, (0.05, 0.95), axis=0), axis=0)) <= ROOM_M:
        return (1.0,)
    time_s, position, quaternion = context.once(stored_poses)
    if (shown := _shown_scale(time_s, position, quaternion)) is not None:
        return (shown,)
    pull = pull_of(position, time_s) if len(position) > 20 else np.inf
    if SLOWEST_M_S2 < pull < MOST_M_S2:
        return (1.0,)
    return tuple(scale for scale in SCALES if scale > 1.0 and SLOWEST_M_S2 < pull / scale < MOST_M_S2) or (1000.0,)


def _shown_scale(time_s: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> float | None:
    """The unit in which the accelerations of the path are those of its tilt; None where they do not correlate."""
    shown = unit_by_tilt(time_s, position, quaternion)
    return None if shown is None else min(SCALES, key=lambda scale: abs(np.log(scale * shown)))


def unit_by_tilt(time_s: np.ndarray, position: np.ndarray, quaternion: np.ndarray, upright: float = -1.0
                 ) -> float | None:
    """Metres per number of a position (n, 3), with which its accelerations are those of its tilt; None where they do
    not correlate, and where the mean cosine of the tilt is below ``upright``: far tilts accelerate by more."""
    found = [tilt for places in ORDERS.values() if quaternion.shape[1] == 4
             for tilt in tilts_of(time_s, position, quaternion[:, places]).values()]
    best = max(found, key=lambda tilt: tilt.follows, default=None)
    if best is None or best.follows < FOLLOWS or not best.slope > 0.0 or best.upright < upright:
        return None
    return best.slope


def seen_poses(context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``stored_poses`` in metres."""
    time_s, position, quaternion = context.once(stored_poses)
    return time_s, position / context.once(tracker_scale), quaternion


def stored_poses(context: Context) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """time_s (n,), position (n, 3) as stored and quaternion (n, 4), or (n, 0) without one, of measured poses."""
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
    return stream.time_s[keep], stream[POSITION][keep], quaternion[keep]
