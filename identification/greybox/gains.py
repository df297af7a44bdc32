"""Per-window values of nuisances as a linear function of what was known at the start of the window.

The gains are learnt on whole training flights: they make the 50-step errors small to first order (the derivatives of
the rollout are exact), with the same robust cost as the fit. How much they are held back follows from training flights
left out in turn. A test flight gives features, never gains.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .residuals import robust
from .solve import Nuisance, Problem, flown_errors

RIDGES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
"""Of the mean curvature."""
REWEIGHTED = 3
FOLDS = 5
FEWEST_FLIGHTS = 3
"""Fewer flights cannot be left out in turn: no gains are learnt from them."""


def learn_gains(problem: Problem, shared: np.ndarray, features: np.ndarray,
                nuisances: Sequence[Nuisance]) -> tuple[np.ndarray, float]:
    """Gains (N, F) that make the errors of ``problem.data`` small, and the ridge that held them back (inf: no gains);
    features (n, F) of its windows."""
    sizes = features.std(axis=0)
    sizes = np.where(sizes > 1e-9, sizes, np.maximum(np.abs(features).max(axis=0, initial=0.0), 1e-9))
    unit, spread = features / sizes, np.array([n.sd for n in nuisances])
    patterns = np.array([n.vector(problem.model) for n in nuisances]).T * spread
    none = np.zeros((len(problem.data.names), 0))
    parts = [(e, s) for _, e, s in flown_errors(problem, shared, none, patterns)]
    found, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
    gain = np.zeros((len(nuisances), unit.shape[1]))
    if len(np.unique(problem.data.flight)) < FEWEST_FLIGHTS:
        return gain, np.inf
    ridge = RIDGES[len(RIDGES) // 2]
    for _ in range(REWEIGHTED):
        left = found + np.einsum("nkgcA,nA->nkgc", slopes, unit @ gain.T, optimize=True)
        scale = np.mean(np.linalg.norm(left, axis=-1), axis=0)
        root = np.sqrt(robust(left, scale, np.full(scale.shape, 1.0 / scale.size))[1])[..., None]
        rows = (slopes * root[..., None]).reshape(len(unit), -1, len(nuisances))
        curvature = rows.transpose(0, 2, 1) @ rows
        slope = np.einsum("nrA,nr->nA", rows, (found * root).reshape(len(unit), -1), optimize=True)
        by_flight = [_equations(unit[mine], curvature[mine], slope[mine])
                     for mine in (problem.data.flight == f for f in np.unique(problem.data.flight))]
        ridge = min(RIDGES, key=lambda r: _held_out(by_flight, r))
        gain = _solved(*_added(by_flight), ridge).reshape(gain.shape)
    return spread[:, None] * gain / sizes, ridge


def _equations(unit: np.ndarray, curvature: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of the gains of some windows, (N F, N F) and (N F,)."""
    count, wide = slope.shape[1], unit.shape[1]
    matrix = np.empty((count, wide, count, wide))
    for i in range(count):
        for j in range(i + 1):
            matrix[i, :, j] = (unit * curvature[:, i, j, None]).T @ unit
            matrix[j, :, i] = matrix[i, :, j].T
    return matrix.reshape(count * wide, count * wide), (slope.T @ unit).ravel()


def _added(equations: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    matrices, rights = zip(*equations, strict=True)
    return np.sum(matrices, axis=0), np.sum(rights, axis=0)


def _solved(matrix: np.ndarray, right: np.ndarray, ridge: float) -> np.ndarray:
    return -np.linalg.solve(matrix + ridge * np.trace(matrix) / len(matrix) * np.eye(len(matrix)), right)


def _held_out(by_flight: Sequence[tuple[np.ndarray, np.ndarray]], ridge: float) -> float:
    """Cost, against no gains at all, of flights that did not give the gains; FOLDS of them at a time are left out."""
    whole_matrix, whole_right = _added(by_flight)
    total = 0.0
    for fold in range(min(FOLDS, len(by_flight))):
        matrix, right = _added(by_flight[fold::FOLDS])
        gain = _solved(whole_matrix - matrix, whole_right - right, ridge)
        total += float(right @ gain + 0.5 * gain @ matrix @ gain)
    return total
