"""Linear time-varying predictive control: the equations linearised along the targets of the reference.

``mpc_daqp`` condenses the program to the inputs and solves it by an active-set method. With ``solver="osqp"`` it
solves the same program by operator splitting; ``mpc_osqp`` leaves the states in and solves the sparse program.
"""

import math
from typing import Any

import numba as nb
import numpy as np

from nanobench_tools.errors import UsageError
from nanobench_tools.slices import put

from .condense import UNIT_N, condensed
from .dense_qp import Daqp, DenseOsqp, DenseSolver, import_solver
from .prediction_model import stage_pattern
from .predictive_base import Mpc
from .sparse_qp import SparseOsqp
from .tilt_bounds import ROUNDS, left, rows_of

SOLVERS: dict[str, type[Daqp] | type[DenseOsqp]] = {"daqp": Daqp, "osqp": DenseOsqp}


class Linearised(Mpc):
    """Stages linearised along targets: (a, b, c, dx_0) of the errors against them."""

    def linearise(self, x: np.ndarray, targets: np.ndarray, inputs: np.ndarray, d: np.ndarray,
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """a (N, S, S), b (N, 4, S) transposed, c (N, S), dx_0 (S,)."""
        n, s = self.horizon, self.states
        states, thrusts, ahead, steady = self._stages.given
        states[:], thrusts[:], ahead[:], steady[:] = targets[:-1], inputs[:-1], targets[1:], d
        c, a, b = self._stages()
        return a.reshape(n, s, s), b.reshape(n, 4, s), c, error(x, targets[0])[:s]


@nb.njit(cache=True)
def error(x: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(16): ``prediction_model.error`` of numbers."""
    (ax, ay, az, aw), (bx, by, bz, bw) = target[6:10], x[6:10]
    w = aw * bw + ax * bx + ay * by + az * bz
    sign = 2.0 if w >= 0.0 else -2.0
    out = np.empty(16)
    put(out, x[:6] - target[:6])
    put(out[9:], x[10:] - target[10:])
    out[6] = sign * (aw * bx - ax * bw - ay * bz + az * by)
    out[7] = sign * (aw * by + ax * bz - ay * bw - az * bx)
    out[8] = sign * (aw * bz - ax * by + ay * bx - az * bw)
    return out


class MpcDaqp(Linearised):
    """Linear predictive control: the condensed program, solved by an active-set method.

    Parameters
    ----------
    solver : str
        ``daqp``, or ``osqp`` for operator splitting.
    *arguments, **keywords
        As of ``Mpc``: model, delay_s, horizon, dt_s, weights, tuning, gains and others.

    Raises
    ------
    UsageError
        For an unknown solver.
    MissingExtraError
        Without the solver.
    """

    name = "mpc_daqp"

    def __init__(self, *arguments: Any, solver: str = "daqp", **keywords: Any) -> None:
        if solver not in SOLVERS:
            raise UsageError(f"unknown solver {solver!r}; known: {', '.join(SOLVERS)}")
        super().__init__(*arguments, **keywords)
        self._solver: DenseSolver = SOLVERS[solver]()
        wide = 4 * self.horizon
        self.h, self.g = np.zeros((wide, wide)), np.zeros(wide)
        self._p = np.zeros_like(self.p)
        self._residual = np.zeros((self.horizon + 1, self.states))
        self._bounds = np.zeros((2, wide))
        self._turns, self._fixed = np.zeros((self.horizon, 3, wide)), np.zeros((self.horizon, 3))
        self._turned, self._normal = np.zeros((2, self.horizon, 3))
        self._bound = np.zeros(self.horizon)
        self._rows, self._most = np.zeros((self.horizon, wide)), np.zeros(self.horizon)

    def _rehearse(self) -> None:
        super()._rehearse()
        self._bound[:] = 0.0
        count = rows_of(self._turns, self._fixed, self._normal, self._bound, self._rows, self._most)
        low, high = self._bounds
        self._solver(self.h, self.g, low, high, self._rows[:count], self._most[:count])
        self._solver = type(self._solver)()  # one that starts from nothing

    def reset(self, n: int) -> None:
        super().reset(n)
        self._multipliers: list[np.ndarray | None] = [None] * n

    def solve(self, i: int, x: np.ndarray, yaw: float, targets: np.ndarray, inputs: np.ndarray, least: np.ndarray,
              most: np.ndarray) -> np.ndarray | None:
        a, b, c, start = self.linearise(x, targets, inputs, self.observer.disturbance[i])
        about = inputs[:-1]
        condensed(a, b, c, start, self._residual, self.q, self.p, yaw, self._p, self.r, about, about, least, most,
                  self.h, self.g, self._turns, self._fixed, self._bounds)
        z = self.program(i, targets, self.horizon)
        return None if z is None else about + UNIT_N * z.reshape(-1, 4)

    def program(self, i: int, targets: np.ndarray, stages: int) -> np.ndarray | None:
        """Solution z (4 N) of the condensed program of vehicle i within bounds. The tilt stays below ``tilt_rad`` over
        the first ``stages``."""
        low, high = self._bounds
        z = self._solver(self.h, self.g, low, high, start=self._multipliers[i])
        given = self._solver.multipliers
        self._multipliers[i] = given if given is not None and given.any() else None
        if z is None:
            return None
        radius = math.sin(self.tilt_rad)
        self._bound[:] = np.nan
        for _ in range(ROUNDS):
            if not left(self._turns, self._fixed, z, targets, stages, radius, self._turned, self._normal, self._bound):
                return z
            count = rows_of(self._turns, self._fixed, self._normal, self._bound, self._rows, self._most)
            found = self._solver(self.h, self.g, low, high, self._rows[:count], self._most[:count], given)
            if found is None:  # better tipped than without a plan
                return z
            z = found
        return z


class MpcOsqp(Linearised):
    """Linear predictive control: the sparse program, solved by operator splitting.

    Parameters
    ----------
    *arguments, **keywords
        As of ``Mpc``: model, delay_s, horizon, dt_s, weights, tuning, gains and others.

    Raises
    ------
    MissingExtraError
        Without OSQP.
    """

    name = "mpc_osqp"

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        import_solver("osqp")
        self._pattern = stage_pattern(self.model, self.dt_s, self.states)

    def reset(self, n: int) -> None:
        super().reset(n)
        # one a vehicle: each starts from its own last answer
        self._solvers = [SparseOsqp(self.horizon, self.q, self.p, self.r, self._pattern) for _ in range(n)]

    def solve(self, i: int, x: np.ndarray, yaw: float, targets: np.ndarray, inputs: np.ndarray, least: np.ndarray,
              most: np.ndarray) -> np.ndarray | None:
        a, b, c, start = self.linearise(x, targets, inputs, self.observer.disturbance[i])
        found = self._solvers[i](a, b, c, start, yaw, least - inputs[:-1], most - inputs[:-1], targets,
                                 math.sin(self.tilt_rad))
        return None if found is None else inputs[:-1] + found
