"""Does the corrected simulator predict flights it was not fitted to better? Multi-step predictions before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.physics.rollout import rollout

from .decide import Decision
from .fitting import Slopes, fit
from .moments import Moments
from .naming import free_of
from .space import reduced, space_around
from .track import ROW_S, Track

HORIZONS = (1, 10, 50)
EVERY = 25
"""Rows between the starts of windows."""
WARM = 50
FOLDS = 5
QUANTITIES = ("position_m", "velocity_m_s", "attitude_rad", "rate_rad_s")


@dataclass(frozen=True)
class Proof:
    """Errors (flights, H, 4) at HORIZONS of QUANTITIES before and after, each flight predicted by a fit that had not
    seen it; flights: their names; improved: share of the squared error taken away {h: (mean, lo, hi)} of the quantity
    named; share_of_achievable against a regression that knows no physics (None where nothing was named)."""

    before: np.ndarray
    after: np.ndarray
    flights: tuple[str, ...]
    held_out: bool
    interval: Mapping[int, tuple[float, float]]
    share_of_achievable: float | None
    models: tuple[Model, Model]

    @property
    def better(self) -> bool:
        """At h = 50 or 10 something improves with an interval above nothing, and nothing gets worse by more than it."""
        change = 1.0 - self.after.mean(0)[1:] / np.maximum(self.before.mean(0)[1:], 1e-12)
        return any(low > 0.0 for h, (low, _) in self.interval.items() if h > 1) and change.max() > -change.min()


def prove(moments: Moments, decision: Decision, simulator: Model, seed: int = 0) -> Proof:
    """Leave flights out in turn (at most FOLDS times), fit what was named to the others, predict them. Where flights
    differ each is predicted with its own value, and nothing is held out."""
    tracks = moments.wrench.tracks
    numbers = sorted({t.flight for t in tracks})
    names = {t.flight: t.name for t in tracks}
    terms = [f.hypothesis.term for f in decision.findings]
    corrected = reduced(decision.fit.model, decision.space.believed, tuple(terms))
    before = _errors(simulator, tracks, numbers)
    if not terms:
        return Proof(before, before, tuple(names[n] for n in numbers), len(numbers) > 1, {}, None,
                     (simulator, simulator))
    after = np.empty_like(before)
    gained, possible, first = 0.0, 0.0, space_around(simulator).model
    folds = [numbers[k::FOLDS] for k in range(min(FOLDS, len(numbers)))] if len(numbers) > 1 else [numbers]
    free = free_of(decision.space, terms)
    if decision.own:  # a flight that differs can only be predicted with a value of its own
        for k, number in enumerate(numbers):
            own = {name: decision.fit.model.parameters[name] + float(row[k]) for name, row in decision.fit.own.items()}
            after[k] = _errors(corrected.with_parameters(own), [t for t in tracks if t.flight == number], [number])[0]
        return Proof(before, after, tuple(names[n] for n in numbers), False, _intervals(before, after, seed), None,
                     (simulator, corrected))
    for left_out in folds:
        others = [n for n in numbers if n not in left_out] or numbers
        fitted = fit(Slopes(moments, others), _rest(decision), free, own=free_of(decision.space, decision.own)).model
        mine = [t for t in tracks if t.flight in left_out]
        after[[numbers.index(n) for n in left_out]] = _errors(corrected.with_parameters(
            {n: v for n, v in fitted.parameters.items() if n in corrected.names}), mine, left_out)
        judge = Slopes(moments, left_out)
        start, end = judge.left(first), judge.left(fitted)
        gained += float(start @ start - end @ end)
        possible += float(start @ start) - len(start) * len(left_out) / len(numbers)
    return Proof(before, after, tuple(names[n] for n in numbers), len(numbers) > 1,
                 _intervals(before, after, seed), float(np.clip(gained / possible, 0.0, 1.0)) if possible > 0.0 else
                 None, (simulator, corrected))


def _rest(decision: Decision) -> Model:
    """Where the fits of the folds begin: what was found with all flights (only the start of a convex search)."""
    return decision.fit.model


def _intervals(before: np.ndarray, after: np.ndarray, seed: int) -> dict[int, tuple[float, float]]:
    """95 % of the relative improvement at each horizon, flights drawn anew; of the quantity that improves most."""
    rng = np.random.default_rng(seed)
    found = {}
    for k, h in enumerate(HORIZONS):
        gain = 1.0 - after[:, k] / np.maximum(before[:, k], 1e-12)
        best = gain[:, int(np.argmax(gain.mean(axis=0)))]
        drawn = rng.choice(best, (2000, len(best))).mean(axis=1)
        low, high = np.quantile(drawn, [0.025, 0.975])
        found[h] = (float(low), float(high))
    return found


def _errors(model: Model, tracks: Sequence[Track], numbers: Sequence[int]) -> np.ndarray:
    """(flights, horizons, 4) mean norms of the errors."""
    sums, counts = np.zeros((len(numbers), len(HORIZONS), 4)), np.zeros(len(numbers))
    span = HORIZONS[-1]
    for track in tracks:
        judged = track.counts
        starts = np.arange(WARM, len(track) - span - 1, EVERY)
        starts = np.array([s for s in starts if judged[s:s + span + 1].all()], int)
        if not len(starts):
            continue
        ahead, behind = starts[:, None] + np.arange(span), starts[:, None] + np.arange(-WARM, 0)
        start = np.concatenate([track.position_m, track.velocity_m_s, track.quaternion, track.rate_rad_s], 1)[starts]
        states = rollout(model, start, track.motor[ahead], track.battery_V[ahead],
                         (track.motor[behind], track.battery_V[behind]), row_hz=1.0 / ROW_S)
        at = numbers.index(track.flight)
        for k, h in enumerate(HORIZONS):
            end, state = starts + h, states[:, h]
            for q, error in enumerate((
                    np.linalg.norm(state[:, 0:3] - track.position_m[end], axis=1),
                    np.linalg.norm(state[:, 3:6] - track.velocity_m_s[end], axis=1),
                    so3.geodesic_angle(state[:, 6:10], track.quaternion[end]),
                    np.linalg.norm(state[:, 10:13] - track.rate_rad_s[end], axis=1))):
                sums[at, k, q] += np.minimum(error, 10.0).sum()
        counts[at] += len(starts)
    return sums / np.maximum(counts, 1)[:, None, None]
