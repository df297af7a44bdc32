"""The sparse quadratic program of predictive control, states left in, by OSQP: factorised anew at every call.

Unknowns: errors of the states 1..N and changes of the inputs 0..N-1, each in units of equal cost. Also by how much
each stage may exceed the tilt limit (``tilt_bounds``).
"""

from typing import Any

import numpy as np
from scipy import sparse

from .condense import headed
from .dense_qp import MISSED, import_solver, refusals
from .tilt_bounds import ROUNDS, halfplanes

TOLERANCE, MOST_ITERATIONS = 1e-5, 2000
"""A tenth of the accuracy is not enough for a vehicle with slow motors and little inertia: it swings."""
FAR = 1e3
"""Bounds of half-planes that do not count: rows change no kind, which OSQP does not take with a new matrix."""
FREE_UNIT = np.array([0.05])
"""N: unit of rotor states, which cost nothing."""


class SparseOsqp:
    """Of one vehicle. ``q`` (S,) diagonal, p (S, S) terminal, r (4, 4): weights as in ``condense``; ``pattern``: which
    entries of A (S, S) and B (S, 4) may be other than zero."""

    def __init__(self, horizon: int, q: np.ndarray, p: np.ndarray, r: np.ndarray,
                 pattern: tuple[np.ndarray, np.ndarray]) -> None:
        self._n, self._s, self._p, self._r, self._pattern = horizon, len(q), p, r, pattern
        self._q = q
        self._unit = np.where(q > 0.0, 1.0 / np.sqrt(np.maximum(q, 1e-12)), FREE_UNIT)
        self._unit_u = 1.0 / np.sqrt(np.diag(r))
        self._solver: Any = None
        self._normal, self._most = np.zeros((horizon, 3)), np.full(horizon, FAR)
        self._module = import_solver("osqp")

    def _cost(self, yaw: float) -> np.ndarray:
        """Values of the upper triangle of the cost, column by column: diagonal, terminal block, inputs."""
        s, n = self._s, self._n
        turned = np.empty_like(self._p)
        headed(self._p, yaw, turned)
        turned *= self._unit[:, None] * self._unit
        upper = np.concatenate([turned[:j + 1, j] for j in range(s)])
        diagonal = np.tile(self._q * self._unit**2, n - 1)
        r = self._r * self._unit_u[:, None] * self._unit_u
        return np.concatenate([diagonal, upper, np.tile(np.concatenate([r[:j + 1, j] for j in range(4)]), n),
                               np.ones(n)])

    def _set_up(self, a: np.ndarray, b: np.ndarray) -> None:
        (has_a, has_b), s, n = self._pattern, self._s, self._n
        block = sparse.csc_matrix(np.triu(np.ones((s, s))))
        four = sparse.csc_matrix(np.triu(np.ones((4, 4))))
        cost = sparse.block_diag([sparse.eye(s * (n - 1)), block, *[four] * n], format="csc")
        cost = sparse.block_diag([cost, sparse.eye(n)], format="csc")
        entries = []  # row, column, where the value comes from: a, b, half-planes, -1 to -3 the constants at the end
        for k in range(n):
            i, j = np.nonzero(has_a if k else np.zeros((s, s), bool))
            entries.append((s * k + i, s * (k - 1) + j, (k * s + i) * s + j))
            i, j = np.nonzero(has_b)
            entries.append((s * k + i, s * n + 4 * k + j, a.size + (k * 4 + j) * s + i))
        states, inputs = np.arange(s * n), s * n + np.arange(4 * n)
        entries += [(states, states, np.full(s * n, -2)), (inputs, inputs, np.full(4 * n, -1))]
        stages = np.arange(n)
        halves, missed = ((s + 4) * n + stages for _ in range(2))
        for c in range(3):
            entries.append((halves, s * stages + 6 + c, a.size + b.size + 3 * stages + c))
        entries.append((halves, missed, np.full(n, -3)))
        row, col, taken = (np.concatenate(x) for x in zip(*entries, strict=True))
        order = np.lexsort((row, col))
        self._row, self._col, self._taken = row[order], col[order], taken[order]
        units = np.concatenate([np.tile(self._unit, n), np.tile(self._unit_u, n), np.ones(n)])
        self._factor = units[self._col] / units[self._row]
        matrix = sparse.csc_matrix((np.ones(len(order)), (self._row, self._col)), ((s + 5) * n, (s + 5) * n))
        matrix.data = self._values(a, b)
        cost.data = self._cost(0.0)
        zero = np.zeros((s + 5) * n)
        solver = self._module.OSQP()
        with refusals(self._module):
            solver.setup(cost, zero, matrix, zero, zero, verbose=False, eps_abs=TOLERANCE, eps_rel=TOLERANCE,
                         max_iter=MOST_ITERATIONS, warm_starting=True, check_termination=10, adaptive_rho=True,
                         rho=0.5, scaling=0)
        self._solver = solver
        self._yaw = 0.0

    def _values(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Of the constraint matrix in the order of its columns."""
        whole = np.concatenate([a.ravel(), b.ravel(), self._normal.ravel(), [-MISSED, -1.0, 1.0]])
        return np.asarray(whole[self._taken] * self._factor)

    def __call__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, start: np.ndarray, yaw: float, low: np.ndarray,
                 high: np.ndarray, targets: np.ndarray, radius: float) -> np.ndarray | None:
        """Changes (N, 4) N, or None.

        - a (N, S, S), b (N, 4, S) transposed, c (N, S), start (S,).
        - Bounds of the changes (N, 4) N, targets (N + 1, 17), sine of the most tilt."""
        self._most[:] = FAR
        if self._solver is None:
            self._set_up(a, b)
        fixed = c.copy()
        fixed[0] += a[0] @ start
        fixed = (-fixed / self._unit).ravel()
        least, most = (np.concatenate([fixed, (bound / self._unit_u).ravel(), np.full(self._n, -FAR)])
                       for bound in (low, high))
        cost: dict[str, np.ndarray] = {}
        if abs(yaw - self._yaw) > 1e-3:
            cost["Px"], self._yaw = self._cost(yaw), yaw
        answer = self._solved(a, b, least, most, **cost)
        for _ in range(ROUNDS):
            if answer is None:
                break
            turns = answer[:self._s * self._n].reshape(self._n, self._s)[:, 6:9] * self._unit[6:9]
            if not halfplanes(targets, turns, radius, self._normal, self._most):
                break
            most[-self._n:] = self._most
            tipped, answer = answer, self._solved(a, b, least, most)
            if answer is None:  # better tipped than without a plan
                answer = tipped
                break
        if answer is None:
            return None
        return answer[self._s * self._n:(self._s + 4) * self._n].reshape(-1, 4) * self._unit_u

    def _solved(self, a: np.ndarray, b: np.ndarray, least: np.ndarray, most: np.ndarray,
                **more: Any) -> np.ndarray | None:
        with refusals(self._module):
            self._solver.update(Ax=self._values(a, b), l=least, u=most, **more)
            found = self._solver.solve(raise_error=False)
        return found.x if found.info.status_val in (1, 2) and np.isfinite(found.x).all() else None
