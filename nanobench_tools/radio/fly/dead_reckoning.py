"""The vehicle's motion from its logged gyro and accelerometer after the last pose, computed on the host.

The state is of the moment at which the newest log was taken, a link delay ago. It is independent of the vehicle's own
estimate, and so shows whether that estimate is to be trusted without poses. The bias of the accelerometer and the
thrust of hover are averaged while poses come.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ... import so3
from ...units import GRAVITY_M_S2
from .pose_tracker import Believed

IMU = ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z")
TURN = ("stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz", "stateEstimate.qw")
SPEED = ("stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz")
PLACE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
THRUST = "stabilizer.thrust"
"""Collective thrust set-point; with the accelerometer it shows the thrust of hover."""
AIR_M = 0.1
"""Above the ground from which on thrust carries the vehicle."""
POSE_S = 0.05
"""A new pose that is not older sets the state anew."""
AGE_S = 0.01
"""Mean age of the newest log when it is used, without the link's delay: half its period."""
FRESH_S = 0.2
"""Older logged values are not integrated: the vehicle turns meanwhile."""
BIAS_S, HOVER_S = 2.0, 1.0
"""Time constants of the averages of bias and hover thrust."""
LEAST_G = 0.5
"""Specific force below which thrust and acceleration are not compared."""
NEAR_M, PER_M_S, PER_S2 = np.array([0.3, 0.3]), 0.1, np.array([0.5, 0.05])
"""Tolerance between this and the vehicle's estimate, over the ground and in height. One part is for noise. Another
is for the age of the log, per speed. The last grows with the square of the time since the last pose. In height it
is small: the planner stops the motors where the estimate shows the ground."""
NEAR_M_S, PER_S = np.array([0.5, 0.3]), np.array([1.0, 0.1])
"""The same of velocities."""
PAST = 500
"""Ticks that are kept, to compute the motion again without poses that turned out to be false."""
MOST_FALSE_S, DEPARTS_S, DEPARTED_M_S, DEPARTED_DEG = 3.0, 0.5, 0.4, 8.0
"""Longest time for which poses are taken to have been false; and from then to a difference that shows it."""
NEAR_DEG = 12.0
"""The same of attitudes: the log is 50 ms old, and a vehicle turns by 2 rad/s."""


class _Moment(NamedTuple):
    """State at the beginning of a tick, and the IMU in it."""

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    bias_m_s2: np.ndarray
    acc: np.ndarray | None
    gyro: np.ndarray | None


@dataclass
class DeadReckoning:
    """``position_m``, ``velocity_m_s`` (3,) world and ``quaternion`` (4,) at ``time_s``; ``blind_s``: time since the
    last pose; ``ground_m``: height of a vehicle on the ground; ``delay_s``: of the link; ``hover_counts``: thrust of
    hover, nan if unknown; ``turn`` (4,): rotation from the vehicle's attitude to this one, in the world; ``fault``: why
    the vehicle's estimate is not trusted, in words; ``excess``: its deviation, in units of the tolerance."""

    time_s: float = float("nan")
    position_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    velocity_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quaternion: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    blind_s: float = float("inf")
    imu_s: float = float("inf")
    ground_m: float = -np.inf
    delay_s: float = 0.0
    hover_counts: float = float("nan")
    turn: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    rate_rad_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    fault: str = ""
    excess: float = 0.0
    _bias_m_s2: np.ndarray = field(default_factory=lambda: np.zeros(3))
    _hovers: int = 0
    _pose_s: float = -np.inf
    _compared_s: float = -np.inf
    _past: deque[_Moment] = field(default_factory=lambda: deque(maxlen=PAST))

    def update(self, now_s: float, believed: Believed | None, values: Mapping[str, float],
               logged_s: Mapping[str, float]) -> None:
        """One tick. ``believed``: from poses that are believed, of any age; ``values``, ``logged_s``: of the link."""
        step = now_s - self.time_s
        before = self.time_s, self.position_m, self.velocity_m_s, self.quaternion, self._bias_m_s2
        self.imu_s = now_s - min(logged_s.get(name, -np.inf) for name in IMU)
        acc = gyro = None
        if self.imu_s < FRESH_S:
            acc = GRAVITY_M_S2 * np.array([values[name] for name in IMU[:3]])
            gyro = np.radians([values[name] for name in IMU[3:]])
            self.rate_rad_s = gyro
            self._average_hover(acc, values, step)
        if believed is not None and believed.pose_s > self._pose_s and now_s - believed.pose_s < POSE_S:
            self._pose_s = believed.pose_s
            self._set(now_s, believed, acc, step)
        elif np.isfinite(self.time_s):
            self._integrate(now_s, acc, gyro, step)
        self._compare(now_s, values, logged_s)
        if np.isfinite(before[0]):
            self._past.append(_Moment(*before, acc, gyro))

    def rewind(self, seconds: float) -> None:
        """Forget the poses of the last ``seconds``, which turned out to be false, and earlier ones if they were false,
        too. From MOST_FALSE_S ago, the IMU shows when poses departed from it.

        The state is that from before them, with the IMU since then."""
        now_s = self.time_s
        past = [moment for moment in self._past if moment.time_s >= now_s - MOST_FALSE_S]
        if not past:
            return
        departed_s = self._replay(past, now_s)
        since_s = min(now_s - seconds, departed_s - DEPARTS_S)
        self._replay([moment for moment in past if moment.time_s >= since_s] or past[-1:], now_s)
        self._compared_s = -np.inf

    def _replay(self, past: list[_Moment], now_s: float) -> float:
        """From the first of these moments by the IMU; returns when poses departed from that, inf if not."""
        first, departed_s = past[0], np.inf
        self.time_s, self.position_m, self.velocity_m_s = first.time_s, first.position_m, first.velocity_m_s
        self.quaternion, self._bias_m_s2, self.blind_s = first.quaternion, first.bias_m_s2, 0.0
        for earlier, moment in zip(past, [*past[1:], None], strict=True):
            until = now_s if moment is None else moment.time_s
            self._integrate(until, earlier.acc, earlier.gyro, until - earlier.time_s)
            if moment is not None and departed_s == np.inf:
                faster = float(np.linalg.norm(moment.velocity_m_s - self.velocity_m_s))
                turned = float(np.degrees(so3.geodesic_angle(moment.quaternion, self.quaternion)))
                departed_s = until if faster > DEPARTED_M_S or turned > DEPARTED_DEG else np.inf
        return departed_s

    def shown(self) -> Believed:
        """The vehicle now, a link delay after the newest log."""
        late_s = self.delay_s + AGE_S
        turn = so3.multiply(self.quaternion, so3.exp(late_s * self.rate_rad_s))
        return Believed(self.time_s, self.position_m + late_s * self.velocity_m_s, self.velocity_m_s, turn,
                        self.rate_rad_s, self.time_s - self.blind_s)

    def _set(self, now_s: float, believed: Believed, acc: np.ndarray | None, step: float) -> None:
        late_s = self.delay_s + AGE_S
        then = so3.multiply(believed.quaternion, so3.exp(-late_s * believed.rate_rad_s))
        speed = believed.velocity_m_s
        if acc is not None:
            speed = speed - late_s * (so3.rotate(then, acc) - [0.0, 0.0, GRAVITY_M_S2])
        if acc is not None and 0.0 < step < FRESH_S and self.blind_s < POSE_S:
            measured = so3.rotate(then, acc) - [0.0, 0.0, GRAVITY_M_S2]
            changed = (speed - self.velocity_m_s) / step
            self._bias_m_s2 = self._bias_m_s2 + step / BIAS_S * (measured - changed - self._bias_m_s2)
        self.time_s, self.blind_s = now_s, now_s - believed.pose_s
        self.position_m, self.velocity_m_s, self.quaternion = believed.position_m - late_s * speed, speed, then

    def _integrate(self, now_s: float, acc: np.ndarray | None, gyro: np.ndarray | None, step: float) -> None:
        self.time_s, self.blind_s = now_s, self.blind_s + step
        self.position_m = self.position_m + step * self.velocity_m_s
        if acc is None or gyro is None:
            return
        self.quaternion = so3.multiply(self.quaternion, so3.exp(step * gyro))
        force = so3.rotate(self.quaternion, acc) - [0.0, 0.0, GRAVITY_M_S2] - self._bias_m_s2
        self.velocity_m_s = self.velocity_m_s + step * force

    def _average_hover(self, acc: np.ndarray, values: Mapping[str, float], step: float) -> None:
        counts = values.get(THRUST, 0.0)
        carried = self.position_m[2] > self.ground_m + AIR_M and acc[2] > LEAST_G * GRAVITY_M_S2
        if not (carried and counts > 0.0 and 0.0 < step < FRESH_S):
            return
        now = counts * GRAVITY_M_S2 / acc[2]
        self._hovers += 1
        share = max(1.0 / self._hovers, step / HOVER_S)
        self.hover_counts = now if self._hovers == 1 else self.hover_counts + share * (now - self.hover_counts)

    def _compare(self, now_s: float, values: Mapping[str, float], logged_s: Mapping[str, float]) -> None:
        """The vehicle's estimate against this one, once for every new log packet."""
        came_s = min(logged_s.get(name, -np.inf) for name in (*PLACE, *SPEED, *TURN))
        if came_s <= self._compared_s or now_s - came_s > FRESH_S or not np.isfinite(self.time_s):
            return
        self._compared_s, self.fault, self.excess = came_s, "", 0.0
        own = np.array([values[name] for name in TURN])
        if not np.isfinite(own).all() or np.linalg.norm(own) < 0.5:
            self.fault, self.excess = "the vehicle's attitude is not a number", np.inf
            return
        own /= np.linalg.norm(own)
        self.turn = so3.multiply(self.quaternion, so3.conjugate(own))
        off = np.array([values[name] for name in PLACE]) - self.position_m
        faster = np.array([values[name] for name in SPEED]) - self.velocity_m_s
        turned = float(np.degrees(so3.geodesic_angle(own, self.quaternion)))
        speed, blind = float(np.linalg.norm(self.velocity_m_s)), self.blind_s
        found = ((_parts(off) / (NEAR_M + PER_M_S * speed + PER_S2 * blind**2),
                  f"the vehicle's estimate is {np.linalg.norm(off):.2f} m from where its IMU shows it"),
                 (_parts(faster) / (NEAR_M_S + PER_S * blind),
                  f"the vehicle's velocity is {np.linalg.norm(faster):.2f} m/s from what its IMU shows"),
                 (np.array([turned / NEAR_DEG]),
                  f"the vehicle's attitude is {turned:.0f} deg from what its gyro shows"))
        self.excess, words = max((float(np.nan_to_num(ratios, nan=np.inf).max()), text) for ratios, text in found)
        self.fault = words if self.excess > 1.0 else ""


def _parts(vector: np.ndarray) -> np.ndarray:
    """Size over the ground and in height (2,) of a vector (3,)."""
    return np.array([np.hypot(vector[0], vector[1]), abs(vector[2])])
