"""The parameters of the simulated Crazyflie: names, types and defaults of the firmware, kept in the loop's records."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...firmware import mellinger
from ...firmware.pid import GAINS
from ...firmware.stabilizer import LEE, MELLINGER, PID, Stabilizer
from .params import Parameter

_PID_GROUPS = (("posCtlPid", ("x", "y", "z"), 0), ("velCtlPid", ("vx", "vy", "vz"), 3),
               ("pid_attitude", ("roll", "pitch", "yaw"), 6), ("pid_rate", ("roll", "pitch", "yaw"), 9))
_KALMAN = {"pNAcc_xy": "acc_xy_m_s2", "pNAcc_z": "acc_z_m_s2", "pNVel": "velocity_m_s", "pNPos": "position_m",
           "pNAtt": "attitude_rad", "mNGyro_rollpitch": "gyro_tilt_rad_s", "mNGyro_yaw": "gyro_yaw_rad_s",
           "initialYaw": "initial_yaw_rad", "maxPos": "max_position_m", "maxVel": "max_velocity_m_s"}
_LEE = {"Kpos_P": "kp_1_s2", "Kpos_D": "kd_1_s", "Kpos_I": "ki_1_s3", "KR_": "k_rotation_N_m", "Kw_": "k_rate_N_m_s",
        "KI_": "k_integral_N_m_s"}


def number(field: np.ndarray, *index: int, kind: str = "f4", persistent: bool = False) -> Parameter:
    """One number (index) of a field (1, ...) of a record that goes on living."""
    where: Any = (slice(0, 1), *index)
    place = field[where]

    def write(value: float) -> None:
        place[0] = value

    return Parameter(kind, place.item, write, persistent)


def attribute(owner: Any, name: str, kind: str, persistent: bool = False,
              then: Callable[[float], None] | None = None) -> Parameter:
    """An attribute of an object; ``then`` receives a new value."""

    def write(value: float) -> None:
        setattr(owner, name, value)
        if then is not None:
            then(value)

    return Parameter(kind, lambda: getattr(owner, name), write, persistent)


def constant(value: float, kind: str) -> Parameter:
    """Read only."""
    return Parameter(kind, lambda: value)


def stabilizer_parameters(s: Stabilizer) -> dict[str, Parameter]:
    """Gains of the three controllers, of the filter, direct motor control."""
    found: dict[str, Parameter] = {}
    for group, axes, first in _PID_GROUPS:
        for i, axis in enumerate(axes):
            for gain in ("kp", "ki", "kd", "kff"):
                name = f"{axis}{gain.capitalize()}" if group.endswith("CtlPid") else f"{axis}_{gain}"
                found[f"{group}.{name}"] = number(s.gains[0]["block"], first + i, GAINS.index(gain), persistent=True)
    found["posCtlPid.thrustBase"] = number(s.gains[0]["thrust_base"], kind="u2", persistent=True)
    found["posCtlPid.thrustMin"] = number(s.gains[0]["thrust_min"], kind="u2", persistent=True)
    found["posCtlPid.rLimit"] = found["posCtlPid.pLimit"] = number(s.gains[0]["tilt_limit_deg"], persistent=True)
    for name in ("xVelMax", "yVelMax", "zVelMax"):
        found[f"posCtlPid.{name}"] = _speed_limit(s, "xyz".index(name[0]))
    found["pid_attitude.yawMaxDelta"] = number(s.gains[0]["yaw_max_delta_deg"], persistent=True)
    for name in mellinger.PARAMETERS.names or ():
        found[f"ctrlMel.{name}"] = number(s.gains[1][name])
    for prefix, name in _LEE.items():
        for i, axis in enumerate("xyz"):
            found[f"ctrlLee.{prefix}{axis}"] = number(s.gains[2][name], i)
    found["ctrlLee.mass"] = number(s.gains[2]["mass_kg"])
    for own, name in _KALMAN.items():
        found[f"kalman.{own}"] = number(s.kalman[name])
    for i, axis in enumerate("XYZ"):
        found[f"kalman.initial{axis}"] = number(s.kalman["initial_m"], i)
    found["kalman.resetEstimation"] = number(s.task["reset"], kind="u1")
    found["motorPowerSet.enable"] = number(s.loop["override"], kind="u1")
    for i in range(4):
        found[f"motorPowerSet.m{i + 1}"] = number(s.loop["direct"], i, kind="u2")
    return found


def _speed_limit(s: Stabilizer, axis: int) -> Parameter:
    """Largest speed that the position loop asks for; the loop's own limit is a tenth more."""
    limit = s.gains[0]["block"][0, axis, GAINS.index("output_limit"):GAINS.index("output_limit") + 1]

    def write(value: float) -> None:
        limit[0] = 1.1 * value

    return Parameter("f4", lambda: limit.item() / 1.1, write, True)


CONTROLLERS = {0: PID, 1: PID, 2: MELLINGER, 5: LEE}
"""Values of ``stabilizer.controller`` and who then flies."""


class Selection:
    """Group ``stabilizer``: who estimates and who flies, and the emergency stop."""

    def __init__(self, s: Stabilizer, say: Callable[[str], None], stop: Callable[[], None]) -> None:
        self._stabilizer, self._say, self._stop = s, say, stop
        self.controller, self.estimator, self.stopped = 0, 2, 0

    def parameters(self) -> dict[str, Parameter]:
        """Of the group."""
        return {"stabilizer.estimator": attribute(self, "estimator", "u1", False, self._only_kalman),
                "stabilizer.controller": Parameter("u1", lambda: self.controller, self._choose),
                "stabilizer.stop": attribute(self, "stopped", "u1", False, lambda v: self._stop() if v else None)}

    def _choose(self, value: float) -> None:
        if int(value) not in CONTROLLERS:
            self._say(f"CONTROLLER: {int(value)} is not simulated, PID flies")
            value = PID
        chosen = CONTROLLERS[int(value)]
        self.controller = int(value)
        if chosen != self._stabilizer.loop["controller"][0]:
            self._stabilizer.choose(chosen)

    def _only_kalman(self, value: float) -> None:
        if int(value) not in (0, 2):
            self._say(f"ESTIMATOR: {int(value)} is not simulated, Kalman (2) estimates")
        self.estimator = 2
