"""What plans of MPPI cost on the identified model: its compiled equations, stepped for thousands of plans at once."""

import functools

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, symbolic
from nanobench_tools.physics.batched import Compiled, scan
from nanobench_tools.physics.model import POSITION, RATE, VELOCITY
from nanobench_tools.physics.ops import import_casadi

from .mppi import MppiSettings

LOST = 1e9
"""Price of a plan whose rollout is no number."""


class Costs:
    """Costs of plans (n vehicles, K plans each, T steps). Raises InputError for a model of rotor speeds."""

    def __init__(self, model: Model, settings: MppiSettings) -> None:
        if model.vehicle.input != "pwm":
            raise InputError("simulator", f"its input is {model.vehicle.input}", "MPPI commands PWM; give another one")
        self._model, self._effort = model, settings.effort
        self._weights = np.array([settings.position, settings.velocity, settings.upright, settings.turning])
        self._step = priced_step(model, settings.step_s)

    def __call__(self, tried: np.ndarray, start: np.ndarray, battery_V: np.ndarray, goal_m: np.ndarray) -> np.ndarray:
        """(n, K) of commands tried (n, K, T, 4) from states start (S, n) to goals (n, 3), the battery (n) as it is."""
        n, samples, horizon, _ = tried.shape
        motor = tried.transpose(2, 3, 0, 1).reshape(horizon, 4, n * samples)
        first = np.concatenate([np.repeat(start, samples, axis=1), np.zeros((1, n * samples))])
        end = self._step(first, inputs_of(self._model, motor, np.repeat(battery_V, samples)),
                         np.repeat(goal_m.T, samples, axis=1), self._weights, self._model.values, keep="last")[0]
        effort = self._effort * np.sum(motor**2, axis=(0, 1)) if self._effort else 0.0
        return np.asarray(np.nan_to_num(end[-1] + effort, nan=LOST, posinf=LOST).reshape(n, samples))


def inputs_of(model: Model, motor: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
    """Rows of inputs (T, I, n) of commands (T, 4, n) and battery (n). In a model with command delay they act at once:
    earlier commands are not planned again."""
    found = [motor, np.broadcast_to(battery_V, (len(motor), 1, motor.shape[2]))]
    if len(model.inputs) > 5:
        found += [motor, np.zeros((len(motor), 1, motor.shape[2]))]
    return np.concatenate(found, axis=1)


@functools.lru_cache(maxsize=8)
def priced_step(model: Model, step_s: float) -> Compiled:
    """f(states and cost (S + 1), u, goal (3), weights (4), p) -> the same after ``step_s``, plus the new state's cost.

    Weights are those of |p - goal|^2, |v|^2, the tilt 1 - cos and |rate|^2."""
    ca = import_casadi()
    step = symbolic.step(model, 1.0 / step_s)
    x, u, p = (ca.SX.sym(name, step.size1_in(i)) for i, name in enumerate(("x", "u", "p")))
    cost, goal, weights = ca.SX.sym("cost"), ca.SX.sym("goal", 3), ca.SX.sym("weights", 4)
    after = step(x, u, p)
    tilt = 2.0 * (after[6] ** 2 + after[7] ** 2)
    parts = ca.vertcat(ca.sumsqr(after[POSITION] - goal), ca.sumsqr(after[VELOCITY]), tilt, ca.sumsqr(after[RATE]))
    later = ca.cse(ca.vertcat(after, cost + ca.dot(weights, parts)))
    names = ["x", "u", "goal", "weights", "p"]
    function = ca.Function("priced", [ca.vertcat(x, cost), u, goal, weights, p], [later], names, ["later"])
    return scan(function, ["u"], ["weights", "p"])
