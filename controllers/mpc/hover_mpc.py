"""Predictive control about hover, small enough for the vehicle's own processor: one constant program, at 500 Hz.

The model is linearised once, at hover, in the frame of the reference's heading. Errors against the reference and their
integrals are the only parameters of the program, so its matrices are constants. Thrusts of all motors stay within what
the battery allows over the horizon. ``nanobench convert --to firmware-app`` writes the same controller as C.

References
----------
Bemporad, Morari, Dua, Pistikopoulos 2002, "The explicit linear quadratic regulator for constrained systems", Automatica
38(1), doi:10.1016/S0005-1098(01)00174-1.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.flatness import body_rates
from nanobench_tools.firmware.guard import REST_BATTERY_V, Guard
from nanobench_tools.firmware.motor_output import ARM_M, YAW_ARM_M, MotorOutput
from nanobench_tools.firmware.records import WRENCH
from nanobench_tools.firmware.thrust_curve import THRUST_MIN_N, thrust_of_voltage
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics.model import Model
from nanobench_tools.settings import number, setting

from .casadi_code import Call, import_casadi
from .condense import UNIT_N
from .dense_qp import Daqp
from .prediction_model import ERRORS, LEAST_LIFT, RIGID, Equations4, default_model, stages_function
from .predictive_base import Weights, about_hover
from .thrust_map import ThrustMap

PERIOD_S = 0.002
HORIZON: int = setting("control.hover_mpc.horizon")
STEP_S = number("control.hover_mpc.step_s")
ITERATIONS: int = setting("control.hover_mpc.iterations")
TOLERATED_INTEGRAL = setting("control.hover_mpc.tolerated_integral")
LIMITS = setting("control.hover_mpc.limits")
INTEGRALS, STATES = 4, ERRORS + 4
"""Integrals of position x, y, z [m s] and of heading [rad s], behind the errors of ``prediction_model``."""
LEAST_MARGIN = 1.01
"""So much more than the least thrust that the firmware gives: its mixer rounds to counts."""
MIXER = np.array([[1.0, 1.0, 1.0, 1.0], [-ARM_M, -ARM_M, ARM_M, ARM_M], [-ARM_M, ARM_M, ARM_M, -ARM_M],
                  [-YAW_ARM_M, YAW_ARM_M, -YAW_ARM_M, YAW_ARM_M]])
"""(4, 4): thrusts of motors -> what the firmware's force-torque mixer turns back into them, N and N m."""

LAYOUT = np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]])
"""Signs of x, y and spin of the firmware's motors."""


@dataclass(frozen=True)
class Program:
    """min 1/2 z'Hz + (F e)'z, motors within bounds, in z = (thrust - feed-forward) / UNIT_N of motors and stages.

    ``h`` (4 N, 4 N), ``f`` (4 N, STATES). ``free`` (4 N, STATES): z = free e without bounds.
    """

    h: np.ndarray
    f: np.ndarray
    free: np.ndarray

    def normalised(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As DAQP solves it: inverse of the upper Cholesky factor of H (4 N, 4 N), scale (4 N,) and scaled ``free``.

        The scale makes the rows of the inverse have length one.
        """
        inverse = solve_triangular(cholesky(self.h), np.eye(len(self.h)))
        scale = 1.0 / np.linalg.norm(inverse, axis=1)
        return inverse * scale[:, None], scale, self.free * scale[:, None]


@dataclass(frozen=True)
class HoverVehicle:
    """What the controller knows of a vehicle in addition to its program, in SI.

    ``drag_1_s`` (3,): drag over mass along the heading. ``air_N_s_m`` (4, 3): thrusts of the motors that balance the
    moment of an air velocity along the heading. ``thrust_scale``: thrust of the motors over that of the firmware's
    curve, at hover. ``position_1_s2``, ``velocity_1_s`` (3,): accelerations that answer errors without bounds.
    ``most_integral`` (4,): limits of the integrals, m s and rad s.
    """

    mass_kg: float
    gravity_m_s2: float
    drag_1_s: np.ndarray
    air_N_s_m: np.ndarray
    motor_tau_s: float
    thrust_scale: float
    position_1_s2: np.ndarray
    velocity_1_s: np.ndarray
    most_integral: np.ndarray

    @property
    def motor_share(self) -> float:
        """Of a command, what a rotor follows in a period."""
        return 1.0 if self.motor_tau_s == 0.0 else 1.0 - float(np.exp(-PERIOD_S / self.motor_tau_s))


def _hovering(model: Model, weights: Weights) -> tuple[Program, HoverVehicle]:
    """Both of a model without delay."""
    v = model.vehicle
    layout = np.column_stack([np.array(v.motor_positions_m)[:, :2], v.spin])
    if layout.shape != LAYOUT.shape or (np.sign(layout) != LAYOUT).any():
        raise InputError("model", "its motors are not in the order of the Crazyflie", "give front right, back right, "
                         "back left, front left, of which the first turns counter-clockwise (spin -1)")
    made, g = Equations4(model), v.gravity_m_s2
    hover_N = 0.25 * made.mass_kg * g
    a, b = about_hover(Call(stages_function(model, 1, STEP_S, ERRORS)), hover_N, ERRORS)
    slope = _through_air(made, hover_N)
    air = np.linalg.solve(made.mixing(), np.vstack([np.zeros(3), -slope[3:]]))
    volts = np.array([REST_BATTERY_V])
    ratio = ThrustMap(model).ratios(np.full((1, 4), hover_N), volts).mean()
    scale = hover_N / float(thrust_of_voltage(ratio * volts)[0])
    whole, inputs = np.eye(STATES), np.zeros((STATES, 4))
    whole[:ERRORS, :ERRORS], inputs[:ERRORS] = a, b
    for k, error in enumerate((0, 1, 2, 8)):
        whole[ERRORS + k, error] = STEP_S
    level, up, heading = TOLERATED_INTEGRAL
    q = np.diag([*weights.of_errors(ERRORS), *1.0 / np.square([level, level, up, heading])])
    program = _condensed(whole, inputs, q, weights.of_inputs(model))
    gain = -UNIT_N * program.free[:4]
    rotors = 0.25 * gain[:, RIGID:ERRORS].sum()  # they answer their own error, so less than the command stays
    about_y, lift = made.mixing()[2] @ gain, gain.sum(axis=0) / made.mass_kg / (1.0 + rotors)
    position, velocity, integral = (np.array([level, level, up]) for level, up in (
        (g * about_y[k] / about_y[7], lift[k + 2]) for k in (0, 3, ERRORS)))
    most = np.append(LIMITS[3] / integral, LIMITS[4])
    return program, HoverVehicle(made.mass_kg, g, -np.diag(slope), air, made.tau_s, scale, position, velocity, most)


def _through_air(made: Equations4, hover_N: float) -> np.ndarray:
    """(6, 3): acceleration and angular acceleration about hover per velocity, 1/s and rad/(m s)."""
    ca = import_casadi()
    v = ca.SX.sym("v", 3)
    hover = ca.vertcat(ca.SX.zeros(3), v, ca.SX([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    moved = made.body(hover, ca.SX([hover_N] * 4), ca.SX.zeros(6))
    return np.array(ca.Function("air", [v], [ca.jacobian(ca.vertcat(moved[3:6], moved[10:13]), v)])(0.0))


def _condensed(a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray) -> Program:
    """a (S, S), b (S, 4), q (S, S), r (4, 4); the end costs what all that follows would (Riccati)."""
    p = solve_discrete_are(a, b, q + 1e-9 * np.eye(len(q)), r)
    wide = 4 * HORIZON
    moved, reached = np.eye(len(a)), np.zeros((len(a), wide))
    h, f = np.kron(np.eye(HORIZON), r) * UNIT_N**2, np.zeros((wide, len(a)))
    for k in range(HORIZON):
        moved, reached = a @ moved, a @ reached
        reached[:, 4 * k:4 * k + 4] = UNIT_N * b
        cost = q if k < HORIZON - 1 else p
        h, f = h + reached.T @ cost @ reached, f + reached.T @ cost @ moved
    return Program(h, f, -np.linalg.solve(h, f))


class HoverMpc:
    """Predictive control about hover: full references in, motor PWM out, at 500 Hz.

    Parameters
    ----------
    model : Model, optional
        Simulator of four motors with PWM input; default: the shipped vehicle.
    weights : Weights, optional
        Errors of equal cost.

    Attributes
    ----------
    thrust_N : ndarray
        (n, 4) N, the last thrusts of the motors.
    guard : Guard
        Counts replaced inputs.
    counts : dict
        Commands whose program met a bound (``bounded``), and those beyond ITERATIONS (``solver``). The latter are the
        answer without bounds, clipped.

    Raises
    ------
    InputError
        For a model whose input is not PWM.
    """

    name = "mpc_hover"
    information = "preview"
    on_board = True
    period_s = PERIOD_S

    def __init__(self, model: Model | None = None, weights: Weights | None = None) -> None:
        model = model or default_model()
        self.model = model.without("command_delay") if "command_delay" in model else model
        self._solver = Daqp(ITERATIONS)
        self.program, self.vehicle = _hovering(self.model, weights or Weights())

    def reset(self, n: int) -> None:
        self.guard = Guard(n, PERIOD_S)
        self.counts = {"bounded": 0, "solver": 0}
        self._motors = MotorOutput(n, PERIOD_S)
        self._integral = np.zeros((n, INTEGRALS))
        self._rotor_N = np.full((n, 4), 0.25 * self.vehicle.mass_kg * self.vehicle.gravity_m_s2)
        self._wrench = np.zeros(n, WRENCH)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 for any input."""
        state, reference = self.guard.admit(state, reference)
        v = self.vehicle
        forward_N, target, rate = self._wanted(reference)
        e = self._errors(state, reference, target, rate, forward_N)
        bounds = np.stack([np.full(len(e), LEAST_MARGIN * THRUST_MIN_N), thrust_of_voltage(self._motors.filtered_V)])
        bounds = (v.thrust_scale * bounds[:, :, None] - forward_N) / UNIT_N
        self.thrust_N = forward_N + UNIT_N * np.stack([self._solve(e[i], *bounds[:, i]) for i in range(len(e))])
        self._rotor_N += v.motor_share * (self.thrust_N - self._rotor_N)
        wrench = self.thrust_N / v.thrust_scale @ MIXER.T
        self._wrench["thrust_N"], self._wrench["torque_N_m"] = wrench[:, 0], wrench[:, 1:]
        return self.guard.release(self._motors(self._wrench, state.battery_V))

    def _errors(self, state: VehicleState, reference: Reference, target: np.ndarray, rate: np.ndarray,
                forward_N: np.ndarray) -> np.ndarray:
        """(n, STATES), after the integrals have taken in those of now."""
        v = self.vehicle
        level_m_s2, up_m_s2, turned_rad = LIMITS[:3]
        away, faster = state.position_m - reference.position_m, state.velocity_m_s - reference.velocity_m_s
        pull = v.position_1_s2 * away + v.velocity_1_s * faster
        share = level_m_s2 / np.maximum(np.hypot(pull[:, 0], pull[:, 1]), level_m_s2)
        part = np.column_stack([share, share, up_m_s2 / np.maximum(np.abs(pull[:, 2]), up_m_s2)])
        away, faster = part * away, part * faster
        q = so3.multiply(so3.conjugate(target), state.quaternion)
        turn = np.clip(2.0 * np.where(q[:, 3:] < 0.0, -1.0, 1.0) * q[:, :3], -turned_rad, turned_rad)
        free = np.column_stack([part == 1.0, np.ones(len(part))])  # no windup
        self._integral += PERIOD_S * free * np.column_stack([away, turn[:, 2]])
        self._integral = np.clip(self._integral, -v.most_integral, v.most_integral)
        yaw = reference.yaw_rad
        return np.column_stack([_level(away, yaw), _level(faster, yaw), turn, state.rate_rad_s - rate,
                                self._rotor_N - forward_N, _level(self._integral[:, :3], yaw),
                                self._integral[:, 3]])

    def _solve(self, e: np.ndarray, least: np.ndarray, most: np.ndarray) -> np.ndarray:
        """z (4,) of the first stage; least and most (4,) of every stage."""
        z = self.program.free @ e
        low, high = np.tile(least, HORIZON), np.tile(most, HORIZON)
        if (z >= low).all() and (z <= high).all():
            return np.asarray(z[:4])
        self.counts["bounded"] += 1
        found = self._solver(self.program.h, self.program.f @ e, low, high)
        if found is None:
            self.counts["solver"] += 1
            found = np.clip(z, low, high)
        return found[:4]

    def _wanted(self, reference: Reference) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Thrusts [N] (n, 4), attitude (n, 4) and body rates (n, 3) that fly the reference against the air."""
        v, yaw = self.vehicle, reference.yaw_rad
        speed = _level(reference.velocity_m_s, yaw)
        push = _level(reference.acceleration_m_s2, yaw) + v.drag_1_s * speed
        push[:, 2] = np.maximum(push[:, 2] + v.gravity_m_s2, LEAST_LIFT * v.gravity_m_s2)  # never upside down
        length = np.linalg.norm(push, axis=1)
        roll, pitch = np.arcsin(-push[:, 1] / length), np.arctan2(push[:, 0], push[:, 2])
        jerk, turn = reference.jerk_m_s3, reference.yaw_rate_rad_s
        rates = np.zeros_like(push) if jerk is None or turn is None else body_rates(
            reference.acceleration_m_s2, jerk, yaw, turn)
        thrust_N = 0.25 * v.mass_kg * length[:, None] + speed @ v.air_N_s_m.T
        return thrust_N, so3.from_euler_zyx(roll, pitch, yaw), rates


def _level(world: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of the world in the frame of headings (n,)."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = world.T
    return np.stack([c * x + s * y, c * y - s * x, z], axis=1)
