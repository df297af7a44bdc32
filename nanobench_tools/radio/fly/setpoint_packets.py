"""Set-points as packets of the generic commander (port 7, channel 0), and their content.

Layouts are those of crtp_commander_generic.c of firmware 2025.12.1: type byte, then little-endian numbers. Rates and
thrust are sent as type ``manual``. Its thrust is not limited to 60000 as that of the oldest port, which is too little
for a vehicle that hovers at 57600. Its pitch rate is the legacy one (nose up positive), its yaw rate is not turned.
"""

import struct
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import UsageError
from ...firmware.flatness import body_rates
from ...firmware.records import ABSOLUTE, VELOCITY
from ...methods import Reference
from ...units import GRAVITY_M_S2

KINDS = ("thrust-rates", "full-state", "velocity", "position")
STOP, FULL_STATE, POSITION, VELOCITY_WORLD, MANUAL = 0, 6, 7, 8, 11
_POSITION, _VELOCITY, _MANUAL = struct.Struct("<B4f"), struct.Struct("<B4f"), struct.Struct("<B3fHB")
_FULL = struct.Struct("<B9hI3h")
MOST = 32.767
"""Full-state numbers are 16 bits of thousandths; larger ones are clipped."""
MOST_COUNTS = 65535


def stop() -> bytes:
    """No set-point: motors off."""
    return bytes([STOP])


def position(place_m: Sequence[float] | np.ndarray, yaw_rad: float) -> bytes:
    """Place (3,) in the world and heading, held with the vehicle's own loops."""
    x, y, z = (float(v) for v in place_m)
    return _POSITION.pack(POSITION, x, y, z, float(np.degrees(yaw_rad)))


def velocity(speed_m_s: np.ndarray, yaw_rate_rad_s: float) -> bytes:
    """Velocity (3,) in the world and turning."""
    return _VELOCITY.pack(VELOCITY_WORLD, *map(float, speed_m_s), float(np.degrees(yaw_rate_rad_s)))


def rates(thrust_counts: float, rate_rad_s: np.ndarray) -> bytes:
    """Collective thrust as counts of one motor 0..65535, body rates (3,) forward-left-up."""
    x, y, z = (float(v) for v in np.degrees(rate_rad_s))
    return _MANUAL.pack(MANUAL, x, -y, z, round(min(max(thrust_counts, 0.0), MOST_COUNTS)), 1)


def attitude(thrust_counts: float, roll_rad: float, pitch_rad: float) -> bytes:
    """Collective thrust as counts of one motor 0..65535, roll and pitch (forward-left-up) held, yaw rate 0."""
    counts = round(min(max(thrust_counts, 0.0), MOST_COUNTS))
    return _MANUAL.pack(MANUAL, float(np.degrees(roll_rad)), -float(np.degrees(pitch_rad)), 0.0, counts, 0)


def full_state(place_m: np.ndarray, speed_m_s: np.ndarray, acceleration_m_s2: np.ndarray, quaternion: np.ndarray,
               rate_rad_s: np.ndarray) -> bytes:
    """Place, velocity, acceleration (3,) world, attitude (4,), body rates (3,), in thousandths."""
    numbers = np.concatenate([place_m, speed_m_s, acceleration_m_s2, rate_rad_s])
    whole = np.round(1000.0 * np.clip(numbers, -MOST, MOST)).astype(int).tolist()
    return _FULL.pack(FULL_STATE, *whole[:9], compressed(quaternion), *whole[9:])


def compressed(quaternion: np.ndarray) -> int:
    """32 bits of a unit quaternion: index of its largest number, then the others in 10 bits each (quatcompress.h)."""
    q = np.asarray(quaternion, float)
    largest = int(np.argmax(np.abs(q)))
    turned = -1.0 if q[largest] < 0.0 else 1.0
    word = largest
    for i in range(4):
        if i != largest:
            part = turned * q[i]
            size = min(int(511.0 * abs(part) * np.sqrt(2.0) + 0.5), 511)
            word = word << 10 | (part < 0.0) << 9 | size
    return word


def decompressed(word: int) -> np.ndarray:
    """The quaternion (4,) of ``compressed``."""
    largest, q = word >> 30, np.zeros(4)
    for i in reversed([i for i in range(4) if i != largest]):
        size = (word & 511) / 511.0 / np.sqrt(2.0)
        q[i] = -size if word & 512 else size
        word >>= 10
    q[largest] = np.sqrt(max(1.0 - float(q @ q), 0.0))
    return q


def attitude_of(acceleration_m_s2: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Attitude (4,) of a vehicle that flies this acceleration (3,) without drag, looking along ``yaw_rad``."""
    up = np.asarray(acceleration_m_s2, float) + np.array([0.0, 0.0, GRAVITY_M_S2])
    z = up / max(float(np.linalg.norm(up)), 1e-6)
    y = np.cross(z, [np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    y /= max(float(np.linalg.norm(y)), 1e-6)
    return np.asarray(Rotation.from_matrix(np.column_stack([np.cross(y, z), y, z])).as_quat())


def of_reference(kind: str, reference: Reference) -> bytes:
    """The set-point of a reference of one vehicle: ``position``, ``velocity`` or ``full-state``."""
    place, yaw = reference.position_m[0], float(reference.yaw_rad[0])
    turn = 0.0 if reference.yaw_rate_rad_s is None else float(reference.yaw_rate_rad_s[0])
    if kind == "position":
        return position(place, yaw)
    if kind == "velocity":
        return velocity(reference.velocity_m_s[0], turn)
    if kind != "full-state":
        raise UsageError(f"a reference says nothing of {kind}; use position, velocity or full-state")
    pushed = reference.acceleration_m_s2[0]
    jerk = np.zeros(3) if reference.jerk_m_s3 is None else reference.jerk_m_s3[0]
    turning = body_rates(pushed[None], jerk[None], np.array([yaw]), np.array([turn]))[0]
    return full_state(place, reference.velocity_m_s[0], pushed, attitude_of(pushed, yaw), turning)


def of_record(record: np.void) -> bytes:
    """The set-point of a record of the firmware (``firmware.records.SETPOINT``): rates, velocity, full state, place."""
    modes = record["mode_x"], record["mode_roll"], record["mode_quat"]
    if modes[0] == ABSOLUTE and modes[2] == ABSOLUTE:
        return full_state(record["position_m"], record["velocity_m_s"], record["acceleration_m_s2"],
                          record["quaternion"], np.radians(record["rate_deg_s"]))
    if modes[0] == ABSOLUTE:
        return position(record["position_m"], np.radians(record["attitude_deg"][2]))
    if modes[0] == VELOCITY:
        return velocity(record["velocity_m_s"], np.radians(record["rate_deg_s"][2]))
    turning = np.radians(record["rate_deg_s"].astype(float)) * [1.0, -1.0, 1.0]  # records keep the legacy pitch
    return rates(float(record["thrust"]), turning)


def decoded(packet: bytes) -> dict[str, object]:
    """What a packet says, in SI and words: {kind, and its numbers}."""
    kind = packet[0]
    if kind == POSITION:
        _, x, y, z, yaw = _POSITION.unpack(packet)
        return {"kind": "position", "position_m": (x, y, z), "yaw_rad": float(np.radians(yaw))}
    if kind == VELOCITY_WORLD:
        _, x, y, z, turn = _VELOCITY.unpack(packet)
        return {"kind": "velocity", "velocity_m_s": (x, y, z), "yaw_rate_rad_s": float(np.radians(turn))}
    if kind == MANUAL:
        _, roll, pitch, yaw, thrust, rate = _MANUAL.unpack(packet)
        if not rate:
            return {"kind": "attitude", "thrust_counts": thrust, "attitude_rad": (np.radians(roll), np.radians(-pitch)),
                    "yaw_rate_rad_s": float(np.radians(yaw))}
        turning = tuple(float(v) for v in np.radians([roll, -pitch, yaw]))
        return {"kind": "thrust-rates", "thrust_counts": thrust, "rate_rad_s": turning}
    if kind == FULL_STATE:
        _, *numbers = _FULL.unpack(packet)
        parts = [tuple(v / 1000.0 for v in numbers[i:i + 3]) for i in (0, 3, 6, 10)]
        return {"kind": "full-state", "position_m": parts[0], "velocity_m_s": parts[1], "acceleration_m_s2": parts[2],
                "quaternion": tuple(decompressed(numbers[9])), "rate_rad_s": parts[3]}
    return {"kind": "stop"}


def in_words(packet: bytes) -> str:
    """One line for a person."""
    content = decoded(packet)
    names = {"position_m": "m", "velocity_m_s": "m/s", "acceleration_m_s2": "m/s²", "rate_rad_s": "rad/s"}
    parts = [str(content["kind"])]
    for name, unit in names.items():
        if name in content:
            parts.append("(" + " ".join(f"{v:+.3f}" for v in content[name]) + f") {unit}")  # type: ignore[attr-defined]
    if "thrust_counts" in content:
        parts.insert(1, f"{content['thrust_counts']} counts")
    if "yaw_rad" in content:
        parts.append(f"yaw {np.degrees(content['yaw_rad']):+.1f}°")  # type: ignore[call-overload]
    return " ".join(parts)
