"""Rotors that follow their command with a first-order lag, solved exactly over a step.

For a constant T_cmd, tau dT/dt = T_cmd - T has the solution T_cmd + (T_0 - T_cmd) exp(-t / tau). The direction never
changes within a step, so one of tau_up and tau_down applies throughout. Runge-Kutta 4 then integrates the body over a
known thrust. Its stages use the share of the difference that is left at their time. The shares make impulse and
displacement (first and second integral) exact. Any tau down to 0 is stable, and the limit tau = 0 is no lag at all.
The shares differ from exp(-t / tau) at the stage times by O(h^3), which keeps the order 4.
"""

from collections.abc import Sequence
from typing import Any

from .ops import Ops

AT_ONCE_S = 1e-9
"""Time constants below this are no lag."""


def shares(tau_s: Any, step_s: float, ops: Ops) -> tuple[Any, Any, Any]:
    """Share of T_0 - T_cmd seen by the first, the two middle and the last stage of a step."""
    end = ops.exp(-step_s / ops.fmax(tau_s, AT_ONCE_S))
    ratio = tau_s / step_s
    impulse = ratio * (1.0 - end)  # int_0^1 exp(-a s) ds, a = h / tau
    displacement = ratio * (1.0 - impulse)  # int_0^1 (1 - s) exp(-a s) ds
    return 12.0 * displacement - 6.0 * impulse + end, 3.0 * (impulse - displacement) - 0.5 * end, end


def stage_thrusts(thrust: Sequence[Any], command: Sequence[Any], tau_up_s: Any, tau_down_s: Any, step_s: float,
                  ops: Ops) -> tuple[list[Any], list[Any], list[Any]]:
    """Thrusts [N] of the rotors at the first, middle and last stage; the last is the state after the step."""
    up, down = shares(tau_up_s, step_s, ops), shares(tau_down_s, step_s, ops)
    stages: tuple[list[Any], list[Any], list[Any]] = ([], [], [])
    for now, goal in zip(thrust, command, strict=True):
        rising, left = goal > now, now - goal
        for stage, a, b in zip(stages, up, down, strict=True):
            stage.append(goal + ops.where(rising, a, b) * left)
    return stages


def derivative(thrust: Sequence[Any], command: Sequence[Any], tau_up_s: Any, tau_down_s: Any,
               ops: Ops) -> tuple[list[Any], list[Any]]:
    """(thrust that acts, its time derivative N/s); without lag the command acts and the derivative is 0."""
    acting, slope = [], []
    for now, goal in zip(thrust, command, strict=True):
        tau = ops.where(goal > now, tau_up_s, tau_down_s)
        lags = tau > AT_ONCE_S
        acting.append(ops.where(lags, now, goal))
        slope.append(ops.where(lags, (goal - now) / ops.fmax(tau, AT_ONCE_S), 0.0))
    return acting, slope
