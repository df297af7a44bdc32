"""The dense quadratic programs of predictive control, by DAQP or by OSQP: one call, an answer or none."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from nanobench_tools.errors import MissingExtraError

MOST_ITERATIONS = 400
TOLERANCE = 1e-5


def import_solver(name: str) -> Any:
    """The module osqp or daqp; raises MissingExtraError when an extra is not installed."""
    try:
        return __import__(name)
    except ImportError:
        raise MissingExtraError(name, "mpc") from None


class DenseSolver(Protocol):
    """min 1/2 z'Hz + g'z with low <= z <= high; None when no answer was found."""

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray | None: ...


class Daqp:
    """A dual active-set method (Arnstrom, Bemporad, Axehill 2022, doi:10.1109/TAC.2022.3176430): exact."""

    def __init__(self) -> None:
        self._solve = import_solver("daqp").solve

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray | None:
        z, _, flag, _ = self._solve(h, g, np.zeros((0, len(g))), high, low, np.zeros(len(g), np.intc),
                                    iter_limit=MOST_ITERATIONS)
        return z if flag == 1 and np.isfinite(z).all() else None


class DenseOsqp:
    """Operator splitting (Stellato et al. 2020, doi:10.1007/s12532-020-00179-2) on the same dense program."""

    def __init__(self) -> None:
        self._osqp = import_solver("osqp")
        self._solver: Any = None

    def __call__(self, h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray | None:
        from scipy import sparse

        n = len(g)
        if self._solver is None:
            rows, cols = np.triu_indices(n)
            order = np.lexsort((rows, cols))  # column by column
            self._rows, self._cols = rows, cols = rows[order], cols[order]
            pattern = sparse.csc_matrix((h[rows, cols], (rows, cols)), (n, n))
            self._solver = self._osqp.OSQP()
            self._solver.setup(pattern, g, sparse.eye(n, format="csc"), low, high, verbose=False, eps_abs=TOLERANCE,
                               eps_rel=TOLERANCE, max_iter=MOST_ITERATIONS * 10, warm_starting=True)
        else:
            self._solver.update(Px=h[self._rows, self._cols], q=g, l=low, u=high)
        found = self._solver.solve(raise_error=False)
        return found.x if found.info.status_val == 1 and np.isfinite(found.x).all() else None
