"""The log variables of the simulated Crazyflie: names, types and units of the firmware, read from the loop's records.

Legacy pitch is nose up, ``ctrltarget.yaw`` is a rate, and only the PID writes group ``controller``. The value of
``cmd_thrust`` is that of the loop before.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...firmware.stabilizer import Stabilizer
from .log import LogVariable
from .quaternion32 import compress

XYZ = ("x", "y", "z")
RPY = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")


def _one(field: np.ndarray, *index: int) -> Callable[[], float]:
    """Reads one number (index) of a field (1, ...) of a record that goes on living."""
    place: Any = (slice(0, 1), *index)
    found: Callable[[], float] = field[place].item
    return found


def _each(group: str, names: Sequence[str], field: np.ndarray, kind: str = "f4") -> dict[str, LogVariable]:
    """Components of a field (1, k) as group.name."""
    return {f"{group}.{name}": LogVariable(kind, _one(field, i)) for i, name in enumerate(names)}


def stabilizer_variables(s: Stabilizer) -> dict[str, LogVariable]:
    """What the firmware's loop, its controllers and its filter show."""
    loop, estimate, setpoint, pid = s.loop, s.loop["estimate"], s.setpoint, s.states[0]
    core = s.task["core"]
    found = {
        **_each("acc", XYZ, loop["acc_g"]), **_each("gyro", XYZ, loop["gyro_deg_s"]),
        **_each("stateEstimate", XYZ, estimate["position_m"]),
        **_each("stateEstimate", ("vx", "vy", "vz"), estimate["velocity_m_s"]),
        **_each("stateEstimate", ("ax", "ay", "az"), loop["acceleration_g"]),
        **_each("stateEstimate", RPY, estimate["attitude_deg"]),
        **_each("stateEstimate", QUATERNION, estimate["quaternion"]),
        **_each("stabilizer", RPY, estimate["attitude_deg"]),
        **_each("ctrltarget", XYZ, setpoint["position_m"]),
        **_each("ctrltarget", ("vx", "vy", "vz"), setpoint["velocity_m_s"]),
        **_each("ctrltarget", ("ax", "ay", "az"), setpoint["acceleration_m_s2"]),
        **_each("ctrltarget", ("roll", "pitch"), setpoint["attitude_deg"]),
        "ctrltarget.yaw": LogVariable("f4", _one(setpoint["rate_deg_s"], 2)),
        **_each("controller", RPY, pid["attitude_deg"]),
        **_each("controller", ("rollRate", "pitchRate", "yawRate"), pid["rate_deg_s"]),
        "controller.cmd_thrust": LogVariable("f4", _one(loop["cmd_thrust"])),
        "controller.cmd_roll": LogVariable("f4", _one(pid["roll"])),
        "controller.cmd_pitch": LogVariable("f4", _one(pid["pitch"])),
        "controller.cmd_yaw": LogVariable("f4", _one(pid["yaw"])),
        "controller.actuatorThrust": LogVariable("f4", _one(pid["thrust"])),
        "controller.ctr_yaw": LogVariable("i2", _one(loop["control"]["yaw"])),
        "stabilizer.thrust": LogVariable("f4", _one(loop["control"]["thrust"])),
        **_each("motor", ("m1", "m2", "m3", "m4"), loop["motor"], "u2"),
        **_each("motor", ("m1req", "m2req", "m3req", "m4req"), loop["request"], "i4"),
        **_each("pwm", ("m1_pwm", "m2_pwm", "m3_pwm", "m4_pwm"), loop["motor"], "u4"),
        "pm.vbat": LogVariable("f4", _one(loop["vbat_V"])),
        "pm.vbatMV": LogVariable("u2", _scaled(loop["vbat_V"], 1000.0)),
        "pm.batteryLevel": LogVariable("u1", lambda: min(max(100.0 * (loop["vbat_V"][0] - 3.0) / 1.2, 0.0), 100.0)),
        "pm.state": LogVariable("i1", lambda: 3.0 if loop["vbat_V"][0] < 3.2 else 0.0),
        **_each("kalman", ("stateX", "stateY", "stateZ", "statePX", "statePY", "statePZ", "stateD0", "stateD1",
                           "stateD2"), core["state"]),
        **_each("kalman", ("q0", "q1", "q2", "q3"), core["quaternion"]),
        **{f"kalman.var{name}": LogVariable("f4", _one(core["covariance"], i, i))
           for i, name in enumerate(("X", "Y", "Z", "PX", "PY", "PZ", "D0", "D1", "D2"))},
        **_mellinger(s), **_position_control(s), **_compressed(s),
        "sys.armed": LogVariable("u1", _one(loop["allowed"])),
    }
    return found


def _scaled(field: np.ndarray, scale: float, *index: int) -> Callable[[], float]:
    read = _one(field, *index)
    return lambda: read() * scale


def _mellinger(s: Stabilizer) -> dict[str, LogVariable]:
    state = s.states[1]
    return {"ctrlMel.cmd_thrust": LogVariable("f4", _one(state["thrust"])),
            "ctrlMel.cmd_roll": LogVariable("f4", _one(state["roll"])),
            "ctrlMel.cmd_pitch": LogVariable("f4", _one(state["pitch"])),
            "ctrlMel.cmd_yaw": LogVariable("f4", _one(state["yaw"])),
            "ctrlMel.zdx": LogVariable("f4", _one(state["z_wanted"], 0)),
            "ctrlMel.zdy": LogVariable("f4", _one(state["z_wanted"], 1)),
            "ctrlMel.zdz": LogVariable("f4", _one(state["z_wanted"], 2)),
            "ctrlMel.i_err_x": LogVariable("f4", _one(state["integral"], 0)),
            "ctrlMel.i_err_y": LogVariable("f4", _one(state["integral"], 1)),
            "ctrlMel.i_err_z": LogVariable("f4", _one(state["integral"], 2))}


def _position_control(s: Stabilizer) -> dict[str, LogVariable]:
    wanted, target = s.states[0]["velocity_setpoint"], s.setpoint["position_m"]
    return {**_each("posCtl", ("targetVX", "targetVY", "targetVZ"), wanted),
            **_each("posCtl", ("targetX", "targetY", "targetZ"), target)}


def _compressed(s: Stabilizer) -> dict[str, LogVariable]:
    """Group ``stateEstimateZ``: mm, mm/s, mm/s^2 with gravity in z, mrad/s, the quaternion in 32 bits."""
    e, loop = s.loop["estimate"], s.loop
    to_mrad = 1000.0 * math.pi / 180.0
    found = {f"stateEstimateZ.{name}": LogVariable("i2", _scaled(e["position_m"], 1000.0, i))
             for i, name in enumerate(XYZ)}
    found |= {f"stateEstimateZ.v{name}": LogVariable("i2", _scaled(e["velocity_m_s"], 1000.0, i))
              for i, name in enumerate(XYZ)}
    found |= {f"stateEstimateZ.a{name}": LogVariable("i2", _scaled(loop["acceleration_g"], 9810.0, i))
              for i, name in enumerate("xy")}
    up = _one(loop["acceleration_g"], 2)
    rates = [(name, _scaled(loop["gyro_deg_s"], sign * to_mrad, i))
             for i, (name, sign) in enumerate((("rateRoll", 1.0), ("ratePitch", -1.0), ("rateYaw", 1.0)))]
    return {**found, "stateEstimateZ.az": LogVariable("i2", lambda: (up() + 1.0) * 9810.0),
            "stateEstimateZ.quat": LogVariable("u4", lambda: compress(e["quaternion"][0].tolist())),
            **{f"stateEstimateZ.{name}": LogVariable("i2", read) for name, read in rates}}
