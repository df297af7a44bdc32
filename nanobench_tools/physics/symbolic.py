"""A model as CasADi functions of state, inputs and parameters, with exact derivatives.

    derivative(x[S], u[I], p[P]) -> dx[S]
    step(x[S], u[I], p[P]) -> x[S]              one row later

    command(u[I], p[P]) -> r[n]                 commanded thrust
    lagged(r[n], u[I], p[P]) -> r[n]            one row later

    rollout(x[S], U[I, H], p[P]) -> X[S, H]

n rotors have S = 13 + n states. The orders of x, u and p are ``Model.state``, ``Model.inputs`` and ``Model.names``.
"""

from typing import Any

from .equations import Equations
from .inputs import substeps
from .model import Model
from .ops import casadi_ops, import_casadi


def _symbols(model: Model, state: int | None = None) -> tuple[Any, Any, Any]:
    ca = import_casadi()
    return (ca.SX.sym("x", state or len(model.state)), ca.SX.sym("u", len(model.inputs)),
            ca.SX.sym("p", len(model.names)))


def _row_hz(model: Model, row_hz: float | None) -> float:
    return row_hz or model.vehicle.rate_hz


def _made(model: Model, name: str, row_hz: float | None, state: int | None = None) -> Any:
    ca = import_casadi()
    x, u, p = _symbols(model, state)
    row = _row_hz(model, row_hz)
    equations = Equations(model, ca.vertsplit(p), casadi_ops(), 1.0 / row)
    given = (ca.vertsplit(x), ca.vertsplit(u))
    found = equations.step(*given, substeps(model, row)) if name == "step" else getattr(equations, name)(*given)
    return ca.Function(name, [x, u, p], [ca.cse(ca.vertcat(*found))], ["x", "u", "p"],
                       ["dx" if name == "derivative" else "x_next"])


def derivative(model: Model, row_hz: float | None = None) -> Any:
    """casadi.Function derivative(x, u, p)."""
    return _made(model, "derivative", row_hz)


def step(model: Model, row_hz: float | None = None) -> Any:
    """casadi.Function step(x, u, p): one row of 1 / row_hz (by default of the model's rate)."""
    return _made(model, "step", row_hz)


def command(model: Model, row_hz: float | None = None) -> Any:
    """casadi.Function command(u, p): thrusts [N] asked of the motors, where rotors settle if the row lasts."""
    ca = import_casadi()
    _, u, p = _symbols(model)
    equations = Equations(model, ca.vertsplit(p), casadi_ops(), 1.0 / _row_hz(model, row_hz))
    return ca.Function("command", [u, p], [ca.cse(ca.vertcat(*equations.command(ca.vertsplit(u))))], ["u", "p"], ["r"])


def lagged(model: Model, row_hz: float | None = None) -> Any:
    """casadi.Function lagged(r, u, p): rotor states one row later, for the warm-up before a window."""
    return _made(model, "lagged", row_hz, model.rotors)


def rollout(model: Model, horizon: int, row_hz: float | None = None) -> Any:
    """casadi.Function rollout(x, U, p): all states after the start."""
    ca = import_casadi()
    whole = step(model, row_hz).mapaccum("mapped", horizon)
    x, u, p = (ca.MX.sym("x", len(model.state)), ca.MX.sym("U", len(model.inputs), horizon),
               ca.MX.sym("p", len(model.names)))
    return ca.Function("rollout", [x, u, p], [whole(x, u, ca.repmat(p, 1, horizon))], ["x", "U", "p"], ["X"])
