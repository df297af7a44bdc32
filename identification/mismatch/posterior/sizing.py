"""Sizes of a set of effects, with slopes taken again where it ends: much acts far from linearly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import truncnorm

from nanobench_tools.physics import Model

from ..space import with_other_map
from .background import LIFT_OF_ALL
from .build import Case
from .effects import balanced
from .rows import Products, Seen
from .set_evidence import TWINS

STEPS, NEAR = 8, 0.1
"""Number of Gauss-Newton steps; fraction of a standard deviation: a shorter step has converged."""
SHORTER = (1.0, 0.5, 0.25, 0.1)
"""Shares of a Gauss-Newton step that are tried until the fit improves."""
WIDE = 3.0
"""Times a size: the least standard deviation of its prior where it is estimated, so that it is not shrunk towards the
simulator."""
CERTAIN = 1.96
"""Standard deviations outside a bound, from which on the flights contradict it."""
FEWEST = 3
"""Flights whose scatter is a measure."""
INSIDE = 0.98
"""Share of its room that an effect may take."""


@dataclass(frozen=True)
class Refined:
    """Sizes of a set: ``step`` (k,) in directions of its effects, ``covariance`` (k, k), and the model at that step.

    A fit without some flights starts near that step, at ``at`` (k,). ``across``: ``Case.across`` of the slopes there,
    per m/s^2, with the residual last. ``beyond`` (k,): standard deviations by which the most probable coefficient lies
    outside its bounds, negative inside. ``log``: log evidence over no effect, of a set of effects
    that all act far from linearly; 0 of others.
    """

    chosen: tuple[int, ...]
    step: np.ndarray
    covariance: np.ndarray
    model: Model
    at: np.ndarray
    across: Products | None
    slab: np.ndarray
    beyond: np.ndarray
    log: float

    def spread(self, case: Case) -> np.ndarray:
        """(k, k) covariance with the scatter between flights, by the jackknife: a wrong effect takes another size in
        each flight. Source: Efron and Stein 1981, Annals of Statistics 9(3). Effects far from linear have none, since
        slopes where the flights together end do not hold for each flight."""
        many = len(case.flights)
        if many < FEWEST or self.across is None:
            return self.covariance
        linear = np.array([not case.effects[i].far for i in self.chosen for _ in range(case.effects[i].width)])
        each = np.array([self.without(case, [int(f)]) for f in case.flights])
        away = (each - each.mean(0)) * linear
        return np.asarray(self.covariance + (many - 1.0) / many * away.T @ away)

    def without(self, case: Case, flights: Sequence[int]) -> np.ndarray:
        """The step on the other flights."""
        if self.across is None:
            return self.step
        unit = case.evidence.unit[case.evidence.columns(self.chosen)]
        found, covariance = _solved(case, self.chosen, self.across, self.slab, self.at * unit, flights)
        return _expected(case, self.chosen, found / unit, covariance / unit[:, None] / unit)[0]


def _solved(case: Case, chosen: tuple[int, ...], across: Products, slab: np.ndarray, at: np.ndarray,
            without: Sequence[int] = ()) -> tuple[np.ndarray, np.ndarray]:
    """(k,) most probable coefficients, where ``across`` is of slopes and of the residual at coefficients ``at``; (k, k)
    their covariance."""
    reduced = case.beside(across, chosen, without)
    covariance = np.linalg.inv(reduced[:-1, :-1] + np.diag(slab**-2.0))
    return np.asarray(covariance @ (reduced[:-1, -1] + reduced[:-1, :-1] @ at)), covariance


def refine(case: Case, chosen: tuple[int, ...], known: Mapping[int, np.ndarray] | None = None) -> Refined:
    """Slopes are taken again at the values that were found (Gauss-Newton), since lags, limits and the ground act far
    from linearly. ``known`` {number: its coefficients alone}: start of such effects in sets of several."""
    evidence = case.evidence
    if not chosen:
        return Refined((), np.zeros(0), np.zeros((0, 0)), case.space.model, np.zeros(0), None, np.zeros(0),
                       np.zeros(0), 0.0)
    _, scaled, slab = evidence.weighed(chosen)
    unit = evidence.unit[evidence.columns(chosen)]
    far = all(case.effects[i].far for i in chosen)
    start = np.concatenate([(known or {}).get(i, part) for i, part in parts_of(case, chosen, scaled / unit)])
    return _from(case, chosen, start, slab, unit, far)


def _from(case: Case, chosen: tuple[int, ...], start: np.ndarray, slab: np.ndarray, unit: np.ndarray,
          far: bool) -> Refined:
    """Gauss-Newton steps; where ``far``, no longer than the fit improves."""
    evidence = case.evidence
    slab = np.minimum(np.maximum(slab, WIDE * np.abs(start) * unit), evidence.room[evidence.columns(chosen)])

    def cost(step: np.ndarray) -> float:
        left = case.beside(case.across(_left(case, chosen, step)), chosen)
        return float(left[0, 0] + ((step * unit / slab) ** 2).sum())

    step = _inside(case, chosen, start)
    least = cost(step) if far else 0.0
    for _ in range(STEPS):
        at = step
        across = case.across(slopes(case, chosen, at, unit))
        moved, covariance = _solved(case, chosen, across, slab, at * unit)
        step = _inside(case, chosen, moved / unit)
        if (np.abs(step - at) * unit < NEAR * np.sqrt(np.diag(covariance))).all():
            break
        if far:
            share, least = _shortened(cost, at, step, least)
            if share < 1.0:
                step = at + share * (step - at)
                moved = step * unit
            if share == 0.0:
                break
    log = _log_evidence(case, chosen, across, at * unit) if far else 0.0
    scatter = np.array([evidence.amplitudes[LIFT_OF_ALL] * (case.effects[i].term in TWINS)
                        for i in chosen for _ in range(case.effects[i].width)])
    covariance = covariance + np.diag(scatter**2)
    covariance = covariance / unit[:, None] / unit
    step, beyond = _expected(case, chosen, moved / unit, covariance)
    return Refined(chosen, step, covariance, moved_by(case, chosen, step), at, across, slab, beyond, log)


def _shortened(cost: Callable[[np.ndarray], float], at: np.ndarray, to: np.ndarray,
               least: float) -> tuple[float, float]:
    """Largest share of a step that costs less than ``least``, and its cost; no step otherwise."""
    for share in SHORTER:
        reached = cost(at + share * (to - at))
        if reached < least:
            return share, reached
    return 0.0, least


def _log_evidence(case: Case, chosen: tuple[int, ...], across: Products, at: np.ndarray) -> float:
    """As ``Evidence.weighed``, with the residual and slopes at coefficients ``at`` (k,), and no step from there."""
    reduced = case.beside(across, chosen)
    left, over = case.evidence.beside_of(chosen)
    among, along = reduced[:-1, :-1], reduced[:-1, -1] + reduced[:-1, :-1] @ at
    before = reduced[-1, -1] + 2.0 * float(at @ reduced[:-1, -1]) + float(at @ among @ at)
    over += 0.5 * float(left[-1, -1] - before)
    return case.evidence.weighed_with(chosen, among, along, over, at)[0]


def _bounds(case: Case, chosen: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = (np.concatenate([getattr(case.effects[i], side) for i in chosen]) for side in ("lower", "upper"))
    return INSIDE * lower, INSIDE * upper


def _inside(case: Case, chosen: tuple[int, ...], step: np.ndarray) -> np.ndarray:
    return np.asarray(np.clip(step, *_bounds(case, chosen)))


def _expected(case: Case, chosen: tuple[int, ...], step: np.ndarray,
              covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of coefficients (k,) whose distribution ends at the bounds, and how many standard deviations the most
    probable ones lie outside."""
    lower, upper = _bounds(case, chosen)
    sd = np.sqrt(np.diag(covariance))
    low, high = (lower - step) / sd, (upper - step) / sd
    mean = truncnorm.mean(low, high, loc=step, scale=sd)
    beyond = np.maximum(low, -high)
    return np.where(np.isfinite(mean) & (beyond < CERTAIN), mean, np.clip(step, lower, upper)), beyond


def parts_of(case: Case, chosen: tuple[int, ...], step: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """(number of an effect, its coefficients) of a set."""
    if not chosen:
        return []
    ends = np.cumsum([case.effects[i].width for i in chosen])
    return list(zip(chosen, np.split(step, ends[:-1]), strict=True))


def moved_by(case: Case, chosen: tuple[int, ...], step: np.ndarray) -> Model:
    """The space's model with the effects of a set at a step; shares of another map are no parameter of it."""
    values = case.space.model.values.copy()
    for i, part in parts_of(case, chosen, step):
        for name, way in case.effects[i].moves.items():
            values[case.space.model.index(name)] += float(way @ part)
    model = case.space.model
    return model.with_values(np.clip(values, model.lower, model.upper))


def nuisance(case: Case, found: Refined, keep: np.ndarray | None = None) -> np.ndarray:
    """(P + Q,) errors of the terms and coefficients of the background, given a set at its sizes; ``keep`` (F,): on
    these flights alone."""
    evidence, keep = case.evidence, np.ones(len(case.flights), bool) if keep is None else keep
    gram = case.grams.of(keep)
    right = gram[:-1, -1]
    if found.across is not None:
        across = found.across.of(keep)[:case.beside_all.many]
        moved = (found.step - found.at) * evidence.unit[evidence.columns(found.chosen)]
        right = across[:, -1] - across[:, :-1] @ moved
    return evidence.mean_of(right, evidence.takes_lift(found.chosen), gram[:-1, :-1])


def slopes(case: Case, chosen: tuple[int, ...], step: np.ndarray, unit: np.ndarray) -> Seen:
    """k + 1 columns: effect of the directions at a step, per m/s^2, and the residual there."""
    wrench = case.wrench
    here = wrench.model(moved_by(case, chosen, step))
    columns, at = [], 0
    for i in chosen:
        effect = case.effects[i]
        for k in range(effect.width):
            if effect.map_share:
                pair = effect.force[..., k], effect.torque[..., k]
            else:
                by = _small(effect.lower[k], effect.upper[k], step[at])
                there = wrench.model(moved_by(case, chosen, step + by * (np.arange(len(step)) == at)))
                pair = (there[0] - here[0]) / by, (there[1] - here[1]) / by
            columns.append((pair[0], balanced(wrench, effect.term, pair[1])))
            at += 1
    return case.rows.of(*(np.stack([c[k] / u for c, u in zip(columns, unit, strict=True)], -1) for k in range(2))
                        ) + _left(case, chosen, step)


def _left(case: Case, chosen: tuple[int, ...], step: np.ndarray) -> Seen:
    """The residual at a step."""
    left = case.wrench.residual(moved_by(case, chosen, step))
    for i, part in parts_of(case, chosen, step):
        if case.effects[i].map_share:
            left = left[0] - case.effects[i].force @ part, left[1] - case.effects[i].torque @ part
    return case.rows.of(left[0][..., None], left[1][..., None])


def _small(lower: float, upper: float, at: float) -> float:
    """A step along a direction that stays inside."""
    by = 1e-3 * min(upper - lower, 1.0)
    return by if at + by < upper else -by


def on_map(case: Case, chosen: tuple[int, ...], model: Model) -> Model:
    """A model of the space, on the other thrust map if that is identified."""
    if not any(case.effects[i].map_share for i in chosen):
        return model
    other = with_other_map(model, float(np.median(case.wrench.battery_V)))
    assert other is not None  # its share was found
    return other
