"""What the topics of a bag are for, from their names and types: tracker, estimate, set-point, sensor; and whose.

Numbers of messages decide nothing: a set-point is often sent more often than the pose of a tracker.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_APART = re.compile(r"[^A-Za-z0-9]+")

WANTED = frozenset("""
    setpoint setpoints sp target targets reference ref desired des goal goals command commands cmd plan
    planned planner waypoint waypoints trajectory path initialpose initial
    """.split()) | {"carrot", "lookahead", "horizon"}  # noqa: SIM905
"""Words of a topic with commanded positions, not measured ones."""
TRACKED = frozenset("""
    vrpn vicon optitrack natnet mocap qualisys qtm motive motion capture tracker tracking truth
    groundtruth gt leica phasespace nokov poses rigid bodies vision external gazebo model models
    """.split())  # noqa: SIM905
"""Words of a tracker."""
ESTIMATED = frozenset("""
    local odom odometry estimate estimated estimator est ekf ekf2 ukf filter filtered state kalman
    onboard fused fusion vio vins slam orb openvins msckf msf rovio svo basalt loam lio t265 realsense
    visual rtabmap localization
    """.split())  # noqa: SIM905
"""Words of what the vehicle, or a program on it, estimates."""
AUTOPILOT = frozenset("""
    mavros fmu mavlink px4 ardupilot
    """.split())  # noqa: SIM905
"""Words of the flight controller; a tracker's pose under them was forwarded to it."""
OTHER_SENSOR = frozenset("""
    camera cam realsense d435 d435i d455 t265 zed livox ouster os0 os1 os2 hesai lidar velodyne laser phone
    lsm9ds1
    """.split())  # noqa: SIM905
"""Words of a device with a separate inertial sensor."""
RAW = frozenset({"raw"})
FUNCTION = WANTED | TRACKED | ESTIMATED | AUTOPILOT | OTHER_SENSOR | RAW | frozenset("""
    imu data pose position orientation attitude twist velocity vel accel acceleration battery status
    voltage info sensor sensors client node server driver ros rviz tf static world map ground transform
    stamped stamp topic in out body frame base link cov covariance with rate raw mag magnetometer gps
    baro pressure range height altitude cloud points uwb
    sample inter
    """.split())  # noqa: SIM905
"""Words that say what a topic is, and not whose."""
TRACKED_TOPICS = frozenset({"/blackbird/state"})
"""Topics that data sets describe as motion capture."""
WORLDS = frozenset("""
    world map mocap vicon optitrack qualisys motive earth odom global origin
    """.split())  # noqa: SIM905
"""Frames whose children may be tracked bodies."""
NAVIGATED = frozenset({"map", "odom"})
"""Worlds of programs that estimate where the vehicle is."""
PARTS = frozenset("""
    base_link base_footprint body fcu
    """.split())  # noqa: SIM905
"""Names of a body that every vehicle has."""


class Role(Enum):
    """What a topic of poses says; the first of those that a vehicle has is its motion capture."""

    TRACKER = 0
    FORWARDED = 1
    UNKNOWN = 2
    ESTIMATE = 3
    SETPOINT = 4
    NONE = 5


@dataclass(frozen=True)
class Topic:
    """``name`` as in the bag, with ``:BODY`` behind it for one body of a list; ``kind`` its message type, or that of
    the element; ``frame``: the one in which a body of a list is given."""

    name: str
    kind: str
    body: str = ""
    frame: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """Words of the name in lower case, without the body."""
        return tuple(words_of(self.name.partition(":")[0]))

    @property
    def vehicle(self) -> str:
        """The first part of the name that says whose it is; empty without one."""
        if self.body:
            return "" if self.body.lower() in PARTS else self.body
        return next((part for part in self.name.strip("/").split("/") if not _says_what(part)), "")

    @property
    def stem(self) -> str:
        """The name without its last part: topics of one node about one thing share it."""
        return self.name.partition(":")[0].rpartition("/")[0]

    @property
    def role(self) -> Role:
        """Of a topic of poses."""
        words = set(self.words)
        tracked = self.name in TRACKED_TOPICS or bool(words & TRACKED) or ("ground" in words and "truth" in words)
        if words & WANTED:
            return Role.NONE if tracked else Role.SETPOINT
        if tracked:
            return Role.FORWARDED if words & AUTOPILOT else Role.TRACKER
        estimated = words & (ESTIMATED | AUTOPILOT) or self.frame in NAVIGATED
        if estimated or self.kind == "nav_msgs/msg/Odometry":
            return Role.ESTIMATE
        return Role.UNKNOWN


def words_of(text: str) -> list[str]:
    """Words in lower case: ``/vrpn_client_node/uav1/pose`` -> vrpn, client, node, uav1, pose."""
    return [word.lower() for word in _APART.split(_CAMEL.sub("_", text)) if word]


def _says_what(part: str) -> bool:
    """Whether a part of a name says what a topic is: all of its words do, digits behind a sensor's included."""
    words = words_of(part)
    return all(word in FUNCTION or word.rstrip("0123456789") in FUNCTION - AUTOPILOT - TRACKED for word in words)
