"""A short flight whose poses, attitude and inertial sensor agree, and bags that contain it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
START_S = 1_772_689_631
GRAVITY = np.array([0.0, 0.0, 9.81])
POSE, IMU, ODOMETRY = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"


@dataclass(frozen=True)
class Motion:
    """time_s (n,), position_m, velocity_m_s (n, 3) in the world, quaternion (n, 4), force_m_s2 and rate_rad_s (n, 3) in
    the body."""

    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    force_m_s2: np.ndarray
    rate_rad_s: np.ndarray


@cache
def motion() -> Motion:
    """16 s: two on the ground, a climb, a path in all axes with turns of the heading, and a landing. 100 Hz."""
    time_s = np.arange(0.0, 16.0, 0.01)

    def rises(at: float) -> np.ndarray:
        u = np.clip((time_s - at) / 2.0, 0.0, 1.0)
        return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)

    flies, moves = rises(2.0) * (1.0 - rises(12.0)), rises(3.5) * (1.0 - rises(9.5))
    path = [0.8 * np.sin(1.7 * time_s), 0.6 * np.sin(2.2 * time_s + 0.5), 0.2 * np.sin(1.3 * time_s)]
    position = np.stack([moves * p for p in path], axis=1) + np.outer(flies, [0.0, 0.0, 1.0])
    velocity = np.gradient(position, time_s, axis=0)
    force = np.gradient(velocity, time_s, axis=0) + GRAVITY
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    yaw = 0.8 * np.sin(0.9 * time_s) * moves
    left = np.cross(up, np.stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw], axis=1))
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    rate = (turn[:-1].inv() * turn[1:]).as_rotvec() / 0.01
    return Motion(time_s, position, velocity, turn.as_quat(), turn.inv().apply(force), np.vstack([rate, rate[-1:]]))


def noisy(values: np.ndarray, sd: float) -> np.ndarray:
    return values + sd * np.random.default_rng(round(1e6 * sd)).standard_normal(values.shape)


def _header(time_s: float) -> object:
    sec, nanosec = divmod(round(time_s * 1e9), 10**9)
    return TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](START_S + sec, nanosec), "world")


def _made(kind: str, *values: np.ndarray) -> object:
    return TYPES[f"geometry_msgs/msg/{kind}"](*map(float, np.concatenate(values)))


def _pose(position: np.ndarray, quaternion: np.ndarray) -> object:
    return TYPES["geometry_msgs/msg/Pose"](_made("Point", position), _made("Quaternion", quaternion))


def poses(position: np.ndarray | None = None, quaternion: np.ndarray | None = None) -> tuple[str, list]:
    """A topic of PoseStamped."""
    m = motion()
    p = noisy(m.position_m, 2e-4) if position is None else position
    q = m.quaternion if quaternion is None else quaternion
    return POSE, [TYPES[POSE](_header(t), _pose(*row)) for t, *row in zip(m.time_s, p, q, strict=True)]


def inertial(force_m_s2: np.ndarray | None = None, rate_rad_s: np.ndarray | None = None,
             late_s: float = 0.0) -> tuple[str, list]:
    """A topic of Imu."""
    m, level, covariance = motion(), _made("Quaternion", np.array([0.0, 0.0, 0.0, 1.0])), np.zeros(9)
    force = noisy(m.force_m_s2 if force_m_s2 is None else force_m_s2, 0.05)
    rate = noisy(m.rate_rad_s if rate_rad_s is None else rate_rad_s, 0.01)
    return IMU, [TYPES[IMU](_header(t + late_s), level, covariance, _made("Vector3", w), covariance,
                            _made("Vector3", f), covariance) for t, f, w in zip(m.time_s, force, rate, strict=True)]


def odometry(velocity_m_s: np.ndarray) -> tuple[str, list]:
    """A topic of Odometry whose twist is ``velocity_m_s``."""
    m, rest = motion(), np.zeros(36)
    position, none = noisy(m.position_m, 0.003), _made("Vector3", np.zeros(3))
    return ODOMETRY, [
        TYPES[ODOMETRY](_header(t), "body", TYPES["geometry_msgs/msg/PoseWithCovariance"](_pose(p, q), rest),
                        TYPES["geometry_msgs/msg/TwistWithCovariance"](
                            TYPES["geometry_msgs/msg/Twist"](_made("Vector3", v), none), rest))
        for t, p, q, v in zip(m.time_s, position, m.quaternion, velocity_m_s, strict=True)]


def bag(folder: Path, cut: str = "", **topics: tuple[str, list]) -> Path:
    """An MCAP in ``folder``; ``a__b`` is the topic /a/b; the messages of ``cut`` lose their ends."""
    with Writer2(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for word, (kind, messages) in topics.items():
            connection = writer.add_connection("/" + word.replace("__", "/"), kind, typestore=STORE)
            for message in messages:
                stamp, raw = message.header.stamp, bytes(STORE.serialize_cdr(message, kind))
                writer.write(connection, stamp.sec * 10**9 + stamp.nanosec, raw[:20] if word == cut else raw)
    return folder
