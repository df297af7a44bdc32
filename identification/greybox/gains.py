"""Per-window values of nuisances as a linear function of what was known at the start of the window.

The gains are learnt on whole training flights: they make the 50-step errors small to first order (the derivatives of
the rollout are exact), with the same robust cost as the fit. A test flight gives features, never gains.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .residuals import robust
from .solve import Nuisance, Problem, flown_errors

REWEIGHTED = 3


def learn_gains(problem: Problem, shared: np.ndarray, features: np.ndarray, nuisances: Sequence[Nuisance],
                ridge: float) -> np.ndarray:
    """Gains (N, F) that make the errors of ``problem.data`` small; features (n, F) of its windows; ``ridge`` of
    the mean curvature holds them back."""
    sizes = features.std(axis=0)
    sizes = np.where(sizes > 1e-9, sizes, np.maximum(np.abs(features).max(axis=0, initial=0.0), 1e-9))
    unit, spread = features / sizes, np.array([n.sd for n in nuisances])
    patterns = np.array([n.vector(problem.model) for n in nuisances]).T * spread
    none = np.zeros((len(problem.data.names), 0))
    parts = [(e, s) for _, e, s in flown_errors(problem, shared, none, patterns)]
    found, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
    count, wide = len(nuisances), unit.shape[1]
    gain = np.zeros((count, wide))
    for _ in range(REWEIGHTED):
        left = found + np.einsum("nkgcA,nA->nkgc", slopes, unit @ gain.T, optimize=True)
        scale = np.mean(np.linalg.norm(left, axis=-1), axis=0)
        pull = robust(left, scale, np.full(scale.shape, 1.0 / scale.size))[1]
        rooted = slopes * np.sqrt(pull)[..., None, None]
        rows = rooted.reshape(len(unit), -1, count)
        curvature = rows.transpose(0, 2, 1) @ rows
        slope = np.einsum("nrA,nr->nA", rows, (found * np.sqrt(pull)[..., None]).reshape(len(unit), -1), optimize=True)
        matrix = np.empty((count, wide, count, wide))
        for i in range(count):
            for j in range(count):
                matrix[i, :, j] = (unit * curvature[:, i, j, None]).T @ unit
        matrix = matrix.reshape(count * wide, count * wide)
        matrix[np.diag_indices_from(matrix)] += ridge * np.trace(matrix) / len(matrix)
        gain = -np.linalg.solve(matrix, (slope.T @ unit).ravel()).reshape(count, wide)
    return spread[:, None] * gain / sizes
