"""Which ULog topics make which stream, in our units and axes (``px4_frames``). A stream comes from one topic: the first
of its list that was logged. Column names are ``topic.field``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..flight import Stream, make_stream
from . import px4_frames as frames

FARTHEST_STAMP_S = 1e5
"""A stamp further than this from the middle one of its topic is damage: no log lasts a day."""


@dataclass(frozen=True)
class Topic:
    """One instance of a topic: ``fields`` (n,) each by flattened name, ``time_us`` (n,) since boot, ``lost`` rows whose
    stamp was damage."""

    name: str
    time_us: np.ndarray
    fields: dict[str, np.ndarray]
    lost: int = 0

    def array(self, *names: str) -> np.ndarray | None:
        """(n, k), or None when a field is not there, or none is named. What is no measurement becomes NaN."""
        if not names or any(n not in self.fields for n in names):
            return None
        with np.errstate(invalid="ignore"):
            values = np.stack([self.fields[n].astype(float) for n in names], axis=1)
            return np.where(np.abs(values) < 1e12, values, np.nan)


def topic_of(name: str, fields: dict[str, np.ndarray]) -> Topic | None:
    """The rows of one logged topic, on the time of measuring where it was logged beside that of sending."""
    if "timestamp" not in fields or not len(fields["timestamp"]):
        return None
    time_us = fields["timestamp"].astype(np.float64)
    sampled = fields.get("timestamp_sample")
    if sampled is not None and (sampled > 0).all() and (np.abs(time_us - sampled.astype(np.float64)) < 1e6).all():
        time_us = sampled.astype(np.float64)
    near = np.abs(time_us - np.median(time_us)) < 1e6 * FARTHEST_STAMP_S
    kept = fields if near.all() else {k: v[near] for k, v in fields.items()}
    return Topic(name, time_us[near], kept, int((~near).sum()))


def indexed(field: str, count: int) -> tuple[str, ...]:
    """``q`` -> ``q[0]``, ``q[1]``, ..."""
    return tuple(f"{field}[{i}]" for i in range(count))


def stream_of(name: str, topic: Topic, parts: Sequence[tuple[str, Sequence[str], np.ndarray | None]]) -> Stream | None:
    """A stream of ``parts``: quantities (one word each), the fields they come from, values (n, k) or None.

    Columns and rows without any value are no samples (PX4 writes NaN for what it does not know). Times are still
    microseconds since boot, as seconds.
    """
    quantities: list[str] = []
    columns: list[str] = []
    blocks = []
    for words, fields, values in parts:
        if values is None:
            continue
        for k, quantity in enumerate(words.split()):
            if np.isfinite(values[:, k]).any():
                quantities.append(quantity)
                columns.append(f"{topic.name}.{fields[k]}")
                blocks.append(values[:, k])
    if not blocks:
        return None
    values = np.stack(blocks, axis=1)
    filled = np.isfinite(values).any(axis=1)
    time_s = 1e-6 * topic.time_us[filled]
    duration = float(time_s[-1] - time_s[0])
    rate = (len(time_s) - 1) / duration if duration > 0.0 else float("nan")
    return make_stream(name, time_s, values[filled], quantities, columns, samples=len(time_s), rate_hz=rate)


def _swapped(fields: Sequence[str]) -> list[str]:
    return [fields[i] for i in frames.WORLD_ORDER]


def _world(topic: Topic, *fields: str) -> np.ndarray | None:
    values = topic.array(*fields)
    return None if values is None else frames.world_vectors(values)


def _body(topic: Topic, *fields: str) -> np.ndarray | None:
    values = topic.array(*fields)
    return None if values is None else frames.body_vectors(values)


def _turn(topic: Topic, fields: Sequence[str]) -> np.ndarray | None:
    values = topic.array(*fields)
    return None if values is None else frames.quaternions(values)


ACC, GYRO = "acc_x acc_y acc_z", "gyro_x gyro_y gyro_z"
QUATERNION = indexed("q", 4)
TURNED = (*QUATERNION[1:], QUATERNION[0])


def imu(topic: Topic) -> Stream | None:
    """sensor_combined [m/s^2, rad/s], or vehicle_imu (increments over intervals in microseconds)."""
    acc, gyro = indexed("accelerometer_m_s2", 3), indexed("gyro_rad", 3)
    if topic.name == "sensor_combined":
        return stream_of("imu", topic, [(ACC, acc, _body(topic, *acc)), (GYRO, gyro, _body(topic, *gyro))])
    parts = []
    for words, fields in ((ACC, indexed("delta_velocity", 3)), (GYRO, indexed("delta_angle", 3))):
        values, interval = _body(topic, *fields), topic.array(f"{fields[0][:-3]}_dt")
        if values is not None and interval is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.where(interval > 0.0, values / (1e-6 * interval), np.nan)
            parts.append((words, fields, values))
    return stream_of("imu", topic, parts)


def attitude(topic: Topic) -> Stream | None:
    return stream_of("attitude", topic, [("roll pitch yaw", ("q",) * 3, _euler(topic))])


def _euler(topic: Topic) -> np.ndarray | None:
    turned = _turn(topic, QUATERNION)
    return None if turned is None else so3.euler_zyx(turned)


def attitude_qw(topic: Topic) -> Stream | None:
    return stream_of("attitude_qw", topic, [("qx qy qz qw", TURNED, _turn(topic, QUATERNION))])


def estimator(topic: Topic) -> Stream | None:
    """Position and velocity of vehicle_local_position; NaN where PX4 marks them as not valid."""
    parts = []
    for words, fields, flags in (("x y z", ("x", "y", "z"), ("xy_valid", "z_valid")),
                                 ("vx vy vz", ("vx", "vy", "vz"), ("v_xy_valid", "v_z_valid"))):
        values, valid = _world(topic, *fields), topic.array(*flags)
        if values is not None and valid is not None:
            values = np.where(valid[:, [0, 0, 1]] > 0, values, np.nan)
        parts.append((words, _swapped(fields), values))
    return stream_of("estimator", topic, parts)


def estimator_acc(topic: Topic) -> Stream | None:
    fields = ("ax", "ay", "az")
    return stream_of("estimator_acc", topic, [("ax ay az", _swapped(fields), _world(topic, *fields))])


def mocap(topic: Topic) -> Stream | None:
    """Poses given from outside. Velocity is left out: its frame changes between loggers, and poses give it."""
    position = next((f for f in (indexed("position", 3), ("x", "y", "z")) if topic.array(*f) is not None), None)
    if position is None:
        return None
    return stream_of(
        "mocap",
        topic,
        [("px py pz", _swapped(position), _world(topic, *position)), ("qx qy qz qw", TURNED, _turn(topic, QUATERNION))],
    )


def setpoint(topic: Topic) -> Stream | None:
    fields, yaw = ("x", "y", "z"), topic.array("yaw")
    turned = None if yaw is None else frames.world_yaw(yaw)
    return stream_of("setpoint", topic, [("x y z", _swapped(fields), _world(topic, *fields)), ("yaw", ["yaw"], turned)])


def command(topic: Topic) -> Stream | None:
    """Collective thrust set-point, 0..1 upward; PX4's vector points down."""
    for field, sign in (("thrust_body[2]", -1.0), ("xyz[2]", -1.0), ("thrust", 1.0), ("control[3]", 1.0)):
        values = topic.array(field)
        if values is not None and np.isfinite(values).any():
            return stream_of("command", topic, [("thrust", [field], sign * values)])
    return None


def battery(topic: Topic) -> Stream | None:
    field = "voltage_v" if "voltage_v" in topic.fields else "voltage_filtered_v"
    values = topic.array(field)
    return stream_of("battery", topic, [("vbat", [field], None if values is None else _connected(values))])


def _connected(volts: np.ndarray) -> np.ndarray:
    return np.where(volts > 0.0, volts, np.nan)


STREAMS = {
    "imu": (imu, ("sensor_combined", "vehicle_imu")),
    "attitude": (attitude, ("vehicle_attitude",)),
    "attitude_qw": (attitude_qw, ("vehicle_attitude",)),
    "estimator": (estimator, ("vehicle_local_position",)),
    "estimator_acc": (estimator_acc, ("vehicle_local_position",)),
    "mocap": (mocap, ("vehicle_mocap_odometry", "att_pos_mocap", "vehicle_visual_odometry")),
    "setpoint": (setpoint, ("vehicle_local_position_setpoint",)),
    "command": (
        command,
        ("vehicle_attitude_setpoint", "vehicle_thrust_setpoint", "vehicle_rates_setpoint", "actuator_controls_0"),
    ),
    "battery": (battery, ("battery_status",)),
}
"""Stream -> how it is made, topics it may come from, best first."""
