"""Linear-quadratic regulator about the reference: one constant gain from the ``control`` package (discrete Riccati).

States of the error, in the frame of the reference's heading: integral of position, position, velocity, rotation
vector, body rate, thrust and moments.

Thrust and moments on their way through the motors are not measured but simulated from the commands given. Thrust,
attitude and rates that the reference itself needs are fed forward (differential flatness).
"""

from collections.abc import Mapping

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import UsageError, how_to_install
from nanobench_tools.firmware.flatness import body_rates
from nanobench_tools.firmware.guard import Guard
from nanobench_tools.firmware.motor_output import MotorOutput
from nanobench_tools.firmware.records import WRENCH
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number, setting

from .gains import Gain, around, whole
from .geometric import DRAG_1_S, THRUST_SCALE

PERIOD_S = 0.002
LAG_S = number("control.lqr.lag_s")
INTEGRAL, POSITION, VELOCITY, TURN, RATE = (slice(3 * k, 3 * k + 3) for k in range(5))
STATES, INPUTS = 19, 4

TOLERATED = setting("control.lqr.tolerated")
EFFORT = setting("control.lqr.effort")
LIMITS = setting("control.lqr.limits")
LEAST_LIFT = 0.1
"""Of g: minimum vertical thrust command, so that no vehicle is upside down."""


def model(vehicle: Vehicle, lag_s: float = LAG_S) -> tuple[np.ndarray, np.ndarray]:
    """A (19, 19) and B (19, 4) of the error in continuous time about hover; inputs thrust [N], moments [N m].
    ``lag_s``: of the motors."""
    a, b = np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS))
    eye = np.eye(3)
    a[INTEGRAL, POSITION] = a[POSITION, VELOCITY] = a[TURN, RATE] = eye
    a[VELOCITY, VELOCITY] = -np.diag(DRAG_1_S)
    g = vehicle.gravity_m_s2
    a[6, 10], a[7, 9] = g, -g
    a[8, 15] = 1.0 / vehicle.mass_kg
    a[RATE, 16:] = np.diag(1.0 / np.array(vehicle.inertia_kg_m2))
    a[15:, 15:] = -np.eye(4) / lag_s
    b[15:] = np.eye(4) / lag_s
    return a, b


TUNABLE = {
    "integral_m_s": around(TOLERATED[0], "m s"), "position_level_m": around(TOLERATED[3], "m"),
    "position_up_m": around(TOLERATED[5], "m"), "velocity_m_s": around(TOLERATED[6], "m/s"),
    "turn_rad": around(TOLERATED[9], "rad"), "rate_rad_s": around(TOLERATED[12], "rad/s"),
    "thrust_N": around(EFFORT[0], "N"), "moment_N_m": around(EFFORT[1], "N m")}


def weights(gains: Mapping[str, float] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(19,) errors that cost as much as each other and (4,) efforts, by the names of TUNABLE."""
    k = whole(TUNABLE, gains, "lqr")
    share = {name: value / TUNABLE[name].value for name, value in k.items()}
    errors = [share["integral_m_s"]] * 3 + [share["position_level_m"]] * 2 + [share["position_up_m"]] + [
        share["velocity_m_s"]] * 3 + [share["turn_rad"]] * 3 + [share["rate_rad_s"]] * 3 + [1.0] * 4
    efforts = [share["thrust_N"], *[share["moment_N_m"]] * 3]
    return np.array(TOLERATED) * errors, np.array(EFFORT) * efforts


def gain(vehicle: Vehicle, gains: Mapping[str, float] | None = None, lag_s: float = LAG_S) -> np.ndarray:
    """K (4, 19) of u = -K x at PERIOD_S. Raises UsageError without the ``control`` package."""
    try:
        import control
    except ImportError as error:
        raise UsageError(f"controller 'lqr' needs the package control; {how_to_install('control')}") from error
    a, b = model(vehicle, lag_s)
    system = control.c2d(control.ss(a, b, np.eye(STATES), 0.0), PERIOD_S)
    errors, efforts = weights(gains)
    costs = np.diag([*(1.0 / np.square(errors[:15])), *(1e-6,) * 4])
    return np.asarray(control.dlqr(system.A, system.B, costs, np.diag(1.0 / np.square(efforts)))[0])


class Lqr:
    """Linear-quadratic regulator: full references in, motor PWM out, at 500 Hz.

    Parameters
    ----------
    vehicle : Vehicle, optional
        Mass, inertia and motor positions, SI; default: the recorded vehicle.
    thrust_scale : float
        Thrust of the motors over that of the firmware's curve.
    gains : mapping, optional
        Values of the gains below, by name.
    lag_s : float
        Time constant of the motors, s.

    Attributes
    ----------
    guard : Guard
        Counts replaced measurements, references and commands.
    """

    name = "lqr"
    information = "preview"
    on_board = True
    period_s = PERIOD_S
    tunable: Mapping[str, Gain] = TUNABLE

    def __init__(self, vehicle: Vehicle | None = None, thrust_scale: float = THRUST_SCALE,
                 gains: Mapping[str, float] | None = None, lag_s: float = LAG_S) -> None:
        self.vehicle, self.thrust_scale, self.lag_s = vehicle or Vehicle(), thrust_scale, lag_s
        self._gain = gain(self.vehicle, gains, lag_s)

    def reset(self, n: int) -> None:
        self.guard = Guard(n, PERIOD_S)
        self._motors = MotorOutput(n, PERIOD_S)
        self._integral = np.zeros((n, 3))
        self._left = np.zeros((n, 4))
        self._wrench = np.zeros(n, WRENCH)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 for any input."""
        state, reference = self.guard.admit(state, reference)
        length_N, target, rate = self._wanted(reference)
        heading = np.stack([np.cos(reference.yaw_rad), np.sin(reference.yaw_rad)])
        away = _level(state.position_m - reference.position_m, heading)
        away = np.clip(away, -LIMITS[0], LIMITS[0])
        self._integral = np.clip(self._integral + PERIOD_S * away, -LIMITS[2], LIMITS[2])
        faster = np.clip(_level(state.velocity_m_s - reference.velocity_m_s, heading), -LIMITS[1], LIMITS[1])
        turn = so3.log(so3.multiply(so3.conjugate(target), state.quaternion))
        x = np.concatenate([self._integral, away, faster, turn, state.rate_rad_s - rate, self._left], axis=1)
        u = -x @ self._gain.T
        u[:, 0] = np.clip(u[:, 0], -length_N, 4.0 * length_N)
        self._left += PERIOD_S / self.lag_s * (u - self._left)
        self._wrench["thrust_N"] = (length_N + u[:, 0]) / self.thrust_scale
        self._wrench["torque_N_m"] = u[:, 1:] / self.thrust_scale
        return self.guard.release(self._motors(self._wrench, state.battery_V))

    def _wanted(self, reference: Reference) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Thrust [N] (n,), attitude (n, 4) and body rates (n, 3) that fly the reference, drag included."""
        c, s = np.cos(reference.yaw_rad), np.sin(reference.yaw_rad)
        push = reference.acceleration_m_s2 + reference.velocity_m_s * DRAG_1_S
        thrust = push + np.array([0.0, 0.0, self.vehicle.gravity_m_s2])
        thrust[:, 2] = np.maximum(thrust[:, 2], LEAST_LIFT * self.vehicle.gravity_m_s2)  # never upside down
        length = np.linalg.norm(thrust, axis=1)
        z = thrust / length[:, None]
        # roll and pitch that turn z along the thrust, yaw given
        pitch = np.arctan2(c * z[:, 0] + s * z[:, 1], z[:, 2])
        roll = np.arcsin(np.clip(s * z[:, 0] - c * z[:, 1], -1.0, 1.0))
        jerk, turn = reference.jerk_m_s3, reference.yaw_rate_rad_s
        rates = np.zeros_like(push) if jerk is None or turn is None else body_rates(push, jerk, reference.yaw_rad, turn)
        return self.vehicle.mass_kg * length, so3.from_euler_zyx(roll, pitch, reference.yaw_rad), rates


def _level(world: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of the world in the frame turned by the heading (cos, sin) (2, n)."""
    c, s = heading
    x, y, z = world.T
    return np.stack([c * x + s * y, c * y - s * x, z], axis=1)
