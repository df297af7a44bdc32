"""Projection of columns onto the data: forces whitened row by row, moments through instruments.

Rows of 10 ms sample a loop of 500 Hz. A logged command is therefore the true one plus its shaking between the rows, and
least squares shrinks every gain from command to moment. Worse, the controller answers disturbances: commands, rates,
speed and place are all correlated with them. Set-points are not. So moments are compared through instruments that
nothing in the loop moves (generalised method of moments: Hansen 1982; Ljung 1999, System Identification, ch. 13): the
angular acceleration that the set-points require, and one constant a flight. All flights share one set of instruments: a
set for each would follow the shaking (weak instruments: Wooldridge 2010, Econometric Analysis, ch. 5). Without
set-points the instruments are measured states and the model's moment some rows before, flight by flight. The covariance
is that of a coloured residual (Newey and West 1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from nanobench_tools import so3
from nanobench_tools.settings import count, number

from ..memory import Memory, runs_of
from ..track import ROW_S
from ..wrench import FORCE_ROWS, TORQUE_ROWS, Wrench

ORDER = count("posterior.rows.order")
"""Of the autoregression of a force."""
FREEDOM = number("posterior.rows.freedom")
"""Degrees of freedom of the noise of rows (Student t)."""
LAGS: tuple[int, ...] = (2, 3, 4, 6)
"""Stretches before: the shortest ends one stretch before the rate that is differenced, whose noise the command
holds."""
ASKED: tuple[int, ...] = (0, 2, 4, 8, 12, 16)
MOVES = 0.01
"""Fraction of the measured angular acceleration: set-points that require less are at rest, except for rounding in the
log."""
INTEGRALS, KEEPS = 3, float(np.exp(-TORQUE_ROWS * ROW_S / 0.5))
"""Leaky integrals of the angular acceleration that the set-points require, over half a second each."""
KEPT = 1e-6
"""Fraction of the largest direction of the instruments: smaller ones are not informative."""
FREE, MEDIAN_OF_CHI2 = 0.1, 0.455
"""Least share of a row that a fit leaves free; of one degree of freedom."""
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
    """Instruments ``z`` (n, K) of one axis at rows ``at`` (n,) of G ``flights``, which share them; ``flight`` (n,): 0
    .. G - 1. ``together``: whether they are set-points. ``spread`` (G, K, K): covariance of the noise that the
    instruments let through in each."""

    axis: int
    together: bool
    flights: np.ndarray
    flight: np.ndarray
    at: np.ndarray
    z: np.ndarray
    spread: np.ndarray
    _ways: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False)

    def of(self, torque: np.ndarray) -> np.ndarray:
        """(M, 3, C) -> (G, K, C): projection of columns onto the instruments."""
        here = torque[self.at, self.axis]
        return np.stack([self.z[mine].T @ here[mine] for mine in (self.flight == g for g in range(len(self.flights)))])

    def asked(self, seen: np.ndarray, keep: np.ndarray) -> np.ndarray:
        """(G, K, C) -> (K', C), in standard deviations of its noise, of the flights to keep (F,)."""
        keep = keep[self.flights]
        if keep.tobytes() not in self._ways:
            size, ways = np.linalg.eigh(self.spread[keep].sum(0))
            told = size > KEPT * max(float(size[-1]), 1e-12)
            self._ways[keep.tobytes()] = ways[:, told].T / np.sqrt(size[told])[:, None]
        found: np.ndarray = self._ways[keep.tobytes()] @ seen[keep].sum(0)
        return found


@dataclass(frozen=True)
class Seen:
    """Projection of C columns onto the data: forces of each flight (R, C) in standard deviations, and instruments (G,
    K, C)."""

    force: tuple[np.ndarray, ...]
    turning: tuple[np.ndarray, ...]

    def __add__(self, other: Seen) -> Seen:
        """The columns of both."""
        return Seen(*(tuple(np.concatenate(pair, axis=-1) for pair in zip(mine, theirs, strict=True))
                      for mine, theirs in ((self.force, other.force), (self.turning, other.turning))))

    @property
    def many(self) -> int:
        """Columns."""
        return int(self.force[0].shape[-1])


@dataclass(frozen=True)
class Products:
    """Inner products of columns with others: of forces (F, C, C'); of moments both sides."""

    rows: Rows
    force: np.ndarray
    sides: tuple[tuple[np.ndarray, np.ndarray], ...]

    def of(self, keep: np.ndarray) -> np.ndarray:
        """(C, C') over the flights to keep (F,)."""
        found: np.ndarray = self.force[keep].sum(0)
        for turning, (one, other) in zip(self.rows.turnings, self.sides, strict=True):
            if keep[turning.flights].any():
                found = found + turning.asked(one, keep).T @ turning.asked(other, keep)
        return found


@dataclass(frozen=True)
class Rows:
    """Map from columns to their projection onto the data. ``flight`` (R,) of each row of force, 0 .. F - 1; ``sd`` (3,)
    of a whitened force m/s^2; ``excess`` (3,): ratio of the variance of moments to that of noise alone."""

    forces: tuple[ForceAxis, ...]
    turnings: tuple[Turning, ...]
    flight: np.ndarray
    flights: int
    sd: np.ndarray
    excess: np.ndarray

    @property
    def set_point_axes(self) -> set[int]:
        """Axes about which set-points are the instruments of the moments."""
        return {t.axis for t in self.turnings if t.together}

    def of(self, force: np.ndarray, torque: np.ndarray) -> Seen:
        """(N, 3, C) m/s^2 and (M, 3, C) rad/s^2."""
        whole = np.concatenate([axis.of(force[:, k]) for k, axis in enumerate(self.forces)])
        return Seen(tuple(whole[self.flight == f] for f in range(self.flights)),
                    tuple(t.of(torque) for t in self.turnings))

    def seen_of(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3, C) sum of squares of each column (M, 3, C) that the instruments explain, and of the whole column."""
        parts, whole = np.zeros(torque.shape[1:]), np.zeros(torque.shape[1:])
        for t in self.turnings:
            here = torque[t.at, t.axis]
            parts[t.axis] += ((t.z @ np.linalg.lstsq(t.z, here, rcond=None)[0]) ** 2).sum(0)
            whole[t.axis] += (here**2).sum(0)
        return parts, whole

    def products(self, ones: Sequence[Seen], other: Seen) -> Products:
        """Inner products of the columns of all ``ones`` with those of another, flight by flight."""
        force = [np.concatenate([one.T @ mine for one in each])
                 for *each, mine in zip(*(seen.force for seen in (*ones, other)), strict=True)]
        sides = [(np.concatenate(each, axis=-1), mine)
                 for *each, mine in zip(*(seen.turning for seen in (*ones, other)), strict=True)]
        return Products(self, np.stack(force), tuple(sides))


def rows_of(wrench: Wrench, residual: tuple[np.ndarray, np.ndarray], force: np.ndarray, torque: np.ndarray,
            prior: np.ndarray) -> Rows:
    """The map for a residual, from the part that columns (N, 3, C) and (M, 3, C) do not explain; ``prior`` (C,):
    standard deviation of each column's coefficient before any flight."""
    forces, flights, sd = _forces(wrench, residual[0], force, prior)
    turnings, excess = _turnings(wrench, residual[1], torque, prior) if len(wrench.torque_at) else ([], np.ones(3))
    numbers, place = np.unique(np.concatenate(flights), return_inverse=True)
    return Rows(tuple(forces), tuple(turnings), place, len(numbers), sd, excess)


def _ridge(x: np.ndarray) -> np.ndarray:
    """Coefficients (C,) of the last column on the others, each shrunk a little in its own size."""
    size = np.maximum(np.sqrt((x[:, :-1] ** 2).sum(0)), 1e-12)
    a = x[:, :-1] / size
    gram = a.T @ a
    gram[np.diag_indices_from(gram)] += 1e-3
    return np.asarray(np.linalg.solve(gram, a.T @ x[:, -1]) / size)


def _memory(residual: np.ndarray, columns: np.ndarray, prior: np.ndarray, runs: np.ndarray) -> Memory:
    """Autoregression of a residual (n,), fitted together with columns (n, C) (Ljung 1999, System Identification, ch.
    10).

    Each column has its prior: hundreds of free columns would leave no memory, and slow noise would be mistaken for
    physics.
    """
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


def instruments(wrench: Wrench, axis: int, made: np.ndarray, runs: np.ndarray) -> tuple[np.ndarray, bool]:
    """(M, K) instruments of the moment about one axis without the constants, and whether they are set-points.

    All flights may share set-points. A row without enough rows before it is nan.
    """
    at = wrench.torque_at

    def before(values: np.ndarray, lag: int) -> np.ndarray:
        found = np.full(len(values), np.nan)
        found[lag:] = values[:-lag] if lag else values
        found[runs < lag] = np.nan
        return found

    asked = so3.rotate_inverse(wrench.quaternion[at], np.concatenate(
        [-wrench.of("asked_rad_s2", at)[:, 1:], wrench.of("asked_rad_s2", at)[:, :1], np.zeros((len(at), 1))], axis=1))
    if axis < 2 and asked[:, axis].std() > MOVES * wrench.measured[1][:, axis].std():
        moved = [before(asked[:, axis], lag) for lag in ASKED]
        slow = asked[:, axis]
        for _ in range(INTEGRALS):  # towards tilt and speed, with which drag at an arm is correlated
            slow = np.concatenate([lfilter([1.0 - KEEPS], [1.0, -KEEPS], part)
                                   for part in np.split(slow, np.flatnonzero(np.diff(wrench.track[at])) + 1)])
            moved.append(slow)
        return np.stack(moved, axis=1), True
    speed = so3.rotate_inverse(wrench.quaternion[at], wrench.of("velocity_m_s", at))
    load = wrench.of("motor", at).mean(axis=1)
    columns = [*speed.T, *(speed * np.abs(speed)).T, *wrench.of("position_m", at).T]
    columns += [before(load, lag) for lag in (2, 6)]
    columns += [before(values, 2) for values in wrench.of("rate_rad_s", at).T]
    columns += [before(made[:, axis], lag) for lag in LAGS]
    given = np.stack(columns, axis=1)
    return given - np.nanmean(given, axis=0), False


def _turnings(wrench: Wrench, residual: np.ndarray, columns: np.ndarray,
              prior: np.ndarray) -> tuple[list[Turning], np.ndarray]:
    at = wrench.torque_at
    runs = runs_of(at, TORQUE_ROWS, wrench.track)
    made = wrench.measured[1] - residual
    both = np.concatenate([columns, residual[..., None]], axis=2)
    numbers = np.unique(wrench.flight[wrench.force_at])
    found, excess = list[Turning](), np.ones(3)
    for axis in range(3):
        given, together = instruments(wrench, axis, made, runs)
        fine = np.flatnonzero(np.isfinite(given).all(axis=1))
        x, z, flight = both[fine, axis], given[fine], np.searchsorted(numbers, wrench.flight[at][fine])
        flown = np.unique(flight)
        if len(x) < 2 * (z.shape[1] + len(flown)):
            continue
        z = z / np.maximum(np.sqrt(np.mean(z**2, axis=0)), 1e-9)
        groups = [_Group.of(part, flight, fine, z) for part in ([flown] if together else flown[:, None])]
        weight, left = np.ones(len(x)), x[:, -1].copy()
        for g in groups:
            left[g.mine] -= g.z @ np.linalg.lstsq(g.z, left[g.mine], rcond=None)[0]
        for _ in range(ROUNDS):
            asked = [g.turning(axis, together, weight, left) for g in groups]
            whole = np.concatenate([t.asked(t.of(both), np.ones(len(numbers), bool)) for t in asked])
            left = x[:, -1] - x[:, :-1] @ _most_probable(whole, prior)
            for f in flown:
                left[flight == f] -= np.average(left[flight == f], weights=weight[flight == f])
            spread = 1.4826 * float(np.median(np.abs(left))) or 1.0
            weight = (FREEDOM + 1.0) / (FREEDOM + (left / spread) ** 2)
        excess[axis] = max(1.0, _left_over(whole, prior))
        found += [replace(t, spread=t.spread * excess[axis], _ways={}) for t in asked]
    return found, excess


@dataclass(frozen=True)
class _Group:
    """Flights that share instruments: their numbers, their rows, and the instruments with a constant for each
    flight."""

    flights: np.ndarray
    mine: np.ndarray
    flight: np.ndarray
    at: np.ndarray
    z: np.ndarray

    @classmethod
    def of(cls, flights: np.ndarray, flight: np.ndarray, at: np.ndarray, z: np.ndarray) -> _Group:
        mine = np.flatnonzero(np.isin(flight, flights))
        place = np.searchsorted(flights, flight[mine])
        constants = (place[:, None] == np.arange(len(flights))).astype(float)
        return cls(flights, mine, place, at[mine], np.concatenate([constants, z[mine]], axis=1))

    def turning(self, axis: int, together: bool, weight: np.ndarray, left: np.ndarray) -> Turning:
        """Instruments with weighted rows; ``left`` is taken as the noise."""
        weighed = self.z * weight[self.mine, None]
        return Turning(axis, together, self.flights, self.flight, self.at, weighed,
                       _spread(weighed, left[self.mine], self.flight, len(self.flights)))


def _most_probable(x: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """(C,) coefficients of the last column on the others, each with its prior, in noise of one."""
    a = x[:, :-1] * prior
    return np.asarray(prior * (a.T @ np.linalg.solve(a @ a.T + np.eye(len(a)), x[:, -1])))


def _left_over(x: np.ndarray, prior: np.ndarray) -> float:
    """Variance of the last column that the others leave, each row by its own leverage, relative to the median of chi
    squared.

    1 if instruments and noise agree.
    """
    a = x[:, :-1] * prior
    free = np.linalg.inv(a @ a.T + np.eye(len(a)))
    return float(np.median((free @ x[:, -1]) ** 2 / np.maximum(np.diag(free), FREE**2)) / MEDIAN_OF_CHI2)


def _spread(weighed: np.ndarray, left: np.ndarray, flight: np.ndarray, flights: int) -> np.ndarray:
    """(G, K, K) covariance that the noise ``left`` (n,) causes in instruments (n, K) in each flight. No direction has
    less than half of the covariance of white noise of this size, even if its noise happened to cancel."""
    found = np.zeros((flights, weighed.shape[1], weighed.shape[1]))
    score = weighed * left[:, None]
    for f in range(flights):
        mine = score[flight == f]
        found[f] = mine.T @ mine
        for lag in range(1, MEMORY + 1):
            cross = mine[lag:].T @ mine[:-lag]
            found[f] += (1.0 - lag / (MEMORY + 1.0)) * (cross + cross.T)
    white = 0.5 * float(np.mean(left**2)) * np.stack([weighed[flight == f].T @ weighed[flight == f]
                                                      for f in range(flights)])
    size, ways = np.linalg.eigh(found.sum(0))
    short = np.maximum(np.einsum("ki,kl,li->i", ways, white.sum(0), ways) - size, 0.0)
    total = np.maximum(np.einsum("ki,kl,li->i", ways, white.sum(0), ways), 1e-12)
    add = (ways * (short / total)) @ ways.T  # each flight by its share of white noise
    return np.asarray(found + np.einsum("ab,fbc,cd->fad", add, white, add))
