"""Exact inference in a hidden Markov chain whose state is one number on a grid and moves by small steps.

Forward-backward in the scaled form of Rabiner, "A tutorial on hidden Markov models" (1989), eq. 19-27. The transition
is banded and may differ from row to row. Cost: rows x states x band.
"""

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, fastmath=True)
def posterior(log_likelihood: np.ndarray, log_transition: np.ndarray, up: int, causal: bool) -> np.ndarray:
    """(n, m) probabilities of the states given all rows (causal: given the rows up to each one).

    - log_likelihood (n, m).
    - log_transition (n, b): row i holds the log weight of the step from row i - 1 in cells. Row 0 is not used.
      Column c is a step of c - (b - 1 - up), so at most ``up`` cells upward.
    """
    n, m = log_likelihood.shape
    width = log_transition.shape[1]
    low = width - 1 - up
    alpha = np.empty((n, m))
    weight = np.empty(m)
    _normalised(log_likelihood[0], alpha[0])
    for i in range(1, n):
        alpha[i] = 0.0
        top = log_transition[i].max()
        for c in range(width):  # the inner loop runs over states that lie side by side, so that it is vectorised
            step = math.exp(log_transition[i, c] - top)
            shift = c - low
            if shift >= 0:
                for j in range(shift, m):
                    alpha[i, j] += alpha[i - 1, j - shift] * step
            else:
                for j in range(m + shift):
                    alpha[i, j] += alpha[i - 1, j - shift] * step
        _normalised(log_likelihood[i], weight)
        total = 0.0
        for j in range(m):
            alpha[i, j] *= weight[j]
            total += alpha[i, j]
        for j in range(m):  # where the evidence contradicts itself: start afresh rather than carry zeros
            alpha[i, j] = alpha[i, j] / total if total > 0.0 else 1.0 / m
    if causal:
        return alpha
    beta = np.ones(m)
    weighted = np.empty(m)
    for i in range(n - 2, -1, -1):
        top = log_transition[i + 1].max()
        _normalised(log_likelihood[i + 1], weight)
        for j in range(m):
            weighted[j] = weight[j] * beta[j]
        beta[:] = 0.0
        for c in range(width):
            step = math.exp(log_transition[i + 1, c] - top)
            shift = c - low
            if shift >= 0:
                for k in range(m - shift):
                    beta[k] += weighted[k + shift] * step
            else:
                for k in range(-shift, m):
                    beta[k] += weighted[k + shift] * step
        total = beta.sum()
        scale = m / total if total > 0.0 else 0.0
        for k in range(m):
            beta[k] = beta[k] * scale if total > 0.0 else 1.0
        total = 0.0
        for k in range(m):
            alpha[i, k] *= beta[k]
            total += alpha[i, k]
        for k in range(m):
            alpha[i, k] = alpha[i, k] / total if total > 0.0 else 1.0 / m
    return alpha


@nb.njit(cache=True, fastmath=True)
def _normalised(log_weight: np.ndarray, result: np.ndarray) -> None:
    """exp of (m,) ``log_weight`` into ``result``, scaled to sum to 1."""
    top = log_weight.max()
    total = 0.0
    for j in range(len(log_weight)):
        result[j] = math.exp(log_weight[j] - top)
        total += result[j]
    for j in range(len(log_weight)):
        result[j] /= total


@nb.njit(cache=True, fastmath=True)
def add_student_evidence(log_likelihood: np.ndarray, row: np.ndarray, cell: np.ndarray, predicted: np.ndarray,
                         measured: np.ndarray, sigma: np.ndarray, weight: float, first_state: int,
                         stride: int = 1) -> None:
    """Adds to (n, m) ``log_likelihood`` how well each delay explains each sample; in place.

    - row (s,): chain row of the sample.
    - cell (s,): its timestamp on the fine grid of ``predicted`` (g, k). In state j the sample shows
      cell - (j + first_state) stride.
    - measured (s, k), sigma (k,): in the unit of the stream.

    Student t with 6 degrees of freedom, so that a spike cannot vote more than about twice; ``weight`` < 1 where
    neighbouring errors are alike.
    """
    degrees = 6.0
    m = log_likelihood.shape[1]
    cells, channels = predicted.shape
    for s in range(len(row)):
        for j in range(m):
            g = min(max(cell[s] - (j + first_state) * stride, 0), cells - 1)
            squared = 0.0
            for k in range(channels):
                z = (measured[s, k] - predicted[g, k]) / sigma[k]
                squared += z * z
            log_likelihood[row[s], j] -= 0.5 * weight * degrees * math.log(1.0 + squared / degrees)  # four times log1p


@nb.njit(cache=True, fastmath=True)
def log_evidence(log_likelihood: np.ndarray, log_transition: np.ndarray, up: int) -> float:
    """Logarithm of the sum over all paths of what ``posterior`` weighs them with, the first row's states alike."""
    n, m = log_likelihood.shape
    width = log_transition.shape[1]
    low = width - 1 - up
    alpha, before = np.empty(m), np.empty(m)
    weight = np.empty(m)
    _normalised(log_likelihood[0], alpha)
    total = _log_sum(log_likelihood[0]) - math.log(m)
    for i in range(1, n):
        for j in range(m):
            before[j], alpha[j] = alpha[j], 0.0
        top = log_transition[i].max()
        for c in range(width):
            step = math.exp(log_transition[i, c] - top)
            shift = c - low
            if shift >= 0:
                for j in range(shift, m):
                    alpha[j] += before[j - shift] * step
            else:
                for j in range(m + shift):
                    alpha[j] += before[j - shift] * step
        _normalised(log_likelihood[i], weight)
        scale = 0.0
        for j in range(m):
            alpha[j] *= weight[j]
            scale += alpha[j]
        if scale <= 0.0:
            return -np.inf
        for j in range(m):
            alpha[j] /= scale
        total += math.log(scale) + top + _log_sum(log_likelihood[i])
    return total


@nb.njit(cache=True, fastmath=True)
def _log_sum(log_weight: np.ndarray) -> float:
    top: float = log_weight.max()
    total = 0.0
    for j in range(len(log_weight)):
        total += math.exp(log_weight[j] - top)
    return top + math.log(total)
