"""Per-flight offsets: the place of the markers and the battery, the wear of the propellers.

Real flights scatter in these by more than most physics, so that a flight's offset is no finding. An offset is a random
effect (Harville 1977, J. Am. Stat. Assoc. 72). Its standard deviation between flights maximises the likelihood of the
flights' contrasts, with everything that flights share projected off. A shared change of the same parameter is a finding
only if it is large compared with that scatter. Flights that agree except for a few do not scatter: something was
changed there, and the search reports it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from nanobench_tools.physics.vocabulary import terms_that, vocabulary
from nanobench_tools.settings import number

from .fitting import Slopes
from .moments import Levels, Moments
from .space import MAPS, Space, scales

GROUPS = {name: tuple(f"{name}.{element}" for element in vocabulary()[name].scatters)
          for name in sorted(terms_that(lambda term: bool(term.scatters)), reverse=True,
                             key=lambda name: (len(vocabulary()[name].scatters), name))}
"""Terms with a level, and the parameters that have one, or the list of them; the most parameters first. Without
motor_imbalance a trim about z that is another in every flight is made up for by commands that seem not to turn the
vehicle."""
TRIED, ROUNDS = (0.0, *np.geomspace(1e-3, 3.0, 48)), 4
"""Standard deviations that are tried, per scale, and how often."""
SIGNIFICANT = number("mismatch.levels.significant")
LOWER = number("mismatch.levels.lower")
A_FEW = number("mismatch.levels.a_few")
PLAIN = number("mismatch.levels.plain")
LEAST_FREE = number("mismatch.levels.least_free")


def with_levels(moments: Moments, space: Space, other: Space | None = None) -> Moments:
    """The moments with the scatter between flights as a nuisance. The unit of each channel is the part that no term
    explains, which an effect has to exceed. ``other``: with the other thrust map."""
    model, known = space.model, Slopes(moments)
    left = known.left(model)
    shared = known.columns(model, np.concatenate([space.free(t) for t in space.terms]))
    if other is not None:
        maps = np.concatenate([other.free(t) for t in MAPS if t in other.terms])
        shared = np.concatenate([shared, known.columns(other.model, maps)], axis=1)
    shared = np.concatenate([shared, known.speed_lag(model), known.drag_at_rotors(model)], axis=1)  # as in every fit
    groups = {term: [i for i, n in enumerate(model.names) if n in names or n.partition("[")[0] in names]
              for term, names in GROUPS.items() if term in model and term not in space.unasked}
    many = len(np.unique(moments.wrench.flight))
    own = {term: known.of_flights(model, which) for term, which in groups.items()} if many > 1 else {}
    everything = np.concatenate([shared, *own.values()], axis=1)
    spread = _spread(moments, _basis(everything), left)
    unit = np.sqrt(spread)[moments.owner]
    found = _scatter({t: c / unit[:, None] for t, c in own.items()}, _off(shared / unit[:, None]), left / unit, many)
    sizes, names, which, sds = scales(model), [], [], []
    for term, sd in found.items():
        for i in groups[term]:
            names.append(model.names[i])
            which.append(i)
            sds.append(sd * float(sizes[groups[term][0]] / sizes[i]))
    channels = tuple(replace(c, sd=c.sd * float(np.sqrt(s)), spread=float(s))
                     for c, s in zip(moments.channels, spread, strict=True))
    levels = Levels(model, tuple(names), tuple(which), tuple(sds)) if names else None
    return replace(moments, channels=channels, levels=levels)


def _basis(columns: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(columns, axis=0)
    u, s, _ = np.linalg.svd(columns[:, size > 1e-9] / size[size > 1e-9], full_matrices=False)
    return u[:, s > 1e-3 * s[0]]


def _off(columns: np.ndarray) -> np.ndarray:
    """(K, K - p) orthonormal, orthogonal to the columns."""
    basis = _basis(columns)
    return np.linalg.svd(basis, full_matrices=True)[0][:, basis.shape[1]:]


def _spread(moments: Moments, basis: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(6,) unexplained squared length per free moment, relative to the plain level; not below 1."""
    rest, free = left - basis @ (basis.T @ left), 1.0 - np.sum(basis**2, axis=1)
    owner = moments.owner
    return np.array([max(float(rest[owner == c] @ rest[owner == c]) / max(float(free[owner == c].sum()), LEAST_FREE)
                         / PLAIN, 1.0) for c in range(6)])


def _scatter(own: dict[str, np.ndarray], off: np.ndarray, left: np.ndarray, flights: int) -> dict[str, float]:
    """Standard deviation between flights of each term that has one, per scale of its first parameter."""
    if not own:
        return {}
    terms = list(own)
    columns = off.T @ np.concatenate([own[t] for t in terms], axis=1)
    group = np.repeat(np.arange(len(terms)), [own[t].shape[1] for t in terms])
    gram, toward, whole = columns.T @ columns, columns.T @ (off.T @ left), float(left @ off @ (off.T @ left))

    def cost(sds: np.ndarray) -> float:
        d = sds[group]
        inner = np.eye(len(d)) + d[:, None] * gram * d
        half = np.linalg.solve(inner, d * toward)
        return float(np.linalg.slogdet(inner)[1]) + whole - float((d * toward) @ half)

    best = np.zeros(len(terms))
    for _ in range(ROUNDS):  # one at a time: the likelihood may have several hills
        for k in range(len(terms)):
            tries = [np.where(np.arange(len(terms)) == k, sd, best) for sd in TRIED]
            best = min(tries, key=cost)
    lowest = cost(best)
    found = {}
    for k, term in enumerate(terms):
        without = np.where(np.arange(len(terms)) == k, 0.0, best)
        if cost(without) - lowest < SIGNIFICANT:
            continue
        d = best[group]
        values = d * np.linalg.solve(np.eye(len(d)) + d[:, None] * gram * d, d * toward)
        sd = float(best[k]) * min(_rest(values[group == k].reshape(-1, flights)), 1.0)
        found[term] = sd * float(np.sqrt((flights - 1) / chi2.ppf(LOWER, flights - 1)))
    return found


def _rest(values: np.ndarray) -> float:
    """values (P, flights): scatter of the closest majority of flights, over that of all; 1 without outliers."""
    flights = values.shape[1]
    odd = (flights - 1) // 2
    if not odd:
        return 1.0
    away = np.linalg.norm(values - np.median(values, axis=1, keepdims=True), axis=0)
    close = np.argsort(away)[:flights - odd]
    share = float(np.sqrt(values[:, close].var(axis=1, ddof=1).sum() / max(values.var(axis=1, ddof=1).sum(), 1e-30)))
    return share if share < A_FEW else 1.0
