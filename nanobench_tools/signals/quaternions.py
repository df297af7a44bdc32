"""How each stream's quaternions are to be read.

A vehicle is upright at rest and in flight; its path and its gyro decide the rest (``quaternion_reading``).

A vehicle rests on its feet and thrusts along its body z axis, so that axis points up in the first seconds of a
recording. For quaternions stored w, x, y, z but read as x, y, z, w it points down or aside. The order that points up
is used. Where two do (an upright vehicle turned by 180 deg), the one that agrees with the other source of attitude is
used.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from .context import Context
from .dropouts import alive_until
from .flown_axes import ORDERS, UP, seen_poses, tilts
from .quaternion_lengths import STREAMS
from .quaternion_reading import AS_STORED, SCALAR_FIRST, Reading, Samples, reading_of
from .usable_rows import usable_streams

UPRIGHT = number("audit.quaternions.upright")
AGREES_RAD = number("audit.quaternions.agrees_rad")
FIRST_S = number("audit.quaternions.first_s")
SWAPPED = number("audit.quaternions.swapped")
UNIT_WITHIN = number("audit.quaternions.unit_within")


GYRO = ("gyro_x", "gyro_y", "gyro_z")
PLACE = ("x", "y", "z")


@dataclass(frozen=True)
class Order:
    """reading that fits; upright: mean cos(tilt) of the first seconds as read; fitting: with that order; evidence: in
    words, empty where being upright shows it."""

    reading: Reading
    upright: float
    fitting: float
    evidence: str = ""


def quaternion_orders(context: Context) -> dict[str, Order]:
    """For every stream with quaternions that are unit-length where alive."""
    found = {}
    for name, quantities in STREAMS.items():
        stream = context.once(usable_streams).get(name)
        if stream is None or not all(q in stream.quantities for q in quantities):
            continue
        alive = stream.time_s <= context.once(alive_until)[name]
        q = stream[quantities][alive]
        fine = np.isfinite(q).all(axis=1) & (np.abs(np.linalg.norm(q, axis=1) - 1.0) < UNIT_WITHIN)
        if fine.sum() < 20:
            continue
        t, q = stream.time_s[alive][fine], q[fine]
        other = _euler_source(context, name)
        angles, tilts = {}, {}
        for label, order in ORDERS.items():
            tried = q[:, order]
            tilts[label] = float(np.mean(_up(tried[t <= t[0] + FIRST_S])))
            angles[label] = _angle(t, tried, other)
        as_read, swapped = tilts["x, y, z, w"], tilts["w, x, y, z"]
        clear = swapped > SWAPPED and (
            as_read < UPRIGHT or (angles["x, y, z, w"] > AGREES_RAD and angles["w, x, y, z"] < 0.5 * AGREES_RAD)
        ) and not (name == "mocap" and _flies_as_read(context))
        base = SCALAR_FIRST if clear else AS_STORED
        reading, evidence = reading_of((t, q), _path(context, name), _gyro(context), base)
        found[name] = Order(reading, as_read, float(np.mean(_up(reading.of(q)[t <= t[0] + FIRST_S]))), evidence)
    return found


def _path(context: Context, name: str) -> Samples | None:
    """Of the motion capture; for the estimated attitude without motion capture, of the estimate."""
    if name == "mocap":
        time_s, position, _ = context.once(seen_poses)
        return (time_s, position) if len(time_s) else None
    place = context.once(usable_streams).get("estimator")
    if "mocap" in context.flight or place is None or not all(q in place for q in PLACE):
        return None
    known = np.isfinite(place[PLACE]).all(axis=1)
    return (place.time_s[known], place[PLACE][known]) if known.sum() > 20 else None


def _gyro(context: Context) -> Samples | None:
    stream = context.once(usable_streams).get("imu")
    if stream is None or not all(q in stream.quantities for q in GYRO):
        return None
    fine = np.isfinite(stream[GYRO]).all(axis=1) & (stream.time_s <= context.once(alive_until)["imu"])
    return (stream.time_s[fine], stream[GYRO][fine]) if fine.sum() > 20 else None


def _flies_as_read(context: Context) -> bool:
    """Whether the vehicle flies better along another axis of the tracked body as read than along z in the other order.
    A body with z down and one read in the wrong order both look upside down."""
    found = context.once(tilts)
    swapped = found["w, x, y, z"].get((UP, UP))
    best = max((t.follows for t in found["x, y, z, w"].values() if t.flies), default=-1.0)
    return best > (swapped.follows if swapped is not None else 0.0)


def _up(q: np.ndarray) -> np.ndarray:
    """Cosine of the tilt, (n,)."""
    return np.asarray(1.0 - 2.0 * (q[:, 0] ** 2 + q[:, 1] ** 2))


def _euler_source(context: Context, name: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and quaternions from Euler angles: those of the estimator."""
    stream = context.once(usable_streams).get("attitude")
    if stream is None or not all(q in stream.quantities for q in ("roll", "pitch", "yaw")):
        return None
    angles = stream["roll", "pitch", "yaw"]
    fine = np.isfinite(angles).all(axis=1) & (stream.time_s <= context.once(alive_until)["attitude"])
    return (stream.time_s[fine], so3.from_euler_zyx(*angles[fine].T)) if fine.sum() > 20 else None


def _angle(t: np.ndarray, q: np.ndarray, other: tuple[np.ndarray, np.ndarray] | None) -> float:
    if other is None:
        return float("nan")
    picked = slice(None, None, max(len(t) // 200, 1))
    near = np.clip(np.searchsorted(other[0], t[picked]), 0, len(other[0]) - 1)
    return float(np.median(so3.geodesic_angle(q[picked], other[1][near])))
