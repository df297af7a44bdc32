"""Checks before arming: each returns one line with the mistake, and the flight is refused.

Poses are checked against sensors that need no motion capture. Gravity at rest shows up, the accelerometer shows tilt,
and the vehicle's estimate at power-up shows its heading. Only then are poses sent, and the estimate has to converge to
them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ... import so3
from ...errors import InputError
from ..blocks import Block
from ..host_clock import Clock
from ..mocap.pose_datagram import Pose
from .dead_reckoning import THRUST
from .flight_plan import Plan
from .pose_tracker import PoseTrack
from .safety import CRASHED, LOCKED, TUMBLED, Limits

NEEDED_LOGS = ("pm.vbat", "supervisor.info", "acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z",
               "stateEstimate.x", "stateEstimate.y", "stateEstimate.z",
               "stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz",
               "stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz", "stateEstimate.qw", THRUST)
NEEDED_PARAMETERS = ("stabilizer.controller", "stabilizer.estimator", "kalman.resetEstimation", "kalman.initialX",
                     "kalman.initialY", "kalman.initialZ", "kalman.initialYaw")
CAN_ARM, ARMED, CAN_FLY = 1 << 0, 1 << 1, 1 << 3
KALMAN = 2
REST_BATTERY_V = 3.6
"""A cell at rest that is nearly empty: recorded flights began at 3.96 to 4.19 V."""
POSES_S, LOGS_S, FEWEST_POSES = 2.0, 2.0, 20
STARTS_S = 15.0
"""Limit for a vehicle that answers but is still starting (sensors calibrate only while it is at rest)."""
FEWEST_HZ = 20.0
TILT_DEG, YAW_DEG = 15.0, 45.0
"""Between mocap and gravity (bodies are defined on a table; recordings: 1-3 deg); between mocap and where the vehicle
believes to look at power-up."""
NEAR_M, NEAR_DEG, CONVERGE_S, STEADY_S = 0.05, 6.0, 5.0, 0.5
RESETS = 3
"""The vehicle's filter is reset so often until its estimate converges to the poses."""
RESTS_M = 0.01


def health_blocks() -> list[Block]:
    """What the checks and the rules need of the vehicle, in three slow blocks."""
    return [Block("health", 100, NEEDED_LOGS[:2], ("", "")), Block("motion", 20, NEEDED_LOGS[2:8], ("",) * 6),
            Block("estimate", 50, NEEDED_LOGS[8:14], ("",) * 6), Block("turn", 50, NEEDED_LOGS[14:], ("",) * 5)]


def check_tables(uri: str, logs: set[str], parameters: set[str]) -> None:
    """Raises InputError naming every log variable and parameter that flying needs and the vehicle lacks."""
    missing = sorted(set(NEEDED_LOGS) - logs) + sorted(set(NEEDED_PARAMETERS) - parameters)
    if missing:
        raise InputError(uri, f"the vehicle does not have {', '.join(missing)}", "flash firmware 2025.12; not armed")


def check_battery(uri: str, battery_V: float) -> None:
    if not battery_V >= REST_BATTERY_V:
        raise InputError(uri, f"battery at {battery_V:.2f} V at rest", f"charge it: {REST_BATTERY_V} V are needed; "
                         "not armed")


def check_supervisor(uri: str, bits: int) -> None:
    """Neither tumbled, crashed nor locked, and able to be armed."""
    for bit, word, advice in ((LOCKED, "locked", "switch it off and on"), (CRASHED, "crashed", "switch it off and on"),
                              (TUMBLED, "lying on its back", "put it on its legs")):
        if bits & bit:
            raise InputError(uri, f"the vehicle is {word}", f"{advice}; not armed")
    if not may_arm(bits):
        raise InputError(uri, "the vehicle's supervisor does not allow arming", "see its console; not armed")


def may_arm(bits: int) -> bool:
    """Whether the supervisor allows arming, or has armed. A vehicle that is still starting does not."""
    return bool(bits & (CAN_ARM | ARMED | CAN_FLY))


def check_poses(name: str, pose: Pose | None, count: int, waited_s: float) -> Pose:
    """Poses come, and often enough."""
    place = f"--mocap {name}"
    if pose is None:
        raise InputError(place, f"no pose of the vehicle in {waited_s:.1f} s", "is it seen, is the address right? "
                         "not armed")
    if count / waited_s < FEWEST_HZ:
        raise InputError(place, f"{count / waited_s:.0f} poses a second", f"at least {FEWEST_HZ:.0f} are needed; "
                         "not armed")
    return pose


def check_frame(name: str, pose: Pose, gravity_g: np.ndarray, fence: tuple[np.ndarray, np.ndarray]) -> None:
    """gravity_g (3,): the accelerometer at rest. Metres, z up, a body frame that agrees with gravity, in the fence."""
    place, least, most = f"--mocap {name}", *fence
    if not 0.8 < np.linalg.norm(gravity_g) < 1.2:
        raise InputError("accelerometer", f"{np.linalg.norm(gravity_g):.2f} g at rest", "is the vehicle standing "
                         "still? not armed")
    p = pose.position_m
    if (p < least).any() or (p > most).any():
        inside = (p / 1000.0 >= least).all() and (p / 1000.0 <= most).all() and np.abs(p).max() > 10.0
        text = f"the vehicle is at ({p[0]:.2f}, {p[1]:.2f}, {p[2]:.2f})"
        if inside:
            raise InputError(place, f"{text}, which look like millimetres", "give poses in metres; not armed")
        raise InputError(place, f"{text} m, outside the fence", "move it, or widen --fence; not armed")
    up = so3.rotate_inverse(pose.quaternion / np.linalg.norm(pose.quaternion), np.array([0.0, 0.0, 1.0]))
    measured = gravity_g / np.linalg.norm(gravity_g)
    angle = float(np.degrees(np.arccos(np.clip(up @ measured, -1.0, 1.0))))
    if angle > 150.0:
        raise InputError(place, f"its world is {angle:.0f} deg from gravity: z points down", "give poses with z up; "
                         "not armed")
    if angle > TILT_DEG:
        raise InputError(place, f"its attitude is {angle:.0f} deg from gravity at rest", "define the body level, x "
                         "forward, z up, and send x, y, z, w; not armed")


def check_yaw(name: str, mocap_yaw_rad: float, own_yaw_rad: float) -> None:
    """Where the motion capture says the vehicle looks, against where it believes to look after a reset."""
    off = float(np.degrees(so3.wrap_angle(mocap_yaw_rad - own_yaw_rad)))
    if abs(off) > YAW_DEG:
        raise InputError(f"--mocap {name}", f"yaw {np.degrees(mocap_yaw_rad):.0f} deg, the vehicle believes "
                         f"{np.degrees(own_yaw_rad):.0f}: {abs(off):.0f} deg apart", "turn the vehicle along x, mend "
                         "the body's definition, or say where it looks with --yaw; not armed")


def check_plan(plan: Plan, limits: Limits) -> None:
    """The path lies inside the fence and below the speed limit. Raises InputError."""
    low, high = plan.box()
    least, most = limits.fence
    beyond = np.maximum(least - low, high - most)
    axis = int(np.argmax(beyond))
    if beyond[axis] > 0.0:
        raise InputError("--trajectory", f"{'xyz'[axis]} from {low[axis]:.2f} to {high[axis]:.2f} m, beyond the fence",
                         "give a smaller --size or a wider --fence")
    fastest = plan.fastest_m_s()
    if fastest > limits.speed_m_s:
        raise InputError("--trajectory", f"{fastest:.1f} m/s on the path, the limit is {limits.speed_m_s:.1f}",
                         "give a lower --speed or a higher --speed-limit")


class NotConvergedError(InputError):
    """The vehicle's estimate stays away from the poses."""


@dataclass
class Convergence:
    """Whether the vehicle's estimate has come to the poses and stayed."""

    name: str
    since_s: float | None = None

    def near(self, now_s: float, pose: Pose, values: Mapping[str, float]) -> bool:
        """True once the estimate has been near for STEADY_S."""
        off, turned = self.apart(pose, values)
        if off < NEAR_M and turned < NEAR_DEG:
            self.since_s = now_s if self.since_s is None else self.since_s
            return now_s - self.since_s > STEADY_S
        self.since_s = None
        return False

    @staticmethod
    def apart(pose: Pose, values: Mapping[str, float]) -> tuple[float, float]:
        """Metres and degrees between pose and estimate."""
        place = np.array([values[f"stateEstimate.{a}"] for a in "xyz"])
        turn = np.array([values[f"stateEstimate.{q}"] for q in ("qx", "qy", "qz", "qw")])
        if not np.isfinite(turn).all() or np.linalg.norm(turn) < 0.5:
            return float("inf"), 180.0
        angle = so3.geodesic_angle(turn / np.linalg.norm(turn), pose.quaternion / np.linalg.norm(pose.quaternion))
        return float(np.linalg.norm(place - pose.position_m)), float(np.degrees(angle))

    def refuse(self, pose: Pose, values: Mapping[str, float]) -> NotConvergedError:
        off, turned = self.apart(pose, values)
        return NotConvergedError(f"--mocap {self.name}", f"the vehicle's estimate stays {100.0 * off:.0f} cm and "
                          f"{turned:.0f} deg from the poses", "do the poses reach it, is it the right body? not armed")


def wait_for(clock: Clock, most_s: float, done: Callable[[], bool]) -> bool:
    """Whether ``done`` became true within ``most_s``."""
    until = clock.now() + most_s
    while not done():
        if clock.now() > until:
            return False
        clock.sleep_until(clock.now() + 0.02)
    return True


def standing_still(track: PoseTrack, first: Pose) -> bool:
    """Whether the vehicle is where it was at ``first``."""
    newest = track.newest
    return newest is not None and float(np.linalg.norm(newest.position_m - first.position_m)) < RESTS_M
