"""The dense quadratic programs of predictive control, by DAQP or by OSQP: one call, an answer or none."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from nanobench_tools.errors import MissingExtraError

from .casadi_code import SolverFailure

MOST_ITERATIONS = 400
TOLERANCE = 1e-5
SOFT, SOLVED = 8, (1, 2)
"""DAQP's words for a row that may be missed, and for answers: 2 is one that misses a row."""
FAR = 1e30
MISSED = 1e-2
"""A row that is missed by this costs 1/2, as it does in DAQP."""


def import_solver(name: str) -> Any:
    """The module osqp or daqp; raises MissingExtraError when an extra is not installed."""
    try:
        return __import__(name)
    except ImportError:
        raise MissingExtraError(name, "mpc") from None


@contextmanager
def refusals(osqp: Any) -> Iterator[None]:
    """Makes SolverFailure of what OSQP raises: a program that is not convex, bounds that contradict each other."""
    try:
        yield
    except osqp.OSQPException as refused:
        raise SolverFailure(f"OSQP refuses the program: {refused}") from refused


class DenseSolver(Protocol):
    """min 1/2 z'Hz + g'z with low <= z <= high and, where that is possible, rows z <= most; None when no answer was
    found. ``start``: multipliers of a program that was much the same, from ``multipliers`` after it was solved."""

    multipliers: np.ndarray | None

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, rows: np.ndarray | None = None,
                 most: np.ndarray | None = None, start: np.ndarray | None = None) -> np.ndarray | None: ...


class Daqp:
    """A dual active-set method (Arnstrom, Bemporad, Axehill 2022, doi:10.1109/TAC.2022.3176430): exact,
    within so many ``iterations``."""

    def __init__(self, iterations: int | None = None) -> None:
        self._solve, self._iterations = import_solver("daqp").solve, iterations
        self._kinds: dict[tuple[int, int], np.ndarray] = {}
        self.multipliers: np.ndarray | None = None

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, rows: np.ndarray | None = None,
                 most: np.ndarray | None = None, start: np.ndarray | None = None) -> np.ndarray | None:
        more = 0 if rows is None else len(rows)
        if rows is not None and most is not None:
            low, high = np.concatenate([low, np.full(more, -FAR)]), np.concatenate([high, most])
        else:
            rows = np.empty((0, len(g)))
        kind = self._kinds.get((len(g), more))
        if kind is None:
            kind = self._kinds[len(g), more] = np.repeat(np.array([0, SOFT], np.intc), [len(g), more])
        if start is not None and more:
            start = np.concatenate([start[:len(g)], np.zeros(more)])
        # it writes which bounds were active into the kinds
        z, _, flag, info = self._solve(h, g, rows, high, low, kind.copy(), dual_start=start, rho_soft=MISSED**2,
                                       iter_limit=self._iterations or MOST_ITERATIONS)
        self.multipliers = info["lam"][:len(g)]
        return z if flag in SOLVED and np.isfinite(z).all() else None


class DenseOsqp:
    """Operator splitting (Stellato et al. 2020, doi:10.1007/s12532-020-00179-2) on the same dense program."""

    def __init__(self) -> None:
        self._osqp = import_solver("osqp")
        self._solver: Any = None
        self.multipliers: np.ndarray | None = None

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, rows: np.ndarray | None = None,
                 most: np.ndarray | None = None, start: np.ndarray | None = None) -> np.ndarray | None:
        from scipy import sparse

        n = len(g)
        if rows is not None and most is not None:
            return self._with_rows(h, g, low, high, rows, most)
        if self._solver is None:
            rows, cols = np.triu_indices(n)
            order = np.lexsort((rows, cols))  # column by column
            self._rows, self._cols = rows, cols = rows[order], cols[order]
            pattern = sparse.csc_matrix((h[rows, cols], (rows, cols)), (n, n))
            solver = self._osqp.OSQP()
            with refusals(self._osqp):
                solver.setup(pattern, g, sparse.eye(n, format="csc"), low, high, verbose=False, eps_abs=TOLERANCE,
                             eps_rel=TOLERANCE, max_iter=MOST_ITERATIONS * 10, warm_starting=True)
            self._solver = solver
        else:
            with refusals(self._osqp):
                self._solver.update(Px=h[self._rows, self._cols], q=g, l=low, u=high)
        with refusals(self._osqp):
            return self._answer(self._solver.solve(raise_error=False))

    def _with_rows(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, rows: np.ndarray,
                   most: np.ndarray) -> np.ndarray | None:
        """Set up anew, an unknown more to a row: how far it is missed."""
        from scipy import sparse

        n, more = len(g), len(most)
        cost = sparse.block_diag([np.triu(h), sparse.eye(more)], format="csc")
        bounds = sparse.block_array([[sparse.eye(n), None], [rows, -MISSED * sparse.eye(more)]], format="csc")
        solver = self._osqp.OSQP()
        with refusals(self._osqp):
            solver.setup(cost, np.concatenate([g, np.zeros(more)]), bounds, np.concatenate([low, np.full(more, -FAR)]),
                         np.concatenate([high, most]), verbose=False, eps_abs=TOLERANCE, eps_rel=TOLERANCE,
                         max_iter=MOST_ITERATIONS * 10)
            found = self._answer(solver.solve(raise_error=False))
        return None if found is None else found[:n]

    @staticmethod
    def _answer(found: Any) -> np.ndarray | None:
        return found.x if found.info.status_val == 1 and np.isfinite(found.x).all() else None
