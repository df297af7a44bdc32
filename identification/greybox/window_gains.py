"""Per-window values of nuisances as a linear function of what was known at the start of the window.

The gains are learned on whole training flights. They minimise the 50-step errors to first order (the derivatives of
the rollout are exact), with the same robust cost as the fit. Roll and pitch share theirs, see ``symmetry``. How much
they are held back follows from training flights left out in turn. A test flight gives features, never gains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from nanobench_tools.settings import count, setting

from .residuals import robust
from .solve import Nuisance, Problem, flown_errors
from .symmetry import Features

RIDGES = setting("greybox.window_gains.ridges")
REWEIGHTED = 3
FOLDS = count("greybox.window_gains.folds")
FEWEST_FLIGHTS = count("greybox.window_gains.fewest_flights")
LEAST = 1e-9
"""Features smaller than this are nothing."""


@dataclass(frozen=True)
class _Seen:
    """Inputs of one nuisance: the columns of the features with sign and size, and the place of its gains in the vector
    of all. The last gain is its constant."""

    column: np.ndarray
    factor: np.ndarray
    place: np.ndarray

    def design(self, features: np.ndarray) -> np.ndarray:
        return np.column_stack([features[:, self.column] * self.factor, np.ones(len(features))])

    def gains(self, learnt: np.ndarray, width: int) -> np.ndarray:
        """(F + 1,), the constant last."""
        found = np.zeros(width + 1)
        found[self.column], found[-1] = learnt[self.place[:-1]] * self.factor, learnt[self.place[-1]]
        return found


def _seen(features: Features, nuisances: Sequence[Nuisance]) -> tuple[list[_Seen], int]:
    """For every nuisance, and how many gains there are in all."""
    size = np.sqrt(np.mean(features.matrix() ** 2, axis=0))
    found, blocks, count = [], {}, 0
    for nuisance in nuisances:
        column, sign = (np.array(part) for part in zip(*features.views[nuisance.side], strict=True))
        usual, key = size[column], (nuisance.family, nuisance.side)
        if nuisance.side in ("roll", "pitch"):
            other = np.array([c for c, _ in features.views["pitch" if nuisance.side == "roll" else "roll"]])
            usual, key = np.sqrt((size[column] ** 2 + size[other] ** 2) / 2.0), (nuisance.family, "both")
        if key not in blocks:
            blocks[key] = np.arange(count, count + len(column))
            count += len(column)
        found.append(_Seen(column, sign / np.maximum(usual, LEAST), np.append(blocks[key], count)))
        count += 1
    return found, count


def learn_gains(problem: Problem, shared: np.ndarray, features: Features,
                nuisances: Sequence[Nuisance]) -> tuple[np.ndarray, float]:
    """Gains (N, F + 1), the last a constant, that minimise the errors of ``problem.data``. Also their ridge (inf: no
    gains); features of its windows."""
    matrix, flight = features.matrix(), problem.data.flight
    spread = np.array([n.sd for n in nuisances])
    if len(np.unique(flight)) < FEWEST_FLIGHTS:
        return np.zeros((len(nuisances), matrix.shape[1] + 1)), np.inf
    seen, count = _seen(features, nuisances)
    designs = [one.design(matrix) for one in seen]
    patterns, starts = (np.array([of(n) for n in nuisances]).T * spread
                        for of in (lambda n: n.vector(problem.model), Nuisance.start))
    none = np.zeros((len(problem.data.names), 0))
    parts = [(e, s) for _, e, s in flown_errors(problem, shared, none, patterns, starts)]
    found, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
    learnt, ridge = np.zeros(count), RIDGES[-1]
    for _ in range(REWEIGHTED):
        own = np.column_stack([x @ learnt[one.place] for one, x in zip(seen, designs, strict=True)])
        left = found + np.einsum("nkgcA,nA->nkgc", slopes, own, optimize=True)
        scale = np.mean(np.linalg.norm(left, axis=-1), axis=0)
        root = np.sqrt(robust(left, scale, np.full(scale.shape, 1.0 / scale.size))[1])[..., None]
        rows = (slopes * root[..., None]).reshape(len(matrix), -1, len(nuisances))
        curvature = rows.transpose(0, 2, 1) @ rows
        slope = np.einsum("nrA,nr->nA", rows, (found * root).reshape(len(matrix), -1), optimize=True)
        by_flight = [_equations(seen, [x[mine] for x in designs], curvature[mine], slope[mine], count)
                     for mine in (flight == f for f in np.unique(flight))]
        ridge = min(RIDGES, key=lambda r: _held_out(by_flight, r))
        learnt = _solved(*_added(by_flight), ridge)
    return spread[:, None] * np.array([one.gains(learnt, matrix.shape[1]) for one in seen]), ridge


def _equations(seen: Sequence[_Seen], designs: Sequence[np.ndarray], curvature: np.ndarray, slope: np.ndarray,
               count: int) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of the gains of some windows, (count, count) and (count,)."""
    matrix, right = np.zeros((count, count)), np.zeros(count)
    for i, (one, x) in enumerate(zip(seen, designs, strict=True)):
        right[one.place] += slope[:, i] @ x
        for j, (other, y) in enumerate(zip(seen, designs, strict=True)):
            matrix[np.ix_(one.place, other.place)] += (x * curvature[:, i, j, None]).T @ y
    return matrix, right


def _added(equations: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    matrices, rights = zip(*equations, strict=True)
    return np.sum(matrices, axis=0), np.sum(rights, axis=0)


def _solved(matrix: np.ndarray, right: np.ndarray, ridge: float) -> np.ndarray:
    """Positive definite by the ridge, even for uninformative features."""
    held = matrix + ridge * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
    return np.asarray(-cho_solve(cho_factor(held, overwrite_a=True, check_finite=False), right, check_finite=False))


def _held_out(by_flight: Sequence[tuple[np.ndarray, np.ndarray]], ridge: float) -> float:
    """Cost, against no gains at all, of flights that did not give the gains; FOLDS of them at a time are left out."""
    whole_matrix, whole_right = _added(by_flight)
    total = 0.0
    for fold in range(min(FOLDS, len(by_flight))):
        matrix, right = _added(by_flight[fold::FOLDS])
        gain = _solved(whole_matrix - matrix, whole_right - right, ridge)
        total += float(right @ gain + 0.5 * gain @ matrix @ gain)
    return total
