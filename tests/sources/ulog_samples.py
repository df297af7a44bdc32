"""A small writer of ULog files: header, formats, parameters, subscriptions, data."""

from __future__ import annotations

import struct

import numpy as np

MAGIC = b"ULog\x01\x12\x35"
CODES = {"uint64_t": "Q", "float": "f", "double": "d", "bool": "?", "uint8_t": "B", "int32_t": "i", "uint32_t": "I"}
FORMATS = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
    "vehicle_attitude": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
    "vehicle_local_position": "uint64_t timestamp;bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;"
    "float x;float y;float z;float vx;float vy;float vz;float ax;float ay;float az;",
    "vehicle_local_position_groundtruth": "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;",
    "vehicle_attitude_groundtruth": "uint64_t timestamp;float[4] q;",
    "vehicle_imu": "uint64_t timestamp;float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt;"
    "uint32_t delta_velocity_dt;",
    "vehicle_visual_odometry": "uint64_t timestamp;float[3] position;float[4] q;",
    "vehicle_local_position_setpoint": "uint64_t timestamp;float x;float y;float z;float yaw;",
    "vehicle_attitude_setpoint": "uint64_t timestamp;float[3] thrust_body;",
    "battery_status": "uint64_t timestamp;float voltage_v;",
    "actuator_motors": "uint64_t timestamp;float[12] control;",
    "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[16] output;",
    "esc_report": "int32_t esc_rpm;uint8_t actuator_function;",
    "esc_status": "uint64_t timestamp;esc_report[4] esc;",
    "sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec;",
    "someone_elses": "uint64_t timestamp;float x;",
}


def message(kind: str, payload: bytes) -> bytes:
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def _layout(name: str) -> str:
    codes = ""
    for field in filter(None, FORMATS[name].split(";")):
        kind, _, size = field.split(" ")[0].partition("[")
        codes += (CODES[kind] if kind in CODES else _layout(kind)) * int(size.rstrip("]") or 1)
    return codes


def ulog(topics: dict[str, list[tuple]], parameters: dict[str, float] | None = None) -> bytes:
    """``topics``: name -> rows (timestamp in microseconds first, then every field, arrays flattened), sorted into one
    stream of messages by time as a logger would. ``name:1`` is a topic's second instance."""
    out = MAGIC + b"\x01" + struct.pack("<Q", 1_000_000) + message("B", bytes(40))
    for name, fields in FORMATS.items():
        out += message("F", f"{name}:{fields}".encode())
    out += message("I", bytes([len(b"char[3] ver_hw")]) + b"char[3] ver_hw" + b"V5X")
    for name, value in (parameters or {}).items():
        key = f"{'int32_t' if isinstance(value, int) else 'float'} {name}".encode()
        out += message("P", bytes([len(key)]) + key + struct.pack("<i" if isinstance(value, int) else "<f", value))
    rows = []
    for number, (name, data) in enumerate(topics.items()):
        name, _, instance = name.partition(":")
        out += message("A", struct.pack("<BH", int(instance or 0), number) + name.encode())
        rows += [(row[0], number, struct.pack(f"<H{_layout(name)}", number, *row)) for row in data]
    return out + b"".join(message("D", payload) for _, _, payload in sorted(rows, key=lambda r: r[:2]))


def times(n: int = 20, step_us: int = 10_000, first_us: int = 5_000_000) -> list[int]:
    return [first_us + i * step_us for i in range(n)]


def yaw_right_of_north(angle: float) -> tuple[float, float, float, float]:
    """PX4's w, x, y, z of a level vehicle turned clockwise from north."""
    return (float(np.cos(angle / 2)), 0.0, 0.0, float(np.sin(angle / 2)))
