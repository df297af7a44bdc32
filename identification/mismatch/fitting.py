"""A hypothesis fitted to the residual: a few parameters of a model changed until the projection is smallest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import null_space

from nanobench_tools.metrics import statistics
from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number

from .moments import Moments
from .space import fixed_mean, scales
from .wrench import Wrench

TIMING = "command_delay.delay_s"
TIMING_SD_S = number("mismatch.fitting.timing_sd_s")
SPEED_LAG = number("mismatch.fitting.speed_lag")
AT_ROTORS = number("mismatch.fitting.at_rotors")
STEP = 1e-3
"""Of a parameter's scale: difference quotients."""
STEPS = 4
SETTLED = number("mismatch.fitting.settled")
MISSED = number("mismatch.fitting.missed")
PRIOR_SD = number("mismatch.fitting.prior_sd")
OWN_SD = number("mismatch.fitting.own_sd")
DRAWS = 200
LEAST_FLIGHTS = count("mismatch.fitting.least_flights")
SHORTER = number("mismatch.fitting.shorter")
LITTLE = number("mismatch.fitting.little")


@dataclass(frozen=True)
class Fit:
    """``model`` at the end; ``free`` indices of its parameters; ``covariance`` (F, F) of them in their own units,
    assuming that everything else is right; ``loss``: squared length of the residual; ``left`` (K,): the projected
    residual."""

    model: Model
    free: np.ndarray
    covariance: np.ndarray
    loss: float
    left: np.ndarray
    on_bound: tuple[str, ...] = field(default=())
    own: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Terms that differ between flights: flat name -> (flights,) deviation from the shared value."""
    levels: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Parameters that scatter between flights: flat name -> (flights,) deviation from the shared value."""
    beside: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(K,) contribution of the nuisances: the moment of the commands, and differences between flights."""


class Slopes:
    """Projected effects of parameters (K,) per scale, each computed once at a model's values; of some flights only
    when ``flights`` are given. ``anchor``: a model whose slopes are good enough to rank hypotheses."""

    def __init__(self, moments: Moments, flights: Sequence[int] | None = None) -> None:
        self.moments, self._mask = moments, None
        self.anchor: Model | None = None
        if flights is not None:
            wrench = moments.wrench
            mine = np.isin(wrench.flight, flights)
            self._mask = mine[wrench.force_at], mine[wrench.torque_at]
        self._known: dict[tuple[Any, ...], np.ndarray] = {}
        self._left: dict[tuple[Any, ...], np.ndarray] = {}

    def _project(self, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
        if self._mask is not None:
            shape = (-1,) + (1,) * (force.ndim - 1)
            force, torque = force * self._mask[0].reshape(shape), torque * self._mask[1].reshape(shape)
        return self.moments.project(force, torque)

    def near(self, model: Model) -> Model:
        """The anchor where it has the same structure."""
        return self.anchor if self.anchor is not None and self.anchor.structure == model.structure else model

    def columns(self, model: Model, which: Sequence[int] | np.ndarray) -> np.ndarray:
        """(K, F)."""
        new = [int(i) for i in which if (*model.key, int(i)) not in self._known]
        if new:
            found = self._project(*slopes(self.moments.wrench, model, new))
            for column, i in enumerate(new):
                self._known[(*model.key, i)] = found[:, column]
        if not len(which):
            return np.zeros((len(self.moments.owner), 0))
        return np.stack([self._known[(*model.key, int(i))] for i in which], axis=1)

    def directions(self, model: Model, which: Sequence[int] | np.ndarray) -> np.ndarray:
        """(K, D) ``columns`` along which parameters may move: a list keeps its sum."""
        which = np.asarray(which, int)
        return np.asarray(self.columns(model, which) @ _ways(model, which))

    def of_flights(self, model: Model, which: Sequence[int] | np.ndarray) -> np.ndarray:
        """(K, F * flights): effect of each parameter in each flight alone, parameter by parameter, at the anchor."""
        return self._flights_at(self.near(model), which)

    def levels(self, without: Sequence[str] = ()) -> tuple[list[str], np.ndarray]:
        """Parameters that scatter between flights, except some, and (K, F * flights) the effect of one standard
        deviation of each in each flight."""
        found = self.moments.levels
        keep = [k for k, name in enumerate(found.names) if name not in without] if found else []
        if not found or not keep:
            return [], np.zeros((len(self.moments.owner), 0))
        columns = self._flights_at(found.model, [found.which[k] for k in keep])
        sds = np.array([found.sd_scales[k] for k in keep])
        return [found.names[k] for k in keep], columns * np.repeat(sds, columns.shape[1] // len(keep))

    def _flights_at(self, model: Model, which: Sequence[int] | np.ndarray) -> np.ndarray:
        wrench = self.moments.wrench
        numbers = np.unique(wrench.flight)
        for i in which:
            key = (*model.key, int(i), "flights")
            if key not in self._known:
                force, torque = (part[..., 0] for part in slopes(wrench, model, [int(i)]))
                masks = [(wrench.flight[wrench.force_at] == f, wrench.flight[wrench.torque_at] == f) for f in numbers]
                self._known[key] = self._project(np.stack([force * m[:, None] for m, _ in masks], -1),
                                                 np.stack([torque * m[:, None] for _, m in masks], -1))
        return np.concatenate([self._known[(*model.key, int(i), "flights")] for i in which], axis=1)

    def speed_lag(self, model: Model) -> np.ndarray:
        """(K, 1) effect of rotors whose speed lags instead of their thrust."""
        key = (*model.key, "speed lag")
        if key not in self._known:
            self._known[key] = self._project(*self.moments.wrench.speed_lag(model))
        return self._known[key][:, None]

    def drag_at_rotors(self, model: Model) -> np.ndarray:
        """(K, 1) effect of drag that acts at the rotors instead of at their centre."""
        key = (*model.key, "drag at rotors")
        if key not in self._known:
            self._known[key] = self._project(*self.moments.wrench.drag_at_rotors(model))
        return self._known[key][:, None]

    def nuisances(self, model: Model, free: Sequence[int] | np.ndarray,
                  own: Sequence[int] | np.ndarray = ()) -> tuple[np.ndarray, list[str]]:
        """(K, E) effect of one standard deviation of each nuisance of a fit of ``free``, and the names of the
        parameters. Those that scatter between flights are last, with one column per flight."""
        timing = model.names.index(TIMING) if TIMING in model.names else None
        found = [SPEED_LAG * self.speed_lag(model), AT_ROTORS * self.drag_at_rotors(model)]
        if timing is not None and timing not in free:
            found.insert(0, self.columns(model, [timing]) / scales(model)[timing] * TIMING_SD_S)
        if len(own):
            found.append(OWN_SD * self.of_flights(model, own))
        scattered, columns = self.levels([model.names[int(i)] for i in own])
        return np.concatenate([*found, columns], axis=1), scattered

    def cleaned(self, model: Model, columns: np.ndarray) -> np.ndarray:
        """(K, F) ``columns`` without the part that the nuisances of a fit without free parameters explain."""
        extra = self.nuisances(model, [])[0]
        taken = np.linalg.solve(np.eye(extra.shape[1]) + extra.T @ extra, extra.T @ columns)
        return np.asarray(columns - extra @ taken)

    def left(self, model: Model) -> np.ndarray:
        """(K,) projection of the residual of a model."""
        if model.key not in self._left:
            self._left[model.key] = self._project(*self.moments.wrench.residual(model))
        return self._left[model.key]


def slopes(wrench: Wrench, model: Model, which: Sequence[int] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Effect of each parameter on force and torque: (N, 3, F), (M, 3, F), per scale of the parameter."""
    sizes = scales(model)
    force = np.empty((*wrench.measured[0].shape, len(which)))
    torque = np.empty((*wrench.measured[1].shape, len(which)))
    for column, i in enumerate(which):
        key = (*model.key, int(i))
        if key not in wrench.slopes:
            moved, here = model.values.copy(), wrench.model(model)
            step = STEP * sizes[i] * (1.0 if moved[i] + STEP * sizes[i] <= model.upper[i] else -1.0)
            moved[i] += step
            there = wrench.model(model, moved)
            wrench.slopes[key] = tuple((b - a) * (sizes[i] / step) for a, b in zip(here, there, strict=True))
        force[..., column], torque[..., column] = wrench.slopes[key]
    return force, torque


def fit(known: Slopes, model: Model, free: Sequence[int] | np.ndarray, steps: int = STEPS,
        own: Sequence[int] | np.ndarray = ()) -> Fit:
    """Gauss-Newton with step halving, within the parameters' bounds. ``own``: per-flight parameters, around the shared
    value and to first order.

    Every fit has four nuisances. The moment of its row that a command represents varies within TIMING_SD_S, to first
    order, unless the delay itself is fitted. The speed of the rotors may lag (``Wrench.speed_lag``). Drag may act at
    the rotors (``Wrench.drag_at_rotors``). Flights scatter (``Moments.levels``).
    """
    free = np.asarray(free, int)
    sizes, weight = scales(model)[free], np.full(len(free), 1.0 / PRIOR_SD)
    own = np.asarray(own, int)
    extra, scattered = known.nuisances(model, free, own)
    gram = np.linalg.inv(np.eye(extra.shape[1]) + extra.T @ extra)
    ways = _ways(model, free)
    start = values = model.values[free]

    def at(chosen: np.ndarray) -> Model:
        vector = model.values.copy()
        vector[free] = chosen
        return model.with_values(vector)

    def without_nuisances(left: np.ndarray) -> np.ndarray:
        return left - extra @ (gram @ (extra.T @ left)) if extra.shape[1] else left

    def cost_of(chosen: np.ndarray) -> tuple[float, np.ndarray]:
        left = known.left(at(chosen))
        better, moved = without_nuisances(left), (chosen - start) / sizes if len(free) else start
        penalty = float(np.sum((weight * moved) ** 2))
        # the remaining part along the nuisances counts with their prior
        return float(left @ better) + penalty, better

    cost, left = cost_of(values)
    matrix = np.zeros((len(left), len(free)))
    for _ in range(steps if len(free) else 0):
        matrix = known.columns(at(values), free)
        clean = np.stack([without_nuisances(c) for c in matrix.T], axis=1)
        normal = matrix.T @ clean + np.diag(weight**2)
        gradient = clean.T @ known.left(at(values)) - weight**2 * (values - start) / sizes
        step = ways @ np.linalg.solve(ways.T @ normal @ ways, ways.T @ gradient)
        share, better, promised = 1.0, False, float(step @ gradient)
        for _ in range(5):
            trial = np.clip(values + share * step * sizes, model.lower[free], model.upper[free])
            new_cost, new_left = cost_of(trial)
            if new_cost < cost - 1e-9:
                better = True
                break
            share *= SHORTER
        if not better:
            break
        gain, (values, left, cost) = cost - new_cost, (trial, new_left, new_cost)
        if gain < LITTLE or (share == 1.0 and abs(gain - promised) < min(SETTLED * promised, MISSED)):
            break
    clean = np.stack([without_nuisances(c) for c in matrix.T], axis=1) if len(free) else matrix
    normal = ways.T @ (matrix.T @ clean + np.diag(weight**2)) @ ways
    covariance = (ways @ np.linalg.inv(normal) @ ways.T) * np.outer(sizes, sizes)
    found = at(values)
    on = tuple(model.names[i] for i, v in zip(free, values, strict=True)
               if v <= model.lower[i] + 1e-12 or v >= model.upper[i] - 1e-12)
    nuisance = gram @ (extra.T @ known.left(found))
    flights = len(np.unique(known.moments.wrench.flight))
    each = nuisance[len(nuisance) - (len(own) + len(scattered)) * flights:].reshape(-1, flights)
    return Fit(found, free, covariance, cost, left, on,
               {model.names[i]: OWN_SD * row * scales(model)[i] for i, row in zip(own, each, strict=False)},
               _level_values(known, scattered, each[len(own):]), extra @ nuisance)


def _level_values(known: Slopes, names: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Rows in standard deviations -> in the parameters' units."""
    levels = known.moments.levels
    if levels is None:
        return {}
    unit = scales(levels.model)[list(levels.which)] * levels.sd_scales
    return {name: row * unit[levels.names.index(name)] for name, row in zip(names, rows, strict=True)}


def bootstrap(known: Slopes, fit: Fit, own: Sequence[int] | np.ndarray = (), draws: int = DRAWS,
              seed: int = 0) -> np.ndarray:
    """(F,) standard deviation of a fit's free parameters, to first order, by resampling flights (Efron and Tibshirani
    1993, ch. 6). Widened for few flights; 0 for too few."""
    wrench, model = known.moments.wrench, fit.model
    numbers = np.unique(wrench.flight)
    many, sizes = len(numbers), scales(model)[fit.free]
    if many < LEAST_FLIGHTS or not len(fit.free):
        return np.zeros(len(fit.free))
    columns = known.of_flights(model, fit.free).reshape(len(known.moments.owner), len(fit.free), many)
    masks = [(wrench.flight[wrench.force_at] == f, wrench.flight[wrench.torque_at] == f) for f in numbers]
    force, torque = wrench.residual(model)
    left = known.moments.project(np.stack([force * m[:, None] for m, _ in masks], -1),
                                 np.stack([torque * m[:, None] for _, m in masks], -1))
    beside = known.levels([model.names[i] for i in own])[1]
    if len(own):
        beside = np.concatenate([OWN_SD * known.of_flights(model, own), beside], axis=1)
    prior = np.diag(np.full(len(fit.free), PRIOR_SD**-2.0))
    ways = _ways(model, fit.free)
    found = np.empty((draws, len(fit.free)))
    for k, weight in enumerate(statistics.draws(tuple(range(many)), seed, draws)):
        here, what = columns @ weight, left @ weight
        if beside.shape[1]:
            nuisance = beside * np.tile(weight, beside.shape[1] // many)
            gram = np.linalg.solve(np.eye(nuisance.shape[1]) + nuisance.T @ nuisance, nuisance.T)
            clean = here - nuisance @ (gram @ here)
        else:
            clean = here
        found[k] = ways @ np.linalg.solve(ways.T @ (here.T @ clean + prior) @ ways, ways.T @ (clean.T @ what))
    return np.asarray(found.std(axis=0) * sizes * np.sqrt(many / (many - 1.0)))


def force_left(known: Slopes, fit: Fit) -> np.ndarray:
    """(N, 3) residual of force, without the differences between flights."""
    wrench, levels = known.moments.wrench, known.moments.levels
    left = wrench.residual(fit.model)[0].copy()
    flight = wrench.flight[wrench.force_at]
    number = np.searchsorted(np.unique(flight), flight)
    for model, found in ((known.near(fit.model), fit.own), (levels.model if levels else fit.model, fit.levels)):
        which = [model.index(name) for name in found]
        force, _ = slopes(wrench, model, which)
        for column, (i, each) in enumerate(zip(which, found.values(), strict=True)):
            left -= force[..., column] * (each / scales(model)[i])[number][:, None]
    return left


def _ways(model: Model, free: np.ndarray) -> np.ndarray:
    """(F, D) orthonormal directions, per scale, in which parameters may move: lists of a fixed mean keep their sum."""
    known = fixed_mean(model)
    bases = [known[i] for i in free]
    rows = [[size * (b == base) for b, size in zip(bases, scales(model)[free], strict=True)]
            for base in dict.fromkeys(bases) if base]
    return null_space(np.array(rows)) if rows else np.eye(len(free))
