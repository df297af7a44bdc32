"""Set-points as they come over the radio -> SETPOINT records (crtp_commander_rpyt.c, crtp_commander_generic.c)."""

import math
import struct
from dataclasses import dataclass

import numpy as np

from ...firmware.records import ABSOLUTE, DISABLED, SETPOINT, VELOCITY
from .quaternion32 import decompress

RATE, ANGLE = 0, 1
"""Values of ``flightmode.stabModeRoll`` and its like."""
LEAST_THRUST, MOST_THRUST = 1000, 60000
_RPYT = struct.Struct("<fffH")
_FULL_STATE = struct.Struct("<9hI3h")
(STOP, VELOCITY_LEGACY, Z_DISTANCE_LEGACY, CPPM, ALT_HOLD, HOVER_LEGACY, FULL_STATE, POSITION, VELOCITY_WORLD,
 Z_DISTANCE, HOVER, MANUAL) = range(12)
_CPPM_ANGLE_DEG, _CPPM_RATE_DEG_S, _CPPM_YAW_DEG_S = 50.0, 720.0, 400.0


@dataclass
class FlightMode:
    """Group ``flightmode``: what roll, pitch, yaw and thrust mean."""

    althold: int = 0
    poshold: int = 0
    posSet: int = 0
    yawMode: int = 2
    stabModeRoll: int = ANGLE
    stabModePitch: int = ANGLE
    stabModeYaw: int = RATE


class RollPitchYawThrust:
    """Port 3. What earlier packets set and this one does not stays (``last``); thrust is locked until 0 is sent."""

    def __init__(self) -> None:
        self.mode, self.locked = FlightMode(), True
        self.last = np.zeros(1, SETPOINT)

    def read(self, data: bytes) -> np.ndarray | None:
        """The set-point (1,) in a packet's data; None for what is none."""
        if len(data) != _RPYT.size:
            return None
        roll, pitch, yaw, thrust = _RPYT.unpack(data)
        if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
            return None
        if thrust == 0:
            self.locked = False
        s, mode = self.last[0], self.mode
        s["thrust"] = 0 if self.locked or thrust < LEAST_THRUST else min(thrust, MOST_THRUST)
        s["mode_z"] = DISABLED
        if mode.althold:
            s["thrust"], s["mode_z"] = 0, VELOCITY
            s["velocity_m_s"][2] = (thrust - 32767.0) / 32767.0
        if mode.poshold:
            s["mode_x"] = s["mode_y"] = VELOCITY
            s["mode_roll"] = s["mode_pitch"] = DISABLED
            s["velocity_m_s"][:2], s["attitude_deg"][:2] = (pitch / 30.0, roll / 30.0), 0.0
        elif mode.posSet and thrust:
            s["mode_x"] = s["mode_y"] = s["mode_z"] = s["mode_yaw"] = ABSOLUTE
            s["mode_roll"] = s["mode_pitch"] = DISABLED
            s["position_m"], s["attitude_deg"], s["thrust"] = (-pitch, roll, thrust / 1000.0), (0.0, 0.0, yaw), 0
        else:
            s["mode_x"] = s["mode_y"] = DISABLED
            s["velocity_m_s"][:2] = 0.0
            for k, (name, commanded) in enumerate((("mode_roll", roll), ("mode_pitch", pitch))):
                rate = (mode.stabModeRoll, mode.stabModePitch)[k] == RATE
                s[name] = VELOCITY if rate else ABSOLUTE
                s["rate_deg_s"][k], s["attitude_deg"][k] = (commanded, 0.0) if rate else (0.0, commanded)
        if not mode.posSet:
            rate = mode.stabModeYaw == RATE
            s["mode_yaw"] = VELOCITY if rate else ABSOLUTE
            s["rate_deg_s"][2], s["attitude_deg"][2] = (-yaw, 0.0) if rate else (0.0, yaw)
        return self.last


def generic(data: bytes) -> np.ndarray | None:
    """The set-point (1,) in a packet on port 7, channel 0; None for one that is broken. A type that is not known gives
    the null set-point, as in the firmware."""
    made = np.zeros(1, SETPOINT)
    s, kind, rest = made[0], data[0] if data else -1, data[1:]
    if kind < 0:
        return None
    if kind == FULL_STATE:
        return made if _full_state(s, rest) else None
    if kind == MANUAL:
        return made if _manual(s, rest) else None
    if kind == CPPM:
        return made if _cppm(s, rest) else None
    if kind == STOP or kind > MANUAL:
        return made
    if len(rest) != 16:
        return None
    a, b, c, d = struct.unpack("<4f", rest)
    if not all(math.isfinite(v) for v in (a, b, c, d)):
        return None
    if kind == POSITION:
        s["mode_x"] = s["mode_y"] = s["mode_z"] = s["mode_yaw"] = ABSOLUTE
        s["position_m"], s["attitude_deg"][2] = (a, b, c), d
        return made
    s["mode_yaw"] = VELOCITY
    if kind in (VELOCITY_LEGACY, VELOCITY_WORLD):
        s["mode_x"] = s["mode_y"] = s["mode_z"] = VELOCITY
        s["velocity_m_s"] = (a, b, c)
        s["rate_deg_s"][2] = d if kind == VELOCITY_WORLD else -d
    elif kind in (HOVER_LEGACY, HOVER):
        s["mode_x"] = s["mode_y"] = VELOCITY
        s["mode_z"], s["velocity_body"] = ABSOLUTE, 1
        s["velocity_m_s"][:2], s["position_m"][2] = (a, b), d
        s["rate_deg_s"][2] = c if kind == HOVER else -c
    else:
        s["mode_roll"] = s["mode_pitch"] = ABSOLUTE
        s["attitude_deg"][:2] = (a, b)
        s["rate_deg_s"][2] = -c if kind == Z_DISTANCE_LEGACY else c
        if kind == ALT_HOLD:
            s["mode_z"], s["velocity_m_s"][2] = VELOCITY, d
        else:
            s["mode_z"], s["position_m"][2] = ABSOLUTE, d
    return made


def _full_state(s: np.ndarray, data: bytes) -> bool:
    """mm, mm/s, mm/s^2, compressed quaternion, mrad/s."""
    if len(data) != _FULL_STATE.size:
        return False
    v = _FULL_STATE.unpack(data)
    s["mode_x"] = s["mode_y"] = s["mode_z"] = s["mode_quat"] = ABSOLUTE
    s["position_m"], s["velocity_m_s"] = np.array(v[0:3]) / 1000.0, np.array(v[3:6]) / 1000.0
    s["acceleration_m_s2"], s["quaternion"] = np.array(v[6:9]) / 1000.0, decompress(v[9])
    s["rate_deg_s"] = np.degrees(np.array(v[10:13]) / 1000.0)
    return True


def _manual(s: np.ndarray, data: bytes) -> bool:
    """Roll and pitch as angles or rates, yaw rate, thrust without a lock."""
    if len(data) != 15:
        return False
    roll, pitch, yaw, thrust, rate = struct.unpack("<fffHB", data)
    if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
        return False
    s["mode_roll"] = s["mode_pitch"] = VELOCITY if rate else ABSOLUTE
    s["rate_deg_s" if rate else "attitude_deg"][:2] = (roll, pitch)
    s["mode_yaw"], s["rate_deg_s"][2], s["thrust"] = VELOCITY, yaw, thrust
    return True


def _cppm(s: np.ndarray, data: bytes) -> bool:
    """Channels 1000..2000 of a remote control; the first auxiliary one low: rates instead of angles."""
    if len(data) < 9 or len(data) != 9 + 2 * (data[0] & 0x0F):
        return False
    roll, pitch, yaw, thrust, *more = struct.unpack(f"<{(len(data) - 1) // 2}H", data[1:])
    level = not more or more[0] >= 1500
    s["mode_roll"] = s["mode_pitch"] = ABSOLUTE if level else VELOCITY
    scale = _CPPM_ANGLE_DEG if level else _CPPM_RATE_DEG_S
    s["attitude_deg" if level else "rate_deg_s"][:2] = [-(x - 1500.0) / 500.0 * scale for x in (roll, pitch)]
    s["mode_yaw"], s["rate_deg_s"][2] = VELOCITY, -(yaw - 1500.0) / 500.0 * _CPPM_YAW_DEG_S
    s["thrust"] = max((thrust - 1000.0) / 1000.0 * 65535.0, 0.0)
    return True
