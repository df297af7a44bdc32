"""The order of evaluation: from inputs to the derivative of the state, and one step of the integration.

    m dv/dt = R Tilt (sum T_i e3 + F_b) + F - m g e3        J dw/dt = tau - w x J w

Delay, input limit, thrust map, thrust limit, scale and imbalance give the commanded thrust. The thrust follows it with
the lag. Inflow and ground effect, body forces, torques and the tilt come after. Everything is written over components,
so that NumPy arrays and CasADi symbols go through the same lines.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from . import rotor
from .model import POSITION, QUATERNION, RATE, ROTOR, VELOCITY, Model
from .ops import Ops
from .term import Situation, Stage
from .vector import add, apply, apply_transposed, cross, rotation, subtract, total

Components = Sequence[Any]


class Equations:
    """A model's equations at parameter values ``vector`` (P components); inputs are held over rows of ``row_s``."""

    def __init__(self, model: Model, vector: Components, ops: Ops, row_s: float) -> None:
        self.model, self.ops, self.row_s = model, ops, row_s
        bound = model.bind(vector)
        self._acting = {stage: [(term.acts[stage], bound[term.name])
                                for term in sorted(model.terms, key=lambda t: t.name) if stage in term.acts]
                        for stage in Stage}
        self._still = Situation(model.vehicle, row_s)
        self._per_mass = 1.0 / self._run(Stage.MASS, model.vehicle.mass_kg, self._still)
        self._inertia = self._run(Stage.INERTIA, list(model.vehicle.inertia_kg_m2), self._still)
        self._per_inertia = [1.0 / j for j in self._inertia]
        self.wind = self._run(Stage.WIND, [0.0, 0.0, 0.0], self._still)
        self.tau_s: tuple[Any, Any] | None = self._run(Stage.LAG, None, self._still)
        """(tau_up, tau_down) s, or None without motor_lag."""
        gain = self._run(Stage.THRUST_SCALE, [1.0] * model.rotors, self._still)
        self._gain = self._run(Stage.MOTOR_GAIN, gain, self._still)

    def _run(self, stage: Stage, value: Any, at: Situation) -> Any:
        for expression, parameters in self._acting[stage]:
            value = expression(value, parameters, at, self.ops)
        return value

    def command(self, inputs: Components) -> list[Any]:
        """A row of inputs (see ``Model.inputs``) -> thrust commanded of each motor [N], constant over the row."""
        n = self.model.rotors
        motor, earlier = list(inputs[:n]), inputs[n + 1:]
        at = replace(self._still, battery_V=inputs[n], before=earlier[:n], whole_rows=earlier[n] if earlier else 0.0)
        for stage in (Stage.INPUT_DELAY, Stage.INPUT_LIMIT, Stage.THRUST_MAP, Stage.THRUST_LIMIT, Stage.THRUST_SCALE,
                      Stage.MOTOR_GAIN):
            motor = self._run(stage, motor, at)
        return motor

    def body(self, state: Components, thrust: Components, command: Components = ()) -> list[Any]:
        """Position, velocity, quaternion, rate (13) and lagged thrusts [N] -> derivative of the 13. ``command``: the
        thrusts that the rotors follow; without it their speeds are steady."""
        vehicle = self.model.vehicle
        position, velocity, rate = state[POSITION], state[VELOCITY], state[RATE]
        turn = rotation(state[QUATERNION])
        velocity_b = apply_transposed(turn, velocity)
        windy = bool(self._acting[Stage.WIND])
        at = replace(self._still, gain=self._gain, position_m=position, rate_rad_s=rate, velocity_b=velocity_b,
                     air_b=apply_transposed(turn, subtract(velocity, self.wind)) if windy else velocity_b)
        at.lagged_N, at.command_N, at.tau_s = thrust, command, self.tau_s
        at.rotor_rad_s = self._run(Stage.ROTOR_SPEED, thrust, at)
        at.thrust_N = thrust = self._run(Stage.GROUND, self._run(Stage.INFLOW, thrust, at), at)
        drag = self._run(Stage.BODY_FORCE, [0.0, 0.0, 0.0], at)
        at.force_b = [drag[0], drag[1], drag[2] + total(thrust)]
        moment = [total([y * t for (_, y), t in zip(vehicle.motor_positions_m, thrust, strict=True)]),
                  total([-x * t for (x, _), t in zip(vehicle.motor_positions_m, thrust, strict=True)]), 0.0]
        moment = self._run(Stage.TORQUE, moment, at)
        push = self._run(Stage.WORLD_FORCE, [0.0, 0.0, 0.0], at)
        force = add(apply(turn, self._run(Stage.TILT, at.force_b, at)), push)
        acceleration = [f * self._per_mass for f in force]
        acceleration[2] = acceleration[2] - vehicle.gravity_m_s2
        momentum = [j * w for j, w in zip(self._inertia, rate, strict=True)]
        turning = [m * j for m, j in zip(subtract(moment, cross(rate, momentum)), self._per_inertia, strict=True)]
        return [*velocity, *acceleration, *_quaternion_rate(state[QUATERNION], rate), *turning]

    def derivative(self, state: Components, inputs: Components) -> list[Any]:
        """Time derivative of all states. Without lag the command acts at once and rotor states stand still."""
        command, thrust = self.command(inputs), state[ROTOR]
        if self.tau_s is None:
            return [*self.body(state[:13], command), *([0.0] * self.model.rotors)]
        acting, slope = rotor.derivative(thrust, command, *self.tau_s, self.ops)
        return [*self.body(state[:13], acting, command), *slope]

    def lagged(self, thrust: Components, inputs: Components) -> list[Any]:
        """Rotor states [N] one row later."""
        command = self.command(inputs)
        if self.tau_s is None:
            return command
        return rotor.stage_thrusts(thrust, command, *self.tau_s, self.row_s, self.ops)[2]

    def step(self, state: Components, inputs: Components, substeps: int = 1) -> list[Any]:
        """The states one row later: ``substeps`` steps of Runge-Kutta 4.

        The quaternion is integrated in R^4, where the equation keeps its length, and normalised after each step. A
        projection onto the manifold keeps the order (Hairer, Lubich, Wanner 2006, Geometric Numerical Integration,
        theorem IV.4.1). The thrust is solved exactly, see ``rotor``.
        """
        step_s, command = self.row_s / substeps, self.command(inputs)
        x, thrust = list(state[:13]), list(state[ROTOR])
        for _ in range(substeps):
            first = middle = last = command
            if self.tau_s is not None:
                first, middle, last = rotor.stage_thrusts(thrust, command, *self.tau_s, step_s, self.ops)
            k1 = self.body(x, first, command)
            k2 = self.body(_ahead(x, 0.5 * step_s, k1), middle, command)
            k3 = self.body(_ahead(x, 0.5 * step_s, k2), middle, command)
            k4 = self.body(_ahead(x, step_s, k3), last, command)
            x = [s + (step_s / 6.0) * (a + 2.0 * (b + c) + d)
                 for s, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True)]
            x[QUATERNION] = normalised(x[QUATERNION], self.ops)
            thrust = list(last)
        return [*x, *thrust]


def _ahead(state: Components, step_s: float, slope: Components) -> list[Any]:
    return [s + step_s * k for s, k in zip(state, slope, strict=True)]


def _quaternion_rate(quaternion: Components, rate: Components) -> list[Any]:
    """0.5 q (w, 0), x, y, z, w."""
    x, y, z, w = quaternion
    a, b, c = (0.5 * r for r in rate)
    return [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -(x * a + y * b + z * c)]


def normalised(quaternion: Components, ops: Ops) -> list[Any]:
    """To unit length."""
    inverse = 1.0 / ops.sqrt(total([q * q for q in quaternion]))
    return [q * inverse for q in quaternion]
