"""Nonlinear predictive control by sequential quadratic programming, one step a command (real-time iteration).

The model flies the last plan, one period later, from where the vehicle will be. The equations are linearised along
that flight (Gauss-Newton), and the condensed program gives its change. Started from the prediction, the iteration's
stages have no defects.

References
----------
Diehl, Bock, Schloeder 2005, "A real-time iteration scheme for nonlinear optimization in optimal feedback control", SIAM
Journal on Control and Optimization 43(5), doi:10.1137/S0363012902400713.
"""

from typing import Any

import numba as nb
import numpy as np

from .casadi_code import Call
from .condense import UNIT_N, condensed
from .linear_mpc import MpcDaqp
from .prediction_model import rollout_function
from .thrust_plan import bounded

LEAST_W = 0.2
"""Least cosine of half the angle between a flight and its target in the change of charts: beyond, half round."""

NEAR_RAD = 0.5
"""What a program about a flight says of its tilt further from the target is not believed."""


@nb.njit(cache=True)
def _turned(m: np.ndarray, v: np.ndarray) -> None:
    """v (3) becomes m v."""
    x, y, z = v
    for i in range(3):
        v[i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z


@nb.njit(cache=True)
def against(flown: np.ndarray, targets: np.ndarray, a: np.ndarray, b: np.ndarray, residual: np.ndarray) -> None:
    """Writes the errors (N + 1, S) of states flown (N + 1, 17) against targets.

    Turns a (N, S, S) and b (N, 4, S), made in the charts of the flight, into those of the targets. For the rotation
    (v, w) between them, d(error) = (w 1 + v x) d(turn)."""
    n, s = a.shape[0], a.shape[1]
    last = np.eye(3)
    for k in range(n + 1):
        q, p = targets[k, 6:10], flown[k, 6:10]
        w = q[3] * p[3] + q[0] * p[0] + q[1] * p[1] + q[2] * p[2]
        sign = 1.0 if w >= 0.0 else -1.0
        x = sign * (q[3] * p[0] - q[0] * p[3] - q[1] * p[2] + q[2] * p[1])
        y = sign * (q[3] * p[1] + q[0] * p[2] - q[1] * p[3] - q[2] * p[0])
        z = sign * (q[3] * p[2] - q[0] * p[1] + q[1] * p[0] - q[2] * p[3])
        w = max(sign * w, LEAST_W)
        for i in range(6):
            residual[k, i] = flown[k, i] - targets[k, i]
        residual[k, 6], residual[k, 7], residual[k, 8] = 2.0 * x, 2.0 * y, 2.0 * z
        for i in range(9, s):
            residual[k, i] = flown[k, i + 1] - targets[k, i + 1]
        chart = np.array([[w, -z, y], [z, w, -x], [-y, x, w]])
        if k > 0:
            for j in range(s):
                _turned(chart, a[k - 1, 6:9, j])
            if k > 1:
                for j in range(s):
                    _turned(last, a[k - 1, j, 6:9])
            for j in range(4):
                _turned(chart, b[k - 1, j, 6:9])
            last = np.linalg.inv(chart).T


@nb.njit(cache=True)
def near(residual: np.ndarray) -> int:
    """Stages of a flight (N + 1, S) that come before the first whose attitude is beyond NEAR_RAD of its target."""
    stages: int = residual.shape[0] - 1
    for k in range(1, stages + 1):
        if np.sqrt(np.sum(residual[k, 6:9] ** 2)) > NEAR_RAD:
            return k - 1
    return stages


class Nmpc(MpcDaqp):
    """Nonlinear predictive control, with 13 states and those of the rotors.

    Parameters
    ----------
    iterations : int
        Programs that are solved for a command.
    *arguments, **keywords
        As of ``Mpc``: model, delay_s, horizon, dt_s, weights, tuning, gains and others.
    """

    name = "nmpc"

    def __init__(self, *arguments: Any, iterations: int = 1, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self.iterations = iterations
        self._rollout = Call(rollout_function(self.model, self.horizon))
        self._rollout.given[3][:] = self.dt_s
        self._zero = np.zeros((self.horizon, self.states))

    def solve(self, i: int, x: np.ndarray, yaw: float, targets: np.ndarray, inputs: np.ndarray, least: np.ndarray,
              most: np.ndarray) -> np.ndarray | None:
        d = self.observer.disturbance[i]
        thrusts = np.empty((self.horizon, 4))
        bounded(self.plan.shifted(i, float(self.plan.age_s[i])), least, most, thrusts)
        for _ in range(self.iterations):
            flown = self.flown(x, thrusts, d)
            a, b, _, _ = self.linearise(x, flown, np.concatenate([thrusts, thrusts[-1:]]), d)
            against(flown, targets, a, b, self._residual)
            condensed(a, b, self._zero, self._zero[0], self._residual, self.q, self.p, yaw, self._p, self.r, inputs,
                      thrusts, least, most, self.h, self.g, self._turns, self._fixed, self._bounds)
            z = self.program(i, targets, near(self._residual))
            if z is None:
                return None
            thrusts = thrusts + UNIT_N * z.reshape(-1, 4)
        return thrusts

    def flown(self, x: np.ndarray, thrusts: np.ndarray, d: np.ndarray) -> np.ndarray:
        """States (N + 1, 17) from x (17) under thrusts (N, 4)."""
        start, given, steady, _ = self._rollout.given
        start[:], given[:], steady[:] = x, thrusts, d
        return np.concatenate([x[None], self._rollout()[0]])
