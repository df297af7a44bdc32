"""Levenberg-Marquardt on the multi-step prediction error, with exact derivatives, bounds and soft priors.

Parameters are shared by all flights; nuisances are a few directions through them along which every training flight has
its random effect, drawn around zero. They keep what differs between flights (a battery further left) out of the shared
ones; a test flight gets none. SciPy's ``least_squares``, with the same derivatives and with priors as further rows,
takes 1.3 times as long. It ends .4 % above this cost. It does not eliminate the flights' effects.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from nanobench_tools.physics import Model

from .arrays import FitWindows
from .residuals import HORIZONS, errors, robust
from .sensitivity import sensitivities
from .starts import NAMES, PREFIX

CHUNK = 512
"""Windows at a time, which keeps derivatives at some tens of MB."""

MOST_STEPS = 60
FLAT = 1e-5
"""A step that would lower the cost by less than this share of it ends the search."""

NOTHING = 1e-12
"""Cost of a model without errors."""

RESCALED = 2
"""Times the usual sizes of errors are taken anew from the fit."""


LEAST_ERROR = np.array([1e-6, 1e-5, 1e-6, 1e-5])
"""m, m/s, rad, rad/s: errors are not measured in less, also where a model has none."""


@dataclass(frozen=True)
class Prior:
    """``names`` add up, with ``weights``, to ``mean`` within ``sd``."""

    names: tuple[str, ...]
    mean: float
    sd: float
    source: str
    weights: tuple[float, ...] = (1.0,)


@dataclass(frozen=True)
class Nuisance:
    """What may differ between flights or windows: a direction through the parameters, or through the start (names of
    ``starts.NAMES``), and its spread; ``side``: the view it has of features (``symmetry.SIDES``)."""

    name: str
    direction: Mapping[str, float]
    sd: float
    unit: str
    sentence: str
    side: str = "thrust"

    @property
    def of_start(self) -> bool:
        return any(name.startswith(PREFIX) for name in self.direction)

    @property
    def family(self) -> str:
        """The part it shares with other sides: trim of trim_roll."""
        return self.name.removesuffix(self.side).rstrip("_") or self.name

    def vector(self, model: Model) -> np.ndarray:
        """(P,), zero for a direction through the start."""
        found = np.zeros(len(model.names))
        for name, weight in self.direction.items():
            if not name.startswith(PREFIX):
                found[model.index(name)] = weight
        return found

    def start(self) -> np.ndarray:
        """(7,) along ``starts.NAMES``, zero for a direction through the parameters."""
        return np.array([self.direction.get(name, 0.0) for name in NAMES])


@dataclass(frozen=True)
class Normal:
    """By flight, over shared parameters and then nuisances (Q = P + N): cost (F,), gradient (F, Q), hessian (F, Q, Q),
    windows (F,)."""

    cost: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    windows: np.ndarray


@dataclass(frozen=True)
class Problem:
    """All that a fit is made of. ``free`` (P,) bool; lower, upper (P,); ``share``: weight of a window relative to the
    priors."""

    model: Model
    data: FitWindows
    free: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    priors: tuple[Prior, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    share: float = 1.0
    threads: int = 1
    progress: Callable[[str], None] | None = field(default=None, compare=False)

    @property
    def patterns(self) -> np.ndarray:
        """(P, N) directions of the nuisances."""
        return np.array([n.vector(self.model) for n in self.nuisances]).reshape(-1, len(self.model.names)).T

    def prior_rows(self) -> tuple[np.ndarray, np.ndarray]:
        """A (R, P), b (R,): the priors cost |A p - b|^2 / 2."""
        matrix, target = np.zeros((len(self.priors), len(self.model.names))), np.zeros(len(self.priors))
        for row, prior in enumerate(self.priors):
            for name, weight in zip(prior.names, prior.weights, strict=True):
                matrix[row, self.model.index(name)] = weight / prior.sd
            target[row] = prior.mean / prior.sd
        return matrix, target

    def values_of(self, shared: np.ndarray, own: np.ndarray, windows: slice = slice(None)) -> np.ndarray:
        """Parameters of windows: (n, P), or (P,) when all have the same."""
        return shared + (own @ self.patterns.T)[self.data.flight[windows]] if self.nuisances else shared


@dataclass(frozen=True)
class Solution:
    """model at the end; ``own`` (F, N) nuisances; normal equations there (the priors' are not in them); ``scale`` (K,
    4) the errors were measured in; on_bound names; trouble empty when it converged."""

    problem: Problem
    model: Model
    own: np.ndarray
    normal: Normal
    scale: np.ndarray
    cost: float
    steps: int
    on_bound: tuple[str, ...]
    trouble: str


def normal_equations(problem: Problem, shared: np.ndarray, own: np.ndarray, scale: np.ndarray, *,
                     derivatives: bool = True) -> Normal:
    """Cost, and with ``derivatives`` the normal equations, of every flight. Every horizon and quantity weighs the same,
    in units of ``scale`` (K, 4)."""
    data, size, flights = problem.data, len(shared), len(problem.data.names)
    where = np.flatnonzero(problem.free)
    columns = np.concatenate([where, size + np.arange(len(problem.nuisances))])
    directions = np.concatenate([np.eye(size)[:, where], problem.patterns], axis=1)
    if not derivatives:
        directions = directions[:, :0]
    wide = size + len(problem.nuisances)
    cost, gradient, hessian = np.zeros(flights), np.zeros((flights, wide)), np.zeros((flights, wide, wide))
    weight = np.full(scale.shape, problem.share / scale.size)
    for part, found, slope in flown_errors(problem, shared, own, directions):
        for flight in np.unique(part.flight):
            mine = part.flight == flight
            value, pull = robust(found[mine], scale, weight)
            cost[flight] += value
            if derivatives:
                root = np.sqrt(pull)[..., None]
                jac = (slope[mine] * root[..., None]).reshape(-1, len(columns))
                gradient[flight, columns] += jac.T @ (found[mine] * root).reshape(-1)
                hessian[flight][np.ix_(columns, columns)] += jac.T @ jac
    return Normal(cost, gradient, hessian, np.bincount(data.flight, minlength=flights))


def usual_errors(problem: Problem, shared: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(K, 4) mean norms of the errors: the scale each is measured in."""
    none = np.zeros((len(shared), 0))
    found = np.concatenate([e for _, e, _ in flown_errors(problem, shared, own, none)])
    return np.asarray(np.maximum(np.mean(np.linalg.norm(found, axis=-1), axis=0), LEAST_ERROR))


def flown_errors(problem: Problem, shared: np.ndarray, own: np.ndarray, directions: np.ndarray,
                 starts: np.ndarray | None = None) -> Iterator[tuple[FitWindows, np.ndarray, np.ndarray]]:
    """(windows, errors, derivatives) by chunks; ``starts`` (7, F): what the directions do to the starts."""
    for low in range(0, len(problem.data), CHUNK):
        chunk = slice(low, low + CHUNK)
        part = problem.data.rows(chunk)
        states, slopes = sensitivities(problem.model, part.start, part.motor, part.battery_V, part.past, directions,
                                       keep=HORIZONS, row_hz=part.row_hz, threads=problem.threads,
                                       parameters=problem.values_of(shared, own, chunk), starts=starts)
        yield part, *errors(states, slopes if directions.shape[1] else None, part.truth[:, HORIZONS - 1])


def solve(problem: Problem, scale: np.ndarray | None = None) -> Solution:
    """The best parameters within the bounds. Missing convergence and parameters on a bound are reported. ``scale`` (K,
    4): unit of the errors; without it their usual sizes, updated RESCALED times."""
    model = problem.model
    shared = np.clip(model.values, problem.lower, problem.upper)
    own = np.zeros((len(problem.data.names), len(problem.nuisances)))
    steps, trouble, rounds = 0, "", RESCALED if scale is None else 0
    scale = usual_errors(problem, shared, own) if scale is None else scale
    for round_ in range(rounds + 1):
        shared, own, normal, cost, taken, trouble = _descend(problem, shared, own, scale)
        steps += taken
        if round_ < rounds:
            scale = usual_errors(problem, shared, own)
    span = np.where(np.isfinite(problem.upper - problem.lower), problem.upper - problem.lower, 1.0)
    stuck = problem.free & (np.minimum(shared - problem.lower, problem.upper - shared) < 1e-6 * span)
    names = tuple(name for name, on in zip(model.names, stuck, strict=True) if on)
    return Solution(problem, model.with_values(shared), own, normal, scale, cost, steps, names, trouble)


def _descend(problem: Problem, shared: np.ndarray, own: np.ndarray,
             scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, Normal, float, int, str]:
    """One search at fixed scales: (shared, own, normal equations, cost, steps, trouble)."""
    matrix, target = problem.prior_rows()
    inverse_sd = np.array([1.0 / n.sd for n in problem.nuisances])

    def beside(at: np.ndarray, mine: np.ndarray) -> float:
        return 0.5 * float(np.sum((matrix @ at - target) ** 2) + np.sum((mine * inverse_sd) ** 2))

    def cost_at(at: np.ndarray, mine: np.ndarray) -> float:
        total = float(normal_equations(problem, at, mine, scale, derivatives=False).cost.sum())
        return total + beside(at, mine) if np.isfinite(total) else np.inf

    damping = 1e-3
    normal = normal_equations(problem, shared, own, scale)
    cost = float(normal.cost.sum()) + beside(shared, own)
    for step in range(1, MOST_STEPS + 1):
        while True:
            move, moved, expected = _move(problem, normal, shared, own, matrix, target, inverse_sd, damping)
            if expected <= FLAT * cost + NOTHING:
                return shared, own, normal, cost, step, ""
            tried = cost_at(shared + move, own + moved)
            if tried < cost:
                break
            damping *= 5.0
            if damping > 1e8:
                return shared, own, normal, cost, step, "no step lowers the cost"
        damping = max(damping * (0.2 if cost - tried > 0.5 * expected else 1.0), 1e-9)
        shared, own = np.clip(shared + move, problem.lower, problem.upper), own + moved
        if problem.progress is not None:
            problem.progress(f"step {step}: cost {tried:.4f}")
        normal, cost = normal_equations(problem, shared, own, scale), tried
    return shared, own, normal, cost, MOST_STEPS, f"not converged in {MOST_STEPS} steps"


def _move(problem: Problem, normal: Normal, shared: np.ndarray, own: np.ndarray, matrix: np.ndarray,
          target: np.ndarray, inverse_sd: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray, float]:
    """A damped step inside the bounds (shared, own), and by how much the quadratic model says it lowers the cost.

    Nuisances of flights only meet the shared parameters, so they are eliminated first (Schur complement).
    """
    size = len(shared)
    gradient = normal.gradient[:, :size].sum(axis=0) + matrix.T @ (matrix @ shared - target)
    hessian = normal.hessian[:, :size, :size].sum(axis=0) + matrix.T @ matrix
    full_gradient, full_hessian = gradient.copy(), hessian.copy()
    hessian = hessian + damping * np.diag(np.diag(hessian))
    eliminated = []
    for flight in range(len(own)):
        block = normal.hessian[flight, size:, size:] + np.diag(inverse_sd**2)
        block = block + damping * np.diag(np.diag(block))
        both = np.linalg.solve(block, np.column_stack([normal.hessian[flight, size:, :size],
                                                       normal.gradient[flight, size:] + own[flight] * inverse_sd**2]))
        eliminated.append(both)
        hessian = hessian - normal.hessian[flight, :size, size:] @ both[:, :-1]
        gradient = gradient - normal.hessian[flight, :size, size:] @ both[:, -1]
    outward = ((shared <= problem.lower) & (gradient > 0.0)) | ((shared >= problem.upper) & (gradient < 0.0))
    held = ~problem.free | outward
    move = _inside(hessian, gradient, held, shared, problem.lower, problem.upper)
    moved = np.array([-(both[:, :-1] @ move + both[:, -1]) for both in eliminated]).reshape(own.shape)
    lowered = full_gradient @ move + 0.5 * move @ full_hessian @ move
    for flight, mine in enumerate(moved):
        pull = normal.gradient[flight, size:] + own[flight] * inverse_sd**2
        lowered += mine @ (pull + normal.hessian[flight, size:, :size] @ move
                           + 0.5 * (normal.hessian[flight, size:, size:] + np.diag(inverse_sd**2)) @ mine)
    return move, moved, -float(lowered)


def _inside(hessian: np.ndarray, gradient: np.ndarray, held: np.ndarray, values: np.ndarray, lower: np.ndarray,
            upper: np.ndarray) -> np.ndarray:
    """Minimum of the quadratic with bounds: what would leave them is put on them, and the rest solved again."""
    move = np.zeros(len(values))
    held = held.copy()
    for _ in range(len(values)):
        on = np.flatnonzero(~held)
        if not len(on):
            return move
        block = hessian[np.ix_(on, on)]
        size = np.sqrt(np.maximum(np.diag(block), 1e-300))
        right = gradient[on] + hessian[np.ix_(on, np.flatnonzero(held))] @ move[held]
        move[on] = -np.linalg.lstsq(block / np.outer(size, size), right / size, rcond=1e-14)[0] / size
        beyond = ~held & ((values + move < lower) | (values + move > upper))
        if not beyond.any():
            return move
        move[beyond] = np.clip(values + move, lower, upper)[beyond] - values[beyond]
        held |= beyond
    return move
