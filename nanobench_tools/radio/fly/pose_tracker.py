"""State of the vehicle from poses, for controllers: position, velocity, attitude and rates now.

A parabola in time is fitted to the last poses, and extrapolated a little beyond the newest one. It describes their
positions, and their rotations from the newest one. Neither lags under steady acceleration. (Least squares on a moving
window, as of Savitzky and Golay 1964, at its end and with the poses' own times.)
"""

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from ... import so3
from ...methods import VehicleState
from ..mocap.pose_datagram import Pose
from ..mocap.pose_source import seen

POSES, FIT_S = 11, 0.1
"""Of the fit, and their time at 100 Hz. Rates are 41 times as noisy then as the poses' angles [1/s] (least squares)."""
MOST_AHEAD_S = 0.06
"""A fit is not read further beyond its last pose."""
GAP_S = 0.25
"""Poses from before a gap this long are forgotten."""


@dataclass(frozen=True)
class Believed:
    """One vehicle at time_s [Unix s]: position_m, velocity_m_s (3,) world, quaternion (4,), rate_rad_s (3,) body;
    pose_s: time of the newest pose."""

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    pose_s: float

    @property
    def yaw_rad(self) -> float:
        return float(so3.euler_zyx(self.quaternion)[2])

    @property
    def tilt_rad(self) -> float:
        """Between the body's up and the world's."""
        return float(np.arccos(np.clip(so3.rotate(self.quaternion, np.array([0.0, 0.0, 1.0]))[2], -1.0, 1.0)))

    def state(self, battery_V: float) -> VehicleState:
        """As a controller takes it, one vehicle."""
        return VehicleState(self.position_m[None], self.velocity_m_s[None], self.quaternion[None],
                            self.rate_rad_s[None], np.array([battery_V]))


class PoseTrack:
    """Poses in, ``at(time)`` out; both from any thread. ``times``: of all poses kept."""

    def __init__(self) -> None:
        self._poses: deque[Pose] = deque(maxlen=POSES)
        self._lock = threading.Lock()
        self.count = 0

    def add(self, pose: Pose) -> bool:
        """Takes a pose in which the body was seen and which is newer than the last; says whether it did."""
        if not seen(pose):
            return False
        with self._lock:
            if self._poses and pose.time_s <= self._poses[-1].time_s:
                return False
            if self._poses and pose.time_s - self._poses[-1].time_s > GAP_S:
                self._poses.clear()
            self._poses.append(pose)
            self.count += 1
        return True

    @property
    def newest(self) -> Pose | None:
        with self._lock:
            return self._poses[-1] if self._poses else None

    def at(self, time_s: float) -> Believed | None:
        """The vehicle at time_s; None before the first pose. Beyond MOST_AHEAD_S after the newest pose it is held."""
        with self._lock:
            poses = list(self._poses)
        if not poses:
            return None
        last = poses[-1]
        ahead = min(max(time_s - last.time_s, 0.0), MOST_AHEAD_S)
        since = np.array([pose.time_s for pose in poses]) - last.time_s
        turns = np.array([pose.quaternion for pose in poses])
        away = so3.log(so3.multiply(so3.conjugate(last.quaternion), turns))
        values = np.concatenate([np.array([pose.position_m for pose in poses]), away], axis=1)
        order = min(len(poses) - 1, 2)
        terms = np.linalg.lstsq(since[:, None] ** np.arange(order + 1), values, rcond=None)[0]
        terms = np.concatenate([terms, np.zeros((2 - order, 6))])
        value = terms[0] + ahead * (terms[1] + ahead * terms[2])
        speed = terms[1] + 2.0 * ahead * terms[2]
        turn = so3.multiply(last.quaternion / np.linalg.norm(last.quaternion), so3.exp(value[3:]))
        return Believed(time_s, value[:3], speed[:3], turn, speed[3:], last.time_s)
