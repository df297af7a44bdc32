"""What the data say of columns: forces whitened row by row, moments through instruments.

Rows of 10 ms sample a loop of 500 Hz, so a logged command is the true one plus what shook between the rows, and least
squares shrinks every gain from command to moment. Moments are therefore projected, flight by flight, on instruments
that the shaking does not move: set-points, measured states, and the model's moment some rows before (two-stage least
squares: Wooldridge 2010, Econometric Analysis, ch. 5 and 8). Their covariance is that of a coloured residual (Newey and
West 1987).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.settings import count, number

from ..memory import Memory, runs_of
from ..wrench import FORCE_ROWS, TORQUE_ROWS, Wrench

ORDER = count("posterior.rows.order")
"""Of the autoregression of a force."""
FREEDOM = number("posterior.rows.freedom")
"""Degrees of freedom of the noise of rows (Student t)."""
LAGS: tuple[int, ...] = (2, 3, 4, 6)
"""Stretches before: the shortest ends one stretch before the rate that is differenced, whose noise the command
holds."""
ASKED: tuple[int, ...] = (0, 1, 2, 4)
KEPT = 1e-6
"""Of the largest direction of the instruments: smaller ones say nothing."""
STIFF, FREE, MEDIAN_OF_CHI2 = 0.02, 0.1, 0.455
"""Ridge, per unit of a column's square; least share of a row that a fit leaves free; of one degree of freedom."""
MEMORY = 12
"""Stretches over which a moment's residual remembers."""
ROUNDS = 3


@dataclass(frozen=True)
class ForceAxis:
    """Whitening of one axis: the memory of its residual, and the weight of every judged row."""

    memory: Memory
    weight: np.ndarray

    def of(self, columns: np.ndarray) -> np.ndarray:
        """(N, C) -> (n, C)."""
        found: np.ndarray = self.memory.whiten(columns)[self.memory.judged] * self.weight[:, None]
        return found


@dataclass(frozen=True)
class Turning:
    """Instruments of one axis and flight: (K, n) of the rows ``at`` (n,), in standard deviations of the noise."""

    axis: int
    flight: int
    at: np.ndarray
    ways: np.ndarray


@dataclass(frozen=True)
class Rows:
    """What is asked of columns, as a linear map. ``flight`` (R,) of each row; ``sd`` (3,) of a whitened force m/s^2;
    ``excess`` (3,): how many times the variance of moments is larger than noise makes it, with every effect free."""

    forces: tuple[ForceAxis, ...]
    turnings: tuple[Turning, ...]
    flight: np.ndarray
    sd: np.ndarray
    excess: np.ndarray

    def of(self, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """(N, 3, C) m/s^2 and (M, 3, C) rad/s^2 -> (R, C) in standard deviations."""
        parts = [axis.of(force[:, k]) for k, axis in enumerate(self.forces)]
        parts += [t.ways @ torque[t.at, t.axis] for t in self.turnings]
        return np.concatenate(parts)


def rows_of(wrench: Wrench, residual: tuple[np.ndarray, np.ndarray], force: np.ndarray, torque: np.ndarray,
            prior: np.ndarray) -> Rows:
    """The map for a residual, from what columns (N, 3, C) and (M, 3, C) leave of it; ``prior`` (C,): standard deviation
    of each column's coefficient before any flight."""
    forces, flights, sd = _forces(wrench, residual[0], force, prior)
    turnings, excess = _turnings(wrench, residual[1], torque) if len(wrench.torque_at) else ([], np.ones(3))
    flights += [np.full(len(t.ways), t.flight) for t in turnings]
    return Rows(tuple(forces), tuple(turnings), np.concatenate(flights), sd, excess)


def _ridge(x: np.ndarray) -> np.ndarray:
    """Coefficients (C,) of the last column on the others, each shrunk a little in its own size."""
    size = np.maximum(np.sqrt((x[:, :-1] ** 2).sum(0)), 1e-12)
    a = x[:, :-1] / size
    gram = a.T @ a
    gram[np.diag_indices_from(gram)] += 1e-3
    return np.asarray(np.linalg.solve(gram, a.T @ x[:, -1]) / size)


def _memory(residual: np.ndarray, columns: np.ndarray, prior: np.ndarray, runs: np.ndarray) -> Memory:
    """Autoregression of a residual (n,) beside columns (n, C), each with its prior: hundreds of free ones would leave
    no memory, and what the noise does slowly would be taken for physics (Ljung 1999, System Identification, ch. 10)."""
    lags = np.stack([np.concatenate([np.zeros(lag), residual[:-lag]]) for lag in range(1, ORDER + 1)], axis=1)
    use = runs >= ORDER
    x, y = np.concatenate([lags, columns * prior], axis=1)[use], residual[use]
    gram, right = x.T @ x, x.T @ y
    variance, found = float(np.mean(y**2)), np.zeros(x.shape[1])
    for _ in range(ROUNDS):
        penalty = np.full(len(gram), variance)
        penalty[:ORDER] = 1e-6 * gram[0, 0]
        found = np.linalg.solve(gram + np.diag(penalty), right)
        variance = max(float(np.mean((y - x @ found) ** 2)), 1e-12)
    return Memory(found[:ORDER], runs)


def _forces(wrench: Wrench, residual: np.ndarray, columns: np.ndarray,
            prior: np.ndarray) -> tuple[list[ForceAxis], list[np.ndarray], np.ndarray]:
    at = wrench.force_at
    runs = runs_of(at, FORCE_ROWS, wrench.track)
    both = np.concatenate([columns, residual[..., None]], axis=2)
    parts, flights, sds = [], [], []
    for axis in range(3):
        memory = _memory(residual[:, axis], columns[:, axis], prior, runs)
        x = memory.whiten(both[:, axis])[memory.judged]
        weight = np.ones(len(x))
        left, sd = x[:, -1], 1.0
        for _ in range(ROUNDS):
            z = x * np.sqrt(weight)[:, None]
            left = x[:, -1] - x[:, :-1] @ _ridge(z)
            spread = 1.4826 * float(np.median(np.abs(left))) or 1.0
            weight = (FREEDOM + 1.0) / (FREEDOM + (left / spread) ** 2)
            used = min(0.5, x.shape[1] / max(3 * len(x), 1))
            sd = max(float(np.sqrt(np.mean(weight * left**2) / (1.0 - used))), 1e-6)
        parts.append(ForceAxis(memory, np.sqrt(weight) / sd))
        flights.append(wrench.flight[at][memory.judged])
        sds.append(sd)
    return parts, flights, np.array(sds)


def instruments(wrench: Wrench, axis: int, made: np.ndarray, runs: np.ndarray) -> np.ndarray:
    """(M, K) of the moment about one axis; rows without enough before them are nan."""
    at = wrench.torque_at
    turned = so3.rotate_inverse(wrench.quaternion[at], wrench.of("velocity_m_s", at))
    load = wrench.of("motor", at)
    columns = [np.ones(len(at)), *turned.T, *(turned * np.abs(turned)).T, *wrench.of("position_m", at).T]

    def before(values: np.ndarray, lag: int) -> np.ndarray:
        found = np.full(len(values), np.nan)
        found[lag:] = values[:-lag] if lag else values
        found[runs < lag] = np.nan
        return found

    columns += [before(load.mean(axis=1), lag) for lag in (2, 6)]
    rate = wrench.of("rate_rad_s", at)
    columns += [before(rate[:, k], 2) for k in range(3)]
    columns += [before(made[:, axis], lag) for lag in LAGS]
    asked = so3.rotate_inverse(wrench.quaternion[at], np.concatenate(
        [-wrench.of("asked_rad_s2", at)[:, 1:], wrench.of("asked_rad_s2", at)[:, :1], np.zeros((len(at), 1))], axis=1))
    if np.ptp(asked[:, axis]) > 1e-6:
        columns += [asked[:, axis] if not lag else before(asked[:, axis], lag) for lag in ASKED]
    return np.stack(columns, axis=1)


def _turnings(wrench: Wrench, residual: np.ndarray, columns: np.ndarray) -> tuple[list[Turning], np.ndarray]:
    at = wrench.torque_at
    runs = runs_of(at, TORQUE_ROWS, wrench.track)
    made = wrench.measured[1] - residual
    both = np.concatenate([columns, residual[..., None]], axis=2)
    found, excess = list[Turning](), np.ones(3)
    for axis in range(3):
        given = instruments(wrench, axis, made, runs)
        fine = np.flatnonzero(np.isfinite(given).all(axis=1))
        x, z, flight = both[fine, axis], given[fine], wrench.flight[at][fine]
        if len(x) < 2 * z.shape[1]:
            continue
        z = (z - np.where(np.arange(z.shape[1]) > 0, z.mean(0), 0.0)) / np.where(z.std(0) > 1e-9, z.std(0), 1.0)
        weight, left = np.ones(len(x)), x[:, -1] - x[:, :-1] @ _ridge(x)
        numbers = np.unique(flight)
        ways: list[np.ndarray] = []
        for turn in range(ROUNDS):
            ways = [_ways(z[flight == f], left[flight == f], weight[flight == f]) for f in numbers]
            if turn == ROUNDS - 1:
                break
            whole = np.concatenate([way @ x[flight == f] for way, f in zip(ways, numbers, strict=True)])
            left = x[:, -1] - x[:, :-1] @ _ridge(whole)
            spread = 1.4826 * float(np.median(np.abs(left))) or 1.0
            weight = (FREEDOM + 1.0) / (FREEDOM + (left / spread) ** 2)
        whole = np.concatenate([way @ x[flight == f] for way, f in zip(ways, numbers, strict=True)])
        excess[axis] = max(1.0, _left_over(whole))
        found += [Turning(axis, int(f), fine[flight == f], way / np.sqrt(excess[axis]))
                  for way, f in zip(ways, numbers, strict=True)]
    return found, excess


def _left_over(x: np.ndarray) -> float:
    """Variance of what all columns together leave of the last one, each row by its own leverage, against a median of
    chi squared: 1 where instruments and noise agree."""
    size = np.maximum(np.sqrt((x[:, :-1] ** 2).sum(0)), 1e-12)
    left, singular, _ = np.linalg.svd(x[:, :-1] / size, full_matrices=False)
    shrunk = singular**2 / (singular**2 + STIFF)
    off = x[:, -1] - left @ (shrunk * (left.T @ x[:, -1]))
    free = np.maximum(1.0 - (left**2 * shrunk).sum(1), FREE)
    return float(np.median(off**2 / free) / MEDIAN_OF_CHI2)


def _ways(z: np.ndarray, left: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(K, n): what one flight's instruments z (n, k) ask, in standard deviations of the noise ``left`` (n,)."""
    weighed = z * weight[:, None]
    score = weighed * left[:, None]
    spread = score.T @ score
    for lag in range(1, MEMORY + 1):
        cross = score[lag:].T @ score[:-lag]
        spread += (1.0 - lag / (MEMORY + 1.0)) * (cross + cross.T)
    size, ways = np.linalg.eigh(spread)
    keep = size > KEPT * max(float(size[-1]), 1e-12)
    # a direction whose noise happened to cancel has at least half of what white noise of this size makes
    least = 0.5 * float(np.mean(left**2)) * np.einsum("ki,kl,li->i", ways, weighed.T @ weighed, ways)
    return np.asarray((ways[:, keep].T @ weighed.T) / np.sqrt(np.maximum(size, least)[keep])[:, None])
