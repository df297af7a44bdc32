"""Poses against the accelerometer and the gyro of the vehicle while it flies.

Velocity: the velocity of the poses changes by the integral of the measured acceleration. This fails for a tracker that
follows another body, freezes with noise or mirrors the motion. Rotation: over a tenth of a second, the poses turn by
the integral of the gyro. Mirrored or late attitudes turn the other way. Tilt: over half a second, the gyro shows the
same tilt as the poses. Poses that froze with noise in hover let the vehicle tilt more and more.
"""

from collections import deque
from collections.abc import Mapping

import numpy as np

from ... import so3
from ...settings import number
from ...units import GRAVITY_M_S2
from .pose_tracker import Believed

MOST_M_S = number("flying.pose_physics.most_m_s")
LEAST_M_S = number("flying.pose_physics.least_m_s")
USUAL = number("flying.pose_physics.usual")
CHANGE_S = number("flying.pose_physics.change_s")
LASTS_S = number("flying.pose_physics.lasts_s")
LEAST_SLOPE = number("flying.pose_physics.least_slope")
LEAST_TURN_DEG = number("flying.pose_physics.least_turn_deg")
BRIEF_S = number("flying.pose_physics.brief_s")
BRIEF_SLOPE = number("flying.pose_physics.brief_slope")
SLOPE_S = number("flying.pose_physics.slope_s")
CLIMB_M_S = number("flying.pose_physics.climb_m_s")
TILT_DEG = number("flying.pose_physics.tilt_deg")
TILT_S = number("flying.pose_physics.tilt_s")
TILT_LASTS_S = number("flying.pose_physics.tilt_lasts_s")
TILT_OVER_S = number("flying.pose_physics.tilt_over_s")
USUAL_S, RECENT_S, KNOWN_S = 5.0, 2.0, 1.5
"""Time constant of the usual difference of velocities. The most recent time does not count, since poses may be false
then. Without KNOWN_S of flight nothing is usual."""
CLIMB_S = 1.0
"""Time over which a climb is looked for; a bias of the accelerometer of 0.02 g makes 0.2 m/s of it."""
TURN_S = 0.1
"""Of one rotation that is compared: as long as the fit of the poses."""
FRESH_S = 0.15
"""IMU values that are older are not used, and the comparison begins anew. Three packets in a row may be lost."""
IMU = ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z")


class PosePhysics:
    """``check`` once a tick; returns the reason to end the flight, or "". ``false_s``: time for which the poses may
    have been false by then."""

    def __init__(self) -> None:
        self.false_s = 0.0
        self._usual_m_s, self._known_s = 0.0, 0.0
        self._restart()

    def _restart(self) -> None:
        self._time_s: float | None = None
        self._imu_m_s, self._imu_turn = np.zeros(3), np.zeros(3)
        self._gained_m_s = np.zeros(3)
        self._aparts: deque[tuple[float, float]] = deque()
        self._moved: deque[tuple[float, Believed, np.ndarray, np.ndarray]] = deque()
        self._turns: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._sums: deque[tuple[float, float, float]] = deque()
        self._bad_s = self._tilted_s = 0.0
        self._turned, self._turned_deg = np.array([0.0, 0.0, 0.0, 1.0]), 0.0
        self._tilts: deque[tuple[float, np.ndarray, np.ndarray, float]] = deque()
        self._climb: deque[tuple[float, float]] = deque()

    def check(self, believed: Believed | None, values: Mapping[str, float], logged_s: Mapping[str, float],
              host_s: float, timely: bool = True) -> str:
        """``values``, ``logged_s``: of the link, g and deg/s. ``timely``: the log is not known to be late."""
        ages = [host_s - logged_s.get(name, -np.inf) for name in IMU]
        if believed is None or host_s - believed.pose_s > FRESH_S or not max(ages) < FRESH_S:
            self._restart()
            return ""
        step = 0.0 if self._time_s is None else host_s - self._time_s
        if not 0.0 <= step < FRESH_S:
            self._restart()
            step = 0.0
        self._time_s = host_s
        acc = GRAVITY_M_S2 * np.array([values[name] for name in IMU[:3]])
        gyro = np.radians([values[name] for name in IMU[3:]])
        self._imu_m_s = self._imu_m_s + step * (so3.rotate(believed.quaternion, acc) - [0.0, 0.0, GRAVITY_M_S2])
        self._imu_turn = self._imu_turn + step * gyro
        self._turned = so3.multiply(self._turned, so3.exp(step * gyro))
        self._gained_m_s = self._gained_m_s + step * so3.rotate(self._turned, acc)
        self._turned_deg += step * float(np.degrees(np.linalg.norm(gyro[:2])))
        if not timely:
            self._tilts.clear()
            self._turns.clear()
            self._sums.clear()
            self._tilted_s = 0.0
            return self._velocity(believed, host_s, step)
        return (self._velocity(believed, host_s, step) or self._rotation(believed, host_s)
                or self._tilt(believed, host_s, step))

    def climb(self, now_s: float) -> str:
        """For a vehicle that the poses show on the ground during take-off: whether the accelerometer shows a climb."""
        self._climb.append((now_s, float(self._imu_m_s[2])))
        while now_s - self._climb[0][0] > CLIMB_S:
            self._climb.popleft()
        gained = self._climb[-1][1] - self._climb[0][1]
        if gained < CLIMB_M_S:
            return ""
        return f"they show the vehicle on the ground, the accelerometer a climb of {gained:.1f} m/s: another body?"

    def _velocity(self, believed: Believed, now_s: float, step_s: float) -> str:
        """From the poses at the beginning of CHANGE_S, gyro and accelerometer show the velocity at its end."""
        self._moved.append((now_s, believed, self._turned, self._gained_m_s))
        while now_s - self._moved[0][0] > CHANGE_S:
            self._moved.popleft()
        then_s, before, turned, gained = self._moved[0]
        by_imu = so3.rotate(so3.multiply(before.quaternion, so3.conjugate(turned)), self._gained_m_s - gained)
        by_imu = by_imu - [0.0, 0.0, GRAVITY_M_S2 * (now_s - then_s)]
        apart = float(np.linalg.norm(believed.velocity_m_s - before.velocity_m_s - by_imu))
        self._bad_s = self._bad_s + step_s if apart > self._most_m_s(apart, now_s, step_s) else 0.0
        if self._bad_s < LASTS_S:
            return ""
        self.false_s = CHANGE_S + LASTS_S
        return f"the velocity of the poses changed by {apart:.1f} m/s more or less than gyro and accelerometer show"

    def _most_m_s(self, apart: float, now_s: float, step_s: float) -> float:
        """A vehicle whose poses and IMU agreed well so far is held to it."""
        self._known_s += step_s
        self._usual_m_s *= np.exp(-step_s / USUAL_S)
        self._aparts.append((now_s, apart))
        while now_s - self._aparts[0][0] > RECENT_S:
            self._usual_m_s = max(self._usual_m_s, self._aparts.popleft()[1])
        return MOST_M_S if self._known_s < KNOWN_S else float(np.clip(USUAL * self._usual_m_s, LEAST_M_S, MOST_M_S))

    def _tilt(self, believed: Believed, now_s: float, step_s: float) -> str:
        self._tilts.append((now_s, believed.quaternion, self._turned, self._turned_deg))
        if now_s - self._tilts[0][0] < TILT_OVER_S:
            return ""
        while now_s - self._tilts[0][0] > TILT_OVER_S + 1e-6 and now_s - self._tilts[1][0] >= TILT_OVER_S - 1e-6:
            self._tilts.popleft()
        then_s, before, turned, turned_deg = self._tilts[0]
        shown = so3.multiply(before, so3.multiply(so3.conjugate(turned), self._turned))
        off = so3.log(so3.multiply(so3.conjugate(shown), believed.quaternion))
        apart = float(np.degrees(np.linalg.norm(off[:2])))
        most = TILT_DEG + TILT_S * (self._turned_deg - turned_deg) / (now_s - then_s)
        self._tilted_s = self._tilted_s + step_s if apart > most else 0.0
        if self._tilted_s < TILT_LASTS_S:
            return ""
        self.false_s = TILT_OVER_S + TILT_LASTS_S
        return f"the poses tilt by {apart:.0f} deg less or more than the gyro in {now_s - then_s:.1f} s"

    def _rotation(self, believed: Believed, now_s: float) -> str:
        self._turns.append((now_s, believed.quaternion, self._imu_turn))
        if now_s - self._turns[0][0] < TURN_S:
            return ""
        while now_s - self._turns[0][0] > TURN_S + 1e-6 and now_s - self._turns[1][0] >= TURN_S - 1e-6:
            self._turns.popleft()
        _, before, turned = self._turns[0]
        gyro = (self._imu_turn - turned)[:2]
        poses = so3.log(so3.multiply(so3.conjugate(before), believed.quaternion))[:2]
        self._sums.append((now_s, float(gyro @ poses), float(gyro @ gyro)))
        while now_s - self._sums[0][0] > SLOPE_S:
            self._sums.popleft()
        sums = np.array(self._sums)
        for since_s, least in ((BRIEF_S, BRIEF_SLOPE), (SLOPE_S, LEAST_SLOPE)):
            recent = sums[sums[:, 0] >= now_s - since_s, 1:]
            if now_s - self._sums[0][0] < since_s - TURN_S or recent[:, 1].mean() < np.radians(LEAST_TURN_DEG)**2:
                continue
            slope = float(recent[:, 0].sum() / recent[:, 1].sum())
            if slope < least:
                self.false_s = since_s + TURN_S
                return f"the poses turn {slope:.1f} times as far as the gyro: mirrored or late"
        return ""
