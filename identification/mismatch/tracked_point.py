"""Position in the vehicle of the point that the cameras follow: markers are mounted above the centre of mass.

A point r off the centre of mass accelerates by w' x r + w x (w x r) more than the centre does. A quadrotor can only
push along its own vertical axis. So its two other axes show drag and this acceleration, with any simulator. The arm is
estimated from them. If it matters, the path of the centre of mass is judged instead of the marker's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import convolve1d

from nanobench_tools import so3
from nanobench_tools.settings import count, setting
from nanobench_tools.units import GRAVITY_M_S2

from .track import ROW_S, Track
from .wrench import SMOOTH_S, Wrench, kernel

USUAL_M = setting("mismatch.tracked_point.usual_m")
MOST_M = setting("mismatch.tracked_point.most_m")
LEAST_M_S2 = setting("mismatch.tracked_point.least_m_s2")
FEWEST = count("mismatch.tracked_point.fewest")
HUBER_SD = setting("mismatch.tracked_point.huber_sd")


@dataclass(frozen=True)
class Arm:
    """r_m (3,) from the centre of mass to the tracked point, body; ``explains_m_s2``: RMS of the horizontal force
    beyond drag that it explains in flights it was not read from; ``wider``: how many times the arms of the usual
    vehicle."""

    r_m: np.ndarray
    explains_m_s2: float
    wider: float = 1.0

    @property
    def counts(self) -> bool:
        return bool(self.explains_m_s2 > LEAST_M_S2 and float(np.linalg.norm(self.r_m)) < MOST_M * self.wider)


def arm_of(tracks: Sequence[Track], wider: float = 1.0) -> Arm | None:
    """The arm of a vehicle, the same in all tracks; None for too few flights. ``wider``: see ``size``."""
    flights = np.unique([t.flight for t in tracks])
    if len(flights) < FEWEST:
        return None
    wrench = Wrench(tracks)
    at = wrench.force_at
    turn = wrench.quaternion[at]
    force = _sideways(wrench)
    velocity = so3.rotate_inverse(turn, wrench.of("velocity_m_s", at))
    weights = kernel(SMOOTH_S, 1)
    rate = wrench.of("rate_rad_s", at)
    turning = np.concatenate([convolve1d(t.rate_rad_s, weights, axis=0, mode="nearest") for t in tracks])[at]
    arms = np.stack([(np.cross(turning, e) + np.cross(rate, np.cross(rate, e)))[:, :2] for e in np.eye(3)], axis=-1)
    flight = wrench.flight[at]
    left, columns = _beyond_drag(force, velocity, flight), _beyond_drag(arms, velocity, flight)
    before = after = 0.0
    for number in flights:
        here = flight == number
        r = _read(left[~here], columns[~here], wider)
        before += float(np.median(np.sum(left[here] ** 2, axis=1))) * here.sum()
        after += float(np.median(np.sum((left[here] - columns[here] @ r) ** 2, axis=1))) * here.sum()
    # of a round Gaussian the median of the squared length is 1.39 of its variance, and its mean 2
    return Arm(_read(left, columns, wider), float(np.sqrt(max(before - after, 0.0) / len(left) * 2.0 / 1.386)), wider)


def _sideways(wrench: Wrench) -> np.ndarray:
    """(N, 2) specific force along body x and y without thrust. The contribution of the thrust is smoothed like the
    path: in the world, where smoothing reduces a turning thrust."""
    upright = np.array([0.0, 0.0, 1.0])
    found = []
    for t in wrench.tracks:
        measured = convolve1d(t.position_m, kernel(SMOOTH_S, 2), axis=0, mode="nearest") + GRAVITY_M_S2 * upright
        up = so3.rotate(t.quaternion, upright)
        thrust = np.sum(measured * up, axis=1, keepdims=True)
        other = measured - convolve1d(thrust * up, kernel(SMOOTH_S, 0), axis=0, mode="nearest")
        found.append(so3.rotate_inverse(t.quaternion, other)[:, :2])
    return np.asarray(np.concatenate(found)[wrench.force_at])


def _beyond_drag(values: np.ndarray, velocity: np.ndarray, flight: np.ndarray) -> np.ndarray:
    """values (n, 2, ...) without a constant of each flight and axis, and without the part proportional to the velocity
    along the axis."""
    found = np.array(values, float)
    for axis in range(2):
        level = (flight[:, None] == np.unique(flight)).astype(float)
        design = np.column_stack([level, velocity[:, axis]])
        column = found[:, axis].reshape(len(found), -1)
        rest = column - design @ np.linalg.lstsq(design, column, rcond=None)[0]
        found[:, axis] = rest.reshape(found[:, axis].shape)
    return found


def _read(left: np.ndarray, columns: np.ndarray, wider: float) -> np.ndarray:
    """(3,) by least squares that a few wild rows do not carry, with the prior."""
    y, x = left.reshape(-1), columns.reshape(-1, 3)
    weight, r = np.ones(len(y)), np.zeros(3)
    for _ in range(5):
        away = y - x @ r
        sd = max(1.4826 * float(np.median(np.abs(away))), 1e-9)
        weight = np.minimum(1.0, HUBER_SD / np.maximum(np.abs(away) / sd, 1e-9))  # Huber
        memory = 3.0 * SMOOTH_S / ROW_S  # rows that the smoothing correlates
        normal = (x * weight[:, None]).T @ x + np.eye(3) * (sd / (USUAL_M * wider)) ** 2 * memory
        r = np.linalg.solve(normal, (x * weight[:, None]).T @ y)
    return r


def centred(tracks: Sequence[Track], r_m: np.ndarray) -> tuple[Track, ...]:
    """The tracks of the centre of mass, of tracks of a point ``r_m`` off it."""
    found = []
    for t in tracks:
        away = so3.rotate(t.quaternion, np.broadcast_to(r_m, (len(t), 3)))
        speed = so3.rotate(t.quaternion, np.cross(t.rate_rad_s, r_m))
        found.append(replace(t, position_m=t.position_m - away, velocity_m_s=t.velocity_m_s - speed))
    return tuple(found)


__all__ = ["Arm", "arm_of", "centred"]
