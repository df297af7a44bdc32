"""The vehicle as predictive controllers see it: thrusts asked of the motors in, the terms of a model inside.

State x (17): position m, velocity m/s (world), quaternion x, y, z, w, body rate rad/s, thrust of each rotor N.
Input u (4): thrust commanded of each motor N, after the thrust map. Disturbance d (6): acceleration m/s^2 (world) and
angular acceleration rad/s^2 (body) that the terms do not explain. Errors of a state (16): differences, but 2 vec(q0^-1
q) for the attitude, which is the rotation vector to third order. The first 12 are the rigid body's.
"""

from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS
from nanobench_tools.physics import rotor
from nanobench_tools.physics.equations import Equations
from nanobench_tools.physics.model import Model
from nanobench_tools.physics.ops import casadi_ops
from nanobench_tools.physics.simulator import loads
from nanobench_tools.physics.vector import total
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number

from ..geometric import DRAG_1_S, THRUST_SCALE
from .casadi_code import import_casadi

STATES, INPUTS, DISTURBANCES = 17, 4, 6
RIGID, ERRORS = 12, 16
YAW_ARM_M = 0.006993
"""Torque about z over thrust of a rotor, as in the firmware (``motor_output.YAW_ARM_M``)."""
LEAST_LIFT = 0.2
"""Of g: no target asks for less thrust along the vertical, so that none is upside down."""
LAG_S = number("control.prediction_model.lag_s")
AIR_MOMENT_N_S = number("control.prediction_model.air_moment_n_s")


def default_model() -> Model:
    """The vehicle of the recordings, which is the plant of Task 2 too."""
    return loads(resources.files("controllers.plants").joinpath("recorded_vehicle.toml").read_text(encoding="utf-8"))


def practice_model() -> Model:
    """The vehicle of practice flights without its spread."""
    vehicle = Vehicle()
    drag = tuple(vehicle.mass_kg * d for d in DRAG_1_S)
    return Model(vehicle, {"thrust_voltage": {"c": COEFFICIENTS},
                           "thrust_scale": {"s": THRUST_SCALE}, "motor_lag": {"tau_up_s": LAG_S, "tau_down_s": LAG_S},
                           "yaw_torque": {"k_m": YAW_ARM_M}, "drag_linear": {"d": drag},
                           "drag_torque": {"c": AIR_MOMENT_N_S}})


@dataclass
class Equations4:
    """Symbolic equations of a model whose inputs are thrusts. ``tau_s`` is the mean lag, 0 for none."""

    model: Model
    tau_s: float = field(init=False)
    mass_kg: float = field(init=False)

    def __post_init__(self) -> None:
        self._ca = import_casadi()
        self._made = Equations(self.model, [float(v) for v in self.model.values], casadi_ops(), 0.01)
        lag = self._made.tau_s
        self.tau_s = 0.0 if lag is None else 0.5 * (float(lag[0]) + float(lag[1]))
        self.mass_kg = 1.0 / float(self._made._per_mass)
        mix = self.mixing()
        if not np.isfinite(mix).all() or np.linalg.cond(mix) > 1e8:
            raise InputError("model", "its motors cannot turn it about all axes", "give yaw_torque and motor positions")

    def body(self, x: Any, thrust: Any, d: Any) -> Any:
        """Derivative (13) of the rigid body."""
        ca = self._ca
        found = ca.vertcat(*self._made.body(ca.vertsplit(x[:13]), ca.vertsplit(thrust)))
        return found + ca.vertcat(ca.SX.zeros(3), d[:3], ca.SX.zeros(4), d[3:])

    def mixing(self) -> np.ndarray:
        """(4, 4): thrusts -> total thrust N and angular acceleration rad/s^2 at rest."""
        ca = self._ca
        thrust = ca.SX.sym("T", 4)
        still = ca.SX([0.0] * 9 + [1.0] + [0.0] * 3)
        turned = self.body(still, thrust, ca.SX.zeros(6))[10:13]
        made = ca.Function("mixing", [thrust], [ca.jacobian(ca.vertcat(ca.sum1(thrust), turned), thrust)])
        return np.array(made(np.full(4, 0.25 * self.mass_kg * self.model.vehicle.gravity_m_s2)))

    def step(self, x: Any, u: Any, d: Any, dt_s: Any) -> Any:
        """State after dt_s of a held input: Runge-Kutta 4, the lag solved exactly (``physics.rotor``)."""
        ca = self._ca
        now, ask = ca.vertsplit(x[13:17]), ca.vertsplit(u)
        first = middle = last = ask
        if self.tau_s > rotor.AT_ONCE_S:
            shares = rotor.shares(self.tau_s, dt_s, casadi_ops())
            first, middle, last = ([g + share * (t - g) for t, g in zip(now, ask, strict=True)] for share in shares)
        y = x[:13]
        first, middle, last = (ca.vertcat(*thrusts) for thrusts in (first, middle, last))
        k1 = self.body(y, first, d)
        k2 = self.body(y + 0.5 * dt_s * k1, middle, d)
        k3 = self.body(y + 0.5 * dt_s * k2, middle, d)
        k4 = self.body(y + dt_s * k3, last, d)
        y = y + dt_s / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        q = y[6:10]
        return ca.vertcat(y[:6], q / ca.norm_2(q), y[10:13], last)


def product(ca: Any, a: Any, b: Any) -> Any:
    """Hamilton product of quaternions x, y, z, w."""
    v, w = a[:3], a[3]
    return ca.vertcat(w * b[:3] + b[3] * v + ca.cross(v, b[:3]), w * b[3] - ca.dot(v, b[:3]))


def error(ca: Any, x: Any, target: Any) -> Any:
    """(16): x against target; the shorter way round."""
    inverse = ca.vertcat(-target[6:9], target[9])
    q = product(ca, inverse, x[6:10])
    turn = 2.0 * ca.if_else(q[3] < 0.0, -1.0, 1.0) * q[:3]
    return ca.vertcat(x[:6] - target[:6], turn, x[10:] - target[10:])


def moved(ca: Any, x: Any, delta: Any) -> Any:
    """x moved by an error (16)."""
    q = product(ca, x[6:10], ca.vertcat(0.5 * delta[6:9], 1.0))
    return ca.vertcat(x[:6] + delta[:6], q / ca.norm_2(q), x[10:] + delta[9:])


def step_function(model: Model) -> Any:
    """step(x, u, d, dt) -> x."""
    ca, made = import_casadi(), Equations4(model)
    x, u, d, dt = (ca.SX.sym(name, size) for name, size in (("x", STATES), ("u", 4), ("d", 6), ("dt", 1)))
    return ca.Function("step", [x, u, d, dt], [ca.cse(made.step(x, u, d, dt))])


def rollout_function(model: Model, steps: int) -> Any:
    """rollout(x, U (4, N), d, dt (1, N)) -> states (17, N) after each input."""
    ca = import_casadi()
    whole = step_function(model).mapaccum("whole", steps)
    x, u, d, dt = ca.MX.sym("x", STATES), ca.MX.sym("U", 4, steps), ca.MX.sym("d", 6), ca.MX.sym("dt", 1, steps)
    return ca.Function("rollout", [x, u, d, dt], [whole(x, u, ca.repmat(d, 1, steps), dt)])


def stages_function(model: Model, horizon: int, dt_s: float, states: int = ERRORS) -> Any:
    """stages(X (17, N), U (4, N), Xnext (17, N), d) -> defects (S, N), A' (S, S N), B (S, 4 N).

    defect = step(X, U) against Xnext. With errors dx of X and changes du of U, the error against Xnext is defect + A
    dx + B du. ``states`` S: 16, or 12 without rotor states, whose thrust then acts at once.
    """
    ca = import_casadi()
    given, parts = _stage(model, dt_s, states)
    mapped = ca.Function("one", given, [ca.densify(part) for part in parts]).map(horizon)
    big = [ca.MX.sym("X", STATES, horizon), ca.MX.sym("U", 4, horizon), ca.MX.sym("A", STATES, horizon)]
    d = ca.MX.sym("d", 6)
    return ca.Function("stages", [*big, d], mapped(*big, ca.repmat(d, 1, horizon)))


def stage_pattern(model: Model, dt_s: float, states: int = ERRORS) -> tuple[np.ndarray, np.ndarray]:
    """Which entries of A (S, S) and B (S, 4) the equations may fill, bool."""
    parts = _stage(model, dt_s, states)[1][1:]
    a, b = (np.array(import_casadi().DM(part.sparsity(), 1.0)) != 0.0 for part in parts)
    return a.T, b


def _stage(model: Model, dt_s: float, states: int) -> tuple[list[Any], list[Any]]:
    """Arguments x, u, x ahead, d and results defect, A', B of one stage."""
    ca = import_casadi()
    made = Equations4(model)
    if states == RIGID:
        made.tau_s = 0.0
    x, u, ahead, d = (ca.SX.sym(name, size) for name, size in (("x", STATES), ("u", 4), ("n", STATES), ("d", 6)))
    dx, du = ca.SX.sym("dx", states), ca.SX.sym("du", 4)
    full = ca.vertcat(dx, ca.SX.zeros(ERRORS - states))
    missed = error(ca, made.step(moved(ca, x, full), u + du, d, dt_s), ahead)[:states]
    parts = [missed, ca.jacobian(missed, dx).T, ca.jacobian(missed, du)]
    at = [ca.SX.zeros(states), ca.SX.zeros(4)]
    return [x, u, ahead, d], [ca.cse(part) for part in ca.substitute(parts, [dx, du], at)]


def targets_function(model: Model, count: int) -> Any:
    """targets(R (14, K), d) -> states (17, K) and inputs (4, K) that fly a reference under a steady disturbance.

    A column of R: position, velocity, acceleration, jerk (3 each), yaw rad, yaw rate rad/s. Differential flatness: the
    thrust points along the sum of acceleration, gravity, drag and disturbance, and the jerk turns it. Thrusts balance
    the moments that act then (the angular acceleration of the reference is omitted).
    """
    ca = import_casadi()
    made = Equations4(model)
    g, mass = model.vehicle.gravity_m_s2, made.mass_kg
    r, d = ca.SX.sym("r", 14), ca.SX.sym("d", 6)
    p, v, a, j, yaw, turn = r[:3], r[3:6], r[6:9], r[9:12], r[12], r[13]
    up, even = ca.SX([0.0, 0.0, 1.0]), ca.SX.ones(4) * (0.25 * mass * g)
    q, still = _attitude(ca, 0.0, 0.0, yaw), ca.SX.zeros(3)
    for _ in range(2):
        slope = made.body(ca.vertcat(p, v, q, still), even, d)
        passive = slope[3:6] - _axis(ca, q) * (4.0 * even[0] / mass) + g * up
        push = a + g * up - passive
        push = ca.vertcat(push[:2], ca.fmax(push[2], LEAST_LIFT * g))
        length = ca.norm_2(push)
        z = push / length
        ahead, side = ca.cos(yaw) * z[0] + ca.sin(yaw) * z[1], ca.sin(yaw) * z[0] - ca.cos(yaw) * z[1]
        q = _attitude(ca, ca.asin(ca.fmax(ca.fmin(side, 1.0), -1.0)), ca.atan2(ahead, z[2]), yaw)
    heading = ca.vertcat(ca.cos(yaw), ca.sin(yaw), 0.0)
    y = ca.cross(z, heading)
    y = y / ca.norm_2(y)
    h = (j - ca.dot(j, z) * z) / length
    rate = ca.vertcat(-ca.dot(h, y), ca.dot(h, ca.cross(y, z)), z[2] * turn)
    thrust = ca.SX.sym("T", 4)
    acts = ca.vertcat(ca.sum1(thrust), made.body(ca.vertcat(p, v, q, rate), thrust, d)[10:13])
    slope = ca.jacobian(acts, thrust)
    slope, acts = ca.substitute([slope, acts], [thrust], [even])
    u = even + ca.solve(slope, ca.vertcat(mass * length, ca.SX.zeros(3)) - acts)
    one = ca.Function("one", [r, d], [ca.cse(ca.vertcat(p, v, q, rate, u)), ca.cse(u)])
    mapped = one.map(count)
    many, d = ca.MX.sym("R", 14, count), ca.MX.sym("d", 6)
    return ca.Function("targets", [many, d], mapped(many, ca.repmat(d, 1, count)))


def _attitude(ca: Any, roll: Any, pitch: Any, yaw: Any) -> Any:
    """Quaternion of Euler angles ZYX."""
    def about(axis: int, angle: Any) -> Any:
        parts = [0.0, 0.0, 0.0, ca.cos(angle / 2.0)]
        parts[axis] = ca.sin(angle / 2.0)
        return ca.vertcat(*parts)
    return product(ca, about(2, yaw), product(ca, about(1, pitch), about(0, roll)))


def _axis(ca: Any, q: Any) -> Any:
    """Body z in the world."""
    x, y, z, w = ca.vertsplit(q)
    return ca.vertcat(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), total([w * w, z * z, -x * x, -y * y]))
