"""Does the corrected simulator predict flights it was not fitted to better? Multi-step predictions before and after."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from nanobench_tools import so3
from nanobench_tools.metrics.statistics import draws
from nanobench_tools.physics import Model
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.settings import count, setting

from .along import paths
from .decide import Decision
from .fitting import Slopes, fit
from .moments import Moments
from .naming import free_of
from .space import LEVEL, MAPS, Space, reduced, space_around
from .track import ROW_S, Track

HORIZONS = setting("mismatch.proof.horizons")
EVERY = count("mismatch.proof.every")
WARM = count("mismatch.proof.warm")
FOLDS = count("mismatch.proof.folds")
CLIP = setting("mismatch.proof.clip")
THIRD, MEDIAN_OF_CHI2 = 20.0, 0.455
"""Variance of a third difference of unit white noise; median of the square of a unit normal."""
SCALE = "thrust_scale.s"
QUANTITIES = ("position_m", "velocity_m_s", "attitude_rad", "rate_rad_s")
PATH = 2
"""The first of them are predicted even where no motor commands were logged; the others are nan then."""


@dataclass(frozen=True)
class Proof:
    """Prediction of flights left out, before and after.

    Errors (flights, H, 4) at HORIZONS of QUANTITIES. The fit has not seen the predicted flight. Per-flight parameters
    have that flight's value both before and after. ``flights``: names. interval {h: (lo, hi)}: removed fraction of the
    error of the most improved quantity. ``share_of_achievable``: compared with a regression without physics; None
    without an identified effect. ``along`` (F,): removed fraction of each left-out flight's residual along the measured
    states, above the plain level. ``floor`` (H, 4): errors from noise of the start alone.
    """

    before: np.ndarray
    after: np.ndarray
    flights: tuple[str, ...]
    held_out: bool
    interval: Mapping[int, tuple[float, float]]
    share_of_achievable: float | None
    models: tuple[Model, Model]
    along: np.ndarray = field(default_factory=lambda: np.zeros(0))
    floor: np.ndarray | None = None

    @property
    def better(self) -> bool:
        """At h = 50 or 10 some quantity improves with an interval above zero, and no quantity gets worse by more than
        that."""
        return self._better_in(slice(None))

    @property
    def no_worse(self) -> bool:
        """At h = 50 or 10 something improves by more than anything gets worse."""
        change = self._change(slice(None))
        return bool(change.max() > max(-change.min(), 0.0))

    def _change(self, quantities: slice) -> np.ndarray:
        change = 1.0 - self.after.mean(0)[1:, quantities] / np.maximum(self.before.mean(0)[1:, quantities], 1e-12)
        return np.asarray(change[np.isfinite(change)])

    def _better_in(self, quantities: slice) -> bool:
        change = self._change(quantities)
        return any(low > 0.0 for h, (low, _) in self.interval.items() if h > 1) and change.max() > -change.min()

    def better_pushed(self, seed: int = 0) -> bool:
        """The same for position and velocity alone, and along the measured states. Forces are judged by these: they
        turn the vehicle only through the position of the centre of mass in these flights."""
        return self._better_in(slice(0, 2)) and self.better_along(seed)

    def better_along(self, seed: int = 0) -> bool:
        """The residual of left-out flights along the measured states gets smaller, with an interval above zero."""
        if not self.held_out or len(self.along) < 2:
            return False
        return bool(np.quantile(_drawn_means(self.along, seed), 0.025) > 0.0)


def turned_better(without: np.ndarray, with_it: np.ndarray) -> bool:
    """Whether, of errors (flights, H, 4), attitude or rate at h = 10 or 50 improves by more than any gets worse."""
    change = 1.0 - with_it.mean(0)[1:, PATH:] / np.maximum(without.mean(0)[1:, PATH:], 1e-12)
    return bool(change.max() > max(-change.min(), 0.0)) if np.isfinite(change).all() else True


def prove(moments: Moments, decision: Decision, simulator: Model, seed: int = 0) -> Proof:
    """Leave flights out in turn (at most FOLDS times), fit the identified effects to the others, predict them. Where
    flights differ, each is predicted with its per-flight value and none is held out."""
    tracks = moments.wrench.tracks
    numbers = sorted({t.flight for t in tracks})
    names = {t.flight: t.name for t in tracks}
    terms = [f.hypothesis.term for f in decision.findings]
    corrected = reduced(decision.fit.model, decision.space.believed, tuple(terms))
    first = space_around(simulator)
    known = Slopes(moments)
    whole = bool(set(terms) & set(MAPS)) and not set(terms) & set(LEVEL)
    told = {*decision.own, *(LEVEL if set(decision.own) & set(LEVEL) else ())}
    before = _each(own_levels(known, first, first.model, (), whole, told), tracks, numbers)
    floor = floor_of(simulator, tracks, seed)
    if not terms:
        return Proof(before, before, tuple(names[n] for n in numbers), len(numbers) > 1, {}, None,
                     (simulator, simulator), floor=floor)
    after = np.empty_like(before)
    gained, possible = 0.0, 0.0
    folds = [numbers[k::FOLDS] for k in range(min(FOLDS, len(numbers)))] if len(numbers) > 1 else [numbers]
    free = free_of(decision.space, terms)
    if decision.own:  # a flight that differs can only be predicted with a per-flight value
        models = own_levels(known, decision.space, decision.fit.model, terms, whole, told)
        after = _each([model.with_parameters({name: decision.fit.model.parameters[name] + float(row[k])
                                              for name, row in decision.fit.own.items()})
                       for k, model in enumerate(models)], tracks, numbers)
        return Proof(before, after, tuple(names[n] for n in numbers), False, relative_intervals(before, after, seed),
                     None, (simulator, corrected), floor=floor)
    along = np.zeros(len(numbers))
    for left_out in folds:
        others = [n for n in numbers if n not in left_out] or numbers
        fitted = fit(Slopes(moments, others), _rest(decision), free, own=free_of(decision.space, decision.own)).model
        places = [numbers.index(number) for number in left_out]
        after[places] = _each(own_levels(known, decision.space, fitted, terms, whole), tracks, numbers, places)
        for place, number in zip(places, left_out, strict=True):
            judge = Slopes(moments, [number])
            start, end = (fit(judge, model, []) for model in (first.model, fitted))
            plain = len(start.left) / len(numbers)
            gained += start.loss - end.loss
            possible += start.loss - plain
            along[place] = (start.loss - end.loss) / max(start.loss - plain, plain)
    share = float(np.clip(gained / possible, 0.0, 1.0)) if possible > 0.0 else None
    return Proof(before, after, tuple(names[n] for n in numbers), len(numbers) > 1,
                 relative_intervals(before, after, seed), share, (simulator, corrected), along, floor)


def _each(models: Sequence[Model], tracks: Sequence[Track], numbers: Sequence[int],
          places: Sequence[int] | None = None) -> np.ndarray:
    """(places, H, 4) errors of some flights, all by default, each with its model of ``models``."""
    return np.concatenate([prediction_errors(models[k], [t for t in tracks if t.flight == numbers[k]], [numbers[k]])
                           for k in (range(len(numbers)) if places is None else places)])


def own_levels(known: Slopes, space: Space, model: Model, terms: Sequence[str], whole: bool,
               told: Collection[str] = ()) -> list[Model]:
    """``model`` of ``space`` without the effects that were not identified, once per flight.

    Parameters that scatter between flights keep the flight's deviation from the mean, both before and after. So the
    explanation includes neither this deviation nor the part that all flights share. ``whole``: include the mean of
    thrust, where an identified curve has to explain more than an offset. ``told``: terms reported to differ between
    flights, which do not scatter in addition.
    """
    scattered = {name: each for name, each in fit(known, model, []).levels.items()
                 if name.partition(".")[0] not in told}
    flights = len(np.unique(known.moments.wrench.flight))
    keep = (*terms, *dict.fromkeys(name.partition(".")[0] for name in scattered))
    found = []
    for k in range(flights):
        own = {name: model.parameters[name] + float(each[k] - (0.0 if whole and name == SCALE else each.mean()))
               for name, each in scattered.items()}
        inside = {name: float(np.clip(value, *bounds_of(model, name))) for name, value in own.items()}
        found.append(reduced(model.with_parameters(inside), space.believed, keep))
    return found


def bounds_of(model: Model, name: str) -> tuple[float, float]:
    """Of one parameter."""
    i = model.index(name)
    return float(model.lower[i]), float(model.upper[i])


def _rest(decision: Decision) -> Model:
    """Start of the fits of the folds: the fit of all flights (only the start of a convex search)."""
    return decision.fit.model


def relative_intervals(before: np.ndarray, after: np.ndarray, seed: int) -> dict[int, tuple[float, float]]:
    """95 % of the relative improvement at each horizon, flights drawn anew; of the quantity that improves most."""
    found = {}
    for k, h in enumerate(HORIZONS):
        gain = 1.0 - after[:, k] / np.maximum(before[:, k], 1e-12)
        gain = gain[:, np.isfinite(gain).all(axis=0)]
        best = gain[:, int(np.argmax(gain.mean(axis=0)))]
        low, high = np.quantile(_drawn_means(best, seed), [0.025, 0.975])
        found[h] = (float(low), float(high))
    return found


def _drawn_means(values: np.ndarray, seed: int) -> np.ndarray:
    return np.asarray(draws(tuple(range(len(values))), seed) @ values / len(values))


def _noise(track: Track, rng: np.random.Generator) -> np.ndarray:
    """(n, 12) noise of position, velocity, rotation vector (body) and rate as this track has it, drawn anew. White
    noise is read from third differences (Gasser, Sroka and Jennen-Steinmetz 1986, Biometrika 73); velocity is the slope
    of a spline through noisy positions."""
    def white(values: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(np.median(np.diff(values, 3, axis=0) ** 2, axis=0) / (THIRD * MEDIAN_OF_CHI2)))

    turned = so3.log(so3.multiply(so3.conjugate(track.quaternion[:-1]), track.quaternion[1:]))
    position = rng.normal(size=track.position_m.shape) * white(track.position_m)
    turning = rng.normal(size=(len(track), 3)) * white(np.concatenate([np.zeros((1, 3)), np.cumsum(turned, axis=0)]))
    return np.concatenate([position, CubicSpline(track.time_s, position)(track.time_s, 1), turning,
                           rng.normal(size=track.rate_rad_s.shape) * white(track.rate_rad_s)], axis=1)


def floor_of(model: Model, tracks: Sequence[Track], seed: int) -> np.ndarray:
    """(H, 4) mean errors of a right model, from noise in its start and in the poses that judge it. Predictions from
    starts with resampled noise are compared with each other. Gusts add to this."""
    rng = np.random.default_rng([seed, 7])
    noisy = []
    for track in tracks:
        noise = _noise(track, rng)
        turned = so3.multiply(track.quaternion, so3.exp(noise[:, 6:9]))
        noisy.append((replace(track, position_m=track.position_m + noise[:, 0:3], quaternion=turned,
                              velocity_m_s=track.velocity_m_s + noise[:, 3:6],
                              rate_rad_s=track.rate_rad_s + noise[:, 9:12]), noise))
    sums, count = np.zeros((len(HORIZONS), 4)), 0
    for track, (moved, noise) in zip(tracks, noisy, strict=True):
        starts = window_starts(track)
        if not len(starts):
            continue
        plain, other = (rolled(model, t, starts) for t in (track, moved))
        for k, h in enumerate(HORIZONS):
            end = noise[starts + h]
            a, b = plain[:, h], other[:, h]
            parts = (a[:, 0:3] - b[:, 0:3] - end[:, 0:3], a[:, 3:6] - b[:, 3:6] - end[:, 3:6],
                     so3.log(so3.multiply(so3.conjugate(a[:, 6:10]), b[:, 6:10])) - end[:, 6:9],
                     a[:, 10:13] - b[:, 10:13] - end[:, 9:12])
            sums[k] += [np.minimum(np.linalg.norm(p, axis=1), CLIP).sum() for p in parts]
        count += len(starts)
    return _told(sums / max(count, 1), tracks)


def window_starts(track: Track) -> np.ndarray:
    """Rows from which predictions of a track begin."""
    span = HORIZONS[-1]
    starts = np.arange(WARM, len(track) - span - 1, EVERY)
    return np.array([s for s in starts if track.counts[s:s + span + 1].all()], int)


def rolled(model: Model, track: Track, starts: np.ndarray) -> np.ndarray:
    """(starts, rows, 13) states predicted from the measured ones; along the measured attitude where only forces are
    compared."""
    if track.forces_only:
        return paths(model, track, starts, HORIZONS[-1], WARM)
    ahead, behind = starts[:, None] + np.arange(HORIZONS[-1]), starts[:, None] + np.arange(-WARM, 0)
    start = np.concatenate([track.position_m, track.velocity_m_s, track.quaternion, track.rate_rad_s], 1)[starts]
    return rollout(model, start, track.motor[ahead], track.battery_V[ahead],
                   (track.motor[behind], track.battery_V[behind]), row_hz=1.0 / ROW_S)


def prediction_errors(model: Model, tracks: Sequence[Track], numbers: Sequence[int]) -> np.ndarray:
    """(flights, horizons, 4) mean norms of the errors."""
    sums, counts = np.zeros((len(numbers), len(HORIZONS), 4)), np.zeros(len(numbers))
    for track in tracks:
        starts = window_starts(track)
        if not len(starts):
            continue
        states = rolled(model, track, starts)
        at = numbers.index(track.flight)
        for k, h in enumerate(HORIZONS):
            end, state = starts + h, states[:, h]
            for q, error in enumerate((
                    np.linalg.norm(state[:, 0:3] - track.position_m[end], axis=1),
                    np.linalg.norm(state[:, 3:6] - track.velocity_m_s[end], axis=1),
                    so3.geodesic_angle(state[:, 6:10], track.quaternion[end]),
                    np.linalg.norm(state[:, 10:13] - track.rate_rad_s[end], axis=1))):
                sums[at, k, q] += np.minimum(error, CLIP).sum()
        counts[at] += len(starts)
    return _told(sums / np.maximum(counts, 1)[:, None, None], tracks)


def _told(errors: np.ndarray, tracks: Sequence[Track]) -> np.ndarray:
    """errors (..., 4) without those of the quantities that were given."""
    if any(t.forces_only for t in tracks):
        errors[..., PATH:] = np.nan
    return errors
