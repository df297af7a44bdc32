"""How well flights identify parameters: bootstrap over sessions and flights, Fisher information, what trades against
what, profiles.

All results but the profiles use the normal equations of every flight at the optimum. A bootstrap of a thousand draws
therefore costs as much as one iteration. Nuisances of the flights are eliminated from them first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools.metrics.statistics import Labels, weights
from nanobench_tools.physics.model import find_term
from nanobench_tools.settings import count, number

from .solve import Problem, Solution, solve

DRAWS = 1000
FEWEST_FLIGHTS = count("greybox.parameter_intervals.fewest_flights")
WEAK = number("greybox.parameter_intervals.weak")
SHARE_OF_RANGE = number("greybox.parameter_intervals.share_of_range")


def reduced(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """By flight, over the free parameters, nuisances eliminated: gradient (F, Q) and curvature (F, Q, Q)."""
    problem, normal = solution.problem, solution.normal
    size, on = len(problem.model.names), np.flatnonzero(problem.free)
    gradient, hessian = normal.gradient[:, on].copy(), normal.hessian[:, on][:, :, on].copy()
    if problem.nuisances:
        stiff = np.diag([1.0 / n.sd**2 for n in problem.nuisances])
        for f, own in enumerate(solution.own):
            cross = normal.hessian[f, on, size:]
            block = normal.hessian[f, size:, size:] + stiff
            hessian[f] -= cross @ np.linalg.solve(block, cross.T)
            gradient[f] -= cross @ np.linalg.solve(block, normal.gradient[f, size:] + stiff @ own)
    return gradient, hessian


def bootstrap(solution: Solution, seed: int = 0, sessions: Labels = None) -> dict[str, tuple[float, float]] | None:
    """95 % interval of every free parameter, one Gauss-Newton step per draw: sessions are drawn, then flights within
    them. ``sessions`` (F,): of every flight; unknown ones leave flights alone to be drawn. None with fewer than
    FEWEST_FLIGHTS flights, and of one session."""
    problem = solution.problem
    on = np.flatnonzero(problem.free)
    flown = solution.normal.windows > 0
    if flown.sum() < FEWEST_FLIGHTS:
        return None
    counts = weights(int(flown.sum()), None if sessions is None else np.asarray(sessions)[flown], seed, DRAWS)
    if counts is None:
        return None
    gradient, hessian = reduced(solution)
    gradient, hessian = gradient[flown], hessian[flown]
    matrix, target = problem.prior_rows()
    values = solution.model.values
    pull, stiff = (matrix.T @ (matrix @ values - target))[on], (matrix.T @ matrix)[np.ix_(on, on)]
    total = np.einsum("df,fij->dij", counts, hessian) + stiff
    slope = counts @ gradient + pull
    size = np.sqrt(np.maximum(np.einsum("dii->di", total), 1e-300))
    scaled = total / (size[:, :, None] * size[:, None, :]) + 1e-12 * np.eye(len(on))
    moved = values[on] - np.linalg.solve(scaled, (slope / size)[..., None])[..., 0] / size
    moved = np.clip(moved, problem.lower[on], problem.upper[on])
    low, high = np.quantile(moved, [0.025, 0.975], axis=0)
    return {problem.model.names[i]: (float(a), float(b)) for i, a, b in zip(on, low, high, strict=True)}


@dataclass(frozen=True)
class Information:
    """Fisher information of the flights alone, priors left out. ``sd`` (Q,) of each free parameter, the others unknown
    too; ``correlation`` (Q, Q) of the estimates; condition of the scaled information."""

    names: tuple[str, ...]
    sd: np.ndarray
    correlation: np.ndarray
    condition: float


def information(solution: Solution) -> Information:
    """The inverse of the curvature is the covariance only as far as the cost is a likelihood; use it for shapes."""
    problem = solution.problem
    on = np.flatnonzero(problem.free)
    names = tuple(problem.model.names[i] for i in on)
    total = reduced(solution)[1].sum(axis=0)
    constraints = [p for p in problem.priors if p.sd < 1e-3 and len(p.names) > 1]
    matrix, _ = replace(problem, priors=tuple(constraints)).prior_rows()
    total = total + (matrix.T @ matrix)[np.ix_(on, on)]
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    scaled = total / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    inverse = (vectors / np.maximum(values, 1e-12)) @ vectors.T
    spread = np.sqrt(np.diag(inverse))
    return Information(names, spread / size, inverse / np.outer(spread, spread),
                       float(values[-1] / max(values[0], 1e-12)))


def not_identified(solution: Solution, ci95: dict[str, tuple[float, float]] | None) -> list[str]:
    """Sentences: which parameters and pairs these flights do not identify, and which flight would."""
    found, known = [], information(solution)
    problem = solution.problem
    for i, name in enumerate(known.names):
        for j in range(i):
            other = known.names[j]
            if abs(known.correlation[i, j]) > WEAK and _term(name) != _term(other):
                sign = "difference" if known.correlation[i, j] > 0 else "sum"
                found.append(f"{other} and {name} are identifiable only together (correlation "
                             f"{known.correlation[i, j]:+.3f}: "
                             f"a {sign} of the two is free); {_settles(other, name)}")
        at = problem.model.index(name)
        low, high = (ci95 or {}).get(name, (0.0, 0.0))
        if high - low > SHARE_OF_RANGE * (problem.upper[at] - problem.lower[at]):
            found.append(f"{name} is not identifiable from these flights: its interval spans half of the physical "
                         f"range; "
                         f"{_settles(name, '')}")
    return found


def _term(name: str) -> str:
    return name.partition(".")[0]


def _settles(a: str, b: str) -> str:
    first, second = find_term(_term(a)).confused_with, find_term(_term(b)).confused_with if b else {}
    flight = first.get(_term(b)) or second.get(_term(a)) or next(iter(first.values()), "")
    return f"what would tell: {flight}" if flight else "no flight of this vehicle alone identifies them"


def profile(solution: Solution, name: str, values: Sequence[float]) -> list[dict[str, float]]:
    """Profile likelihood: cost with ``name`` held at each of ``values`` and all other parameters fitted again.

    Returns [{value, cost, rise}], rise above the optimum in units where 1.92 is the 95 % bound of one parameter."""
    problem: Problem = solution.problem
    free = problem.free.copy()
    free[problem.model.index(name)] = False
    found = []
    for value in values:
        model = solution.model.with_parameters({name: float(value)})
        cost = solve(replace(problem, model=model, free=free), scale=solution.scale).cost
        found.append({"value": float(value), "cost": cost, "rise": cost - solution.cost})
    return found
