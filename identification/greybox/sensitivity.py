"""Derivatives of rollouts by parameters: the model and directions through it, compiled and run together.

A block of BLOCK directions in the space of the parameters is carried along with the state. The code is the same for
any directions, so a model is compiled once for any number of free parameters. Rotors are warmed up on the inputs
before a window, and the derivatives with them.
"""

import functools

import numpy as np

from nanobench_tools.physics import Model, symbolic
from nanobench_tools.physics.batched import Compiled, scan
from nanobench_tools.physics.inputs import rows, settled
from nanobench_tools.physics.model import RIGID, STATE
from nanobench_tools.physics.ops import import_casadi
from nanobench_tools.physics.rollout import rollout

from .starts import tangents

BLOCK = 7
ROTORS = 4


class _Structure:
    """Key of compiled code: equal for models with equal equations."""

    def __init__(self, model: Model) -> None:
        self.model, self.structure = model, model.structure

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.structure == other.structure

    def __hash__(self) -> int:
        return hash(self.structure)


@functools.lru_cache(maxsize=64)
def _tangent(key: _Structure, name: str, row_hz: float, own_parameters: bool) -> Compiled:
    """f(x, u, p) of ``symbolic`` with BLOCK tangents: state (x, S by columns), inputs u, p and directions D (P, B)."""
    ca = import_casadi()
    function = getattr(symbolic, name)(key.model, row_hz)
    size, inputs, parameters = (function.size1_in(i) for i in range(3))
    x, u, p = ca.SX.sym("x", size), ca.SX.sym("u", inputs), ca.SX.sym("p", parameters)
    s, d = ca.SX.sym("S", size, BLOCK), ca.SX.sym("D", parameters, BLOCK)
    y = function(x, u, p)
    ahead = ca.jtimes(y, ca.vertcat(x, p), ca.vertcat(s, d))
    state, after = ca.vertcat(x, ca.vec(s)), ca.vertcat(y, ca.vec(ahead))
    made = ca.Function("tangent", [state, u, p, d], [ca.cse(after)], ["x", "u", "p", "d"], ["x_next"])
    return scan(made, ["u"], ["d"] if own_parameters else ["p", "d"])


def sensitivities(model: Model, start: np.ndarray, motor: np.ndarray, battery_V: np.ndarray,
                  past: tuple[np.ndarray, np.ndarray] | None, directions: np.ndarray, *, keep: np.ndarray,
                  row_hz: float = 100.0, parameters: np.ndarray | None = None,
                  threads: int = 1, starts: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 13, n) after the rows ``keep`` (K,), which increase.

    Also their derivatives (K, F, 13, n) along ``directions`` (P, F).

    ``start`` (n, 13), motor (n, H, 4), battery_V (n, H), past (motor, battery) before the start, as for ``rollout``;
    ``parameters`` (P,) or (n, P) in place of the model's; ``starts`` (7, F): what the directions do to the start, in
    the order of ``starts.NAMES``.
    """
    values = model.values if parameters is None else np.asarray(parameters, float)
    if not directions.shape[1]:
        flown = rollout(model, start, motor, battery_V, past, row_hz=row_hz, parameters=values, threads=threads)
        return flown[:, keep, :RIGID].transpose(1, 2, 0), np.empty((len(keep), 0, RIGID, len(start)))
    window, before = rows(model, motor, battery_V, past, row_hz=row_hz, parameters=values)
    n, free = len(start), directions.shape[1]
    states = np.empty((len(keep), RIGID, n))
    found = np.empty((len(keep), free, RIGID, n))
    fly = _tangent(_Structure(model), "step", row_hz, values.ndim == 2).on_threads(threads)
    first = settled(model, before[0] if len(before) else window[0], row_hz=row_hz, parameters=values)
    for low in range(0, free, BLOCK):
        part = directions[:, low:low + BLOCK]
        block = np.zeros((directions.shape[0], BLOCK))
        block[:, :part.shape[1]] = part
        rotor = np.concatenate([first, np.zeros((ROTORS * BLOCK, n))])
        if "motor_lag" in model and len(before):
            follow = _tangent(_Structure(model), "lagged", row_hz, values.ndim == 2).on_threads(threads)
            rotor = follow(rotor, before, values.T, block, keep="last")[0]
        state = np.zeros((1 + BLOCK, len(STATE), n))
        state[0, :RIGID] = start.T
        state[:, RIGID:] = rotor.reshape(1 + BLOCK, ROTORS, n)
        if starts is not None:
            state[1:1 + part.shape[1]] += tangents(starts[:, low:low + BLOCK])[:, :, None]
        flat, row = state.reshape(-1, n), 0
        for k, at in enumerate(keep):  # no row between is held: that memory costs as much as the equations
            flat, row = fly(flat, window[row:at], values.T, block, keep="last")[0], at
            flown = flat.reshape(1 + BLOCK, len(STATE), n)
            states[k] = flown[0, :RIGID]
            found[k, low:low + part.shape[1]] = flown[1:1 + part.shape[1], :RIGID]
    return states, found
