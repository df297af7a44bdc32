"""Gyro against the estimated attitude, axis by axis, in recordings without motion capture to judge either: units of
single axes, and axes that changed places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from .axis_unit_matching import FACTOR, FACTOR_WITHIN, ORDERS
from .context import Context
from .dropouts import alive_until
from .estimated_turning import estimated_attitude
from .held_poses import ROTATION
from .known_factors import NamedFactor, named_factor
from .pairs import gyro_pair, sums_of
from .stream_frames import IMU, stream_turns
from .usable_rows import usable_streams

STEP_S = 0.02
TURN_S = 0.1
REACH_S = 0.1
SHORTEST_S = 2.0
FOLLOWS = 0.7
"""Least correlation that shows a unit, and another axis."""
CLEARLY = 0.3
"""Least gain in the correlation of an axis that changed places."""


@dataclass(frozen=True)
class OwnTurning:
    """follows (3, 3): correlation of each axis of the gyro with each of the attitude; ratio (3, 3): of their sizes."""

    follows: np.ndarray
    ratio: np.ndarray

    @property
    def order(self) -> tuple[int, ...]:
        """Axis of the attitude that each axis of the gyro follows; (0, 1, 2) unless another order is clearly better
        on every axis that it moves."""
        size = np.abs(self.follows)
        best = max(ORDERS, key=lambda order: float(size[range(3), order].sum()))
        moved = [i for i in range(3) if best[i] != i]
        clear = all(size[i, best[i]] > FOLLOWS and size[i, best[i]] > size[i, i] + CLEARLY for i in moved)
        return best if clear else (0, 1, 2)

    @property
    def scaled(self) -> list[tuple[int, NamedFactor]]:
        """Axes of the gyro that turn by another factor than the attitude."""
        found = []
        for i, j in enumerate(self.order):
            ratio, follows = float(self.ratio[i, j]), abs(float(self.follows[i, j]))
            if follows > FOLLOWS and abs(np.log(ratio)) > np.log(FACTOR):
                found.append((i, named_factor("rad/s", ratio, FACTOR_WITHIN / follows)))
        return found


def own_turning(context: Context) -> OwnTurning | None:
    """None where motion capture judges the gyro, in other axes as a whole, and without both streams."""
    imu, attitude = context.once(usable_streams).get("imu"), estimated_attitude(context)
    if imu is None or attitude is None or not all(q in imu for q in IMU[0]) or sums_of(context, gyro_pair) is not None \
            or any(turn.stream == "imu" for turn in context.once(stream_turns)):
        return None
    gyro, q = imu[IMU[0]], attitude[ROTATION]
    fine = np.isfinite(gyro).all(axis=1) & (imu.time_s <= context.once(alive_until)["imu"])
    there = np.isfinite(q).all(axis=1)
    if fine.sum() < 20 or there.sum() < 20:
        return None
    t, gyro, at, q = imu.time_s[fine], gyro[fine], attitude.time_s[there], so3.make_continuous(q[there])
    grid = np.arange(max(at[0], t[0]) + REACH_S, min(at[-1], t[-1]) - REACH_S - TURN_S, STEP_S)
    if len(grid) * STEP_S < SHORTEST_S:
        return None

    def turned_to(times: np.ndarray) -> np.ndarray:
        found = np.stack([np.interp(times, at, v) for v in q.T], axis=1)
        return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9))

    turned = so3.log(so3.multiply(so3.conjugate(turned_to(grid)), turned_to(grid + TURN_S)))
    turned -= turned.mean(axis=0)
    angle = np.vstack([np.zeros(3), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(t)[:, None], axis=0)])
    best: OwnTurning | None = None
    for delay in np.arange(-REACH_S, REACH_S + 0.5 * STEP_S, STEP_S):
        by = np.stack([np.interp(grid + delay + TURN_S, t, a) - np.interp(grid + delay, t, a) for a in angle.T], axis=1)
        by -= by.mean(axis=0)
        sizes = [np.maximum(np.linalg.norm(v, axis=0), 1e-9) for v in (by, turned)]
        found = OwnTurning(by.T @ turned / np.outer(*sizes), sizes[0][:, None] / sizes[1][None, :])
        if best is None or np.abs(found.follows).max(axis=1).sum() > np.abs(best.follows).max(axis=1).sum():
            best = found
    return best
