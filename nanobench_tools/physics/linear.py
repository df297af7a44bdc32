"""A vehicle at its hover as a linear system for python-control: Bode plots, margins, LQR, with names and units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingExtraError
from .hover import BATTERY_V, hover, row_of, state_of
from .model import RIGID, Model, state_names
from .ops import import_casadi
from .symbolic import derivative

if TYPE_CHECKING:
    import control

DELAY_ORDER = 2
"""Of the Pade approximation: its phase is right within a degree up to 1.2 rad of delay."""
TURN = slice(6, 9)
LINEAR = 12
"""States without the rotors: three angles stand for the quaternion."""


def linear_names(rotors: int) -> tuple[str, ...]:
    """Names of the linear states, in order.

    - position_x .. [m], velocity_x .. [m/s] in the world;
    - turn_x .. [rad] in the body beyond the hover's tilt, rate_x .. [rad/s] in the body;
    - thrust_1 .. [N]."""
    names = state_names(rotors)
    return (*names[:6], *(f"turn_{axis}" for axis in "xyz"), *names[10:])


def matrices(model: Model, battery_V: float = BATTERY_V) -> tuple[np.ndarray, np.ndarray]:
    """(A (12 + n, 12 + n), B (12 + n, n)) of dz/dt = A z + B u about the hover.

    z is ordered as ``linear_names``, u is the change of the motors' commands, undelayed. A lag that differs up and
    down is taken at the mean of both rates."""
    ca = import_casadi()
    model = _one_lag(model)
    at = hover(model, battery_V)
    n = model.rotors
    where = state_of(model, np.radians(at.roll_deg), np.radians(at.pitch_deg), np.array(at.thrust_N))[0]
    where[2] = at.height_m
    z, u = ca.SX.sym("z", LINEAR + n), ca.SX.sym("u", n)
    turned = _product(where[6:10], [z[6] / 2, z[7] / 2, z[8] / 2, 1.0])
    state = ca.vertcat(*(where[i] + z[i] for i in range(6)), *turned, z[9], z[10], z[11],
                       *(where[RIGID + i] + z[LINEAR + i] for i in range(n)))
    row = list(row_of(model, np.array(at.motor), battery_V)[0])
    motors = [row[i] + u[i] for i in range(n)]
    late = [*motors, row[-1]] if "command_delay" in model else []
    slope = derivative(model)(state, ca.vertcat(*motors, row[n], *late), model.values)
    back = [-turned[0], -turned[1], -turned[2], turned[3]]
    turning = [2.0 * part for part in _product(back, [slope[i] for i in range(6, 10)])[:3]]
    change = ca.vertcat(slope[:6], *turning, slope[10:13], slope[13:])
    jacobians = ca.Function("ab", [z, u], [ca.jacobian(change, z), ca.jacobian(change, u)])(0, 0)
    return np.array(jacobians[0]), np.array(jacobians[1])


def linearize(model: Model, battery_V: float = BATTERY_V, delay_order: int = DELAY_ORDER) -> control.StateSpace:
    """``matrices`` as a control.StateSpace: inputs motor_1 .. [as ``Vehicle.input``], outputs all of ``linear_names``.

    A command_delay is a Pade approximation of ``delay_order`` before every motor (0: left out); a model without
    motor_lag has no thrust states. UsageError where it cannot hover; MissingExtraError without python-control.
    """
    try:
        import control
    except ImportError:
        raise MissingExtraError("control", "control") from None

    a, b = matrices(model, battery_V)
    size = LINEAR + model.rotors if "motor_lag" in model else LINEAR
    names = list(linear_names(model.rotors)[:size])
    a, b, d = a[:size, :size], b[:size], np.zeros((size, model.rotors))
    motors = [f"motor_{i}" for i in range(1, model.rotors + 1)]
    delay_s = model.parameters.get("command_delay.delay_s", 0.0)
    states = names
    if delay_s and delay_order:
        late = control.append(*[control.ss(control.tf(*control.pade(delay_s, delay_order)))] * model.rotors)
        states = [*names, *(f"late_{i}_{k}" for i in range(1, model.rotors + 1) for k in range(delay_order))]
        a = np.block([[a, b @ late.C], [np.zeros((len(late.A), size)), late.A]])
        b, d = np.vstack([b @ late.D, late.B]), np.zeros((size, model.rotors))
    return control.ss(a, b, np.eye(size, len(a)), d, inputs=motors, outputs=names, states=states, name="vehicle")


def _one_lag(model: Model) -> Model:
    if "motor_lag" not in model:
        return model
    lag = model.values_of("motor_lag")
    up, down = lag["tau_up_s"], lag["tau_down_s"]
    mean = 2.0 * up * down / (up + down) if up + down > 0.0 else 0.0
    return model.with_parameters({"motor_lag.tau_up_s": mean, "motor_lag.tau_down_s": mean})


def _product(p: Any, q: Any) -> list[Any]:
    """Quaternion product p q, x, y, z, w."""
    (a, b, c, d), (x, y, z, w) = p, q
    return [d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z]
