"""The firmware's controllers behind the Controller Protocol: SI states and references in, motor PWM ratios out."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numba as nb
import numpy as np

from ..methods import Reference, VehicleState
from ..units import PWM_FULL_SCALE
from . import lee, mellinger, pid
from .flatness import body_rates
from .guard import Guard
from .motor_output import MotorOutput
from .records import ABSOLUTE, CONTROL, ESTIMATE, SETPOINT, WRENCH

DEGREES = 180.0 / math.pi
PERIOD_S = 0.002
STEPS = 2
"""Steps of the 1 kHz loop in a period: controllers are run at even ones, where the attitude loops are."""


@dataclass(frozen=True)
class ControllerLog:
    """What the log group ``controller`` shows: desired roll, pitch, yaw (n, 3) rad FLU, cmd_thrust (n,) ratio.

    written (n,) bool: vehicles whose controller fills the group at all.
    """

    attitude_rad: np.ndarray
    cmd_thrust: np.ndarray
    written: np.ndarray


def estimates(state: VehicleState, out: np.ndarray) -> None:
    """Writes n states into out (n,) ESTIMATE."""
    _estimates(state.position_m, state.velocity_m_s, state.quaternion, state.rate_rad_s, out)


@nb.njit(cache=True)
def _estimates(position_m: np.ndarray, velocity_m_s: np.ndarray, quaternion: np.ndarray, rate_rad_s: np.ndarray,
               out: np.ndarray) -> None:
    """Angles are those of ``so3.euler_zyx``, with the sign of the firmware's pitch."""
    for i in range(len(out)):
        record = out[i]
        x, y, z, w = quaternion[i]
        norm = x * x + y * y + z * z + w * w
        sine = min(max(2.0 * (w * y - z * x) / norm, -1.0), 1.0)
        record.attitude_deg[0] = DEGREES * math.atan2(2.0 * (w * x + y * z), norm - 2.0 * (x * x + y * y))
        record.attitude_deg[1] = -DEGREES * math.asin(sine)
        record.attitude_deg[2] = DEGREES * math.atan2(2.0 * (w * z + x * y), norm - 2.0 * (y * y + z * z))
        for k in range(3):
            record.position_m[k] = position_m[i, k]
            record.velocity_m_s[k] = velocity_m_s[i, k]
            record.gyro_deg_s[k] = DEGREES * rate_rad_s[i, k]
        for k in range(4):
            record.quaternion[k] = quaternion[i, k]


def setpoints(reference: Reference, out: np.ndarray) -> None:
    """Writes n references into out (n,) SETPOINT, absolute in place and yaw; jerk becomes body rates."""
    for mode in ("mode_x", "mode_y", "mode_z", "mode_yaw"):
        out[mode] = ABSOLUTE
    out["attitude_deg"][:, 2] = np.degrees(reference.yaw_rad)
    out["position_m"], out["velocity_m_s"] = reference.position_m, reference.velocity_m_s
    out["acceleration_m_s2"] = reference.acceleration_m_s2
    jerk, turn = reference.jerk_m_s3, reference.yaw_rate_rad_s
    if jerk is None or turn is None:
        return
    out["jerk_m_s3"], out["rate_deg_s"] = jerk, 0.0
    if jerk.any() or turn.any():
        out["rate_deg_s"] = np.degrees(body_rates(reference.acceleration_m_s2, jerk, reference.yaw_rad, turn))


class Onboard:
    """A controller of the firmware for n vehicles. ``parameters``: (1,) for all or (n,), by default as released.

    Like the firmware it counts its own steps and does not look at the time. ``guard`` counts what was replaced.
    """

    information = "as flown"
    period_s = PERIOD_S
    _run: Callable[..., None]
    _state: np.dtype
    _output: np.dtype = CONTROL
    _defaults: Callable[..., np.ndarray]

    def __init__(self, parameters: np.ndarray | None = None) -> None:
        self.parameters = type(self)._defaults() if parameters is None else parameters

    def reset(self, n: int) -> None:
        self.state = np.zeros(n, self._state)
        self.guard = Guard(n, PERIOD_S)
        self._motors = MotorOutput(n, PERIOD_S)
        self._step = 0
        self._setpoint, self._estimate = np.zeros((1, n), SETPOINT), np.zeros((1, n), ESTIMATE)
        self._control = np.zeros((1, n), self._output)
        self._no_trace = np.zeros((0, n), self._state)

    def drive_with(self, motors: MotorOutput) -> None:
        """Other motors after ``reset``: of another build, or with a voltage filtered already."""
        self._motors = motors

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 for any input."""
        state, reference = self.guard.admit(state, reference)
        estimates(state, self._estimate[0])
        setpoints(reference, self._setpoint[0])
        self._step += STEPS
        type(self)._run(np.array([self._step]), self.parameters, self.state, self._setpoint, self._estimate,
                        self._control, self._no_trace)
        return self.guard.release(self._drive(self._control[0], state.battery_V))

    def _drive(self, control: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        return self._motors(control, battery_V)

    @property
    def log(self) -> ControllerLog:
        """Nothing: only the PID cascade writes the group."""
        n = len(self.state)
        return ControllerLog(np.zeros((n, 3)), np.zeros(n), np.zeros(n, dtype=bool))


class PidCascade(Onboard):
    """Position -> velocity -> attitude -> rate -> motors. Uses position and yaw setpoints only."""

    name = "pid"
    _run, _defaults, _state = staticmethod(pid.run_steps), staticmethod(pid.defaults), pid.STATE

    @property
    def log(self) -> ControllerLog:
        """What the last command wanted."""
        angles = np.radians(self.state["attitude_deg"].astype(float)) * [1.0, -1.0, 1.0]
        return ControllerLog(angles, self.state["thrust"] / PWM_FULL_SCALE, np.ones(len(angles), dtype=bool))


class Mellinger(Onboard):
    """Force from position and velocity errors, attitude by rotation error. Believes in 0.029 kg: it hangs low.

    From references with derivatives it takes velocity, acceleration and rates.
    """

    name = "mellinger"
    _run, _defaults, _state = staticmethod(mellinger.run_steps), staticmethod(mellinger.defaults), mellinger.STATE


class Lee(Onboard):
    """The geometric controller as released; it was not flown in the recordings."""

    name = "lee"
    information = "preview"
    _run, _defaults, _state = staticmethod(lee.run_steps), staticmethod(lee.defaults), lee.STATE
    _output = WRENCH


