"""Which effect explains the residual: every term of the vocabulary as a hypothesis, forward, and backward again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.numeric import equations
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.settings import count, number

from .fitting import Fit, Slopes, fit
from .moments import Moments
from .space import LEVEL, MAPS, PWM_MAPS, Space, space_of_other_map
from .tolerance import ANSWERED, feigned, impossible
from .track import ROW_S

LEAST_GAIN = number("mismatch.naming.least_gain")
PER_PARAMETER = number("mismatch.naming.per_parameter")
ALIKE_SD2 = number("mismatch.naming.alike_sd2")
ALIKE_LEFT = number("mismatch.naming.alike_left")
REDUNDANT = number("mismatch.naming.redundant")
MOST = count("mismatch.naming.most")
SLOPPY = number("mismatch.naming.sloppy")
ELSEWHERE = number("mismatch.naming.elsewhere")
AT_MOST = number("mismatch.naming.at_most")
REST = number("mismatch.naming.rest")
CHANGING = terms_that(lambda term: term.changes)
"""Terms that may have changed between two flights."""
CHANGED = number("mismatch.naming.changed")
PUSHES = terms_that(lambda term: term.of_air)
ALONE = number("mismatch.naming.alone")
TRIED = count("mismatch.naming.tried")
MOSTLY = number("mismatch.naming.mostly")


@dataclass(frozen=True)
class Hypothesis:
    """A term, the model in which it may change, and its free parameters. ``gain``: loss that it explains beyond chance
    for its number of parameters. ``own``: per-flight values."""

    term: str
    fit: Fit
    gain: float
    own: bool = False


@dataclass(frozen=True)
class Named:
    """Accepted hypotheses, each with its indistinguishable ones. fit: of all together. Loss before and after. rejected:
    the reasons for the others. ``feigned``: rejected ones that errors of logging could cause."""

    accepted: tuple[Hypothesis, ...]
    alike: tuple[tuple[str, ...], ...]
    space: Space
    fit: Fit
    before: float
    scores: dict[str, float] = field(default_factory=dict)
    rejected: dict[str, str] = field(default_factory=dict)
    feigned: tuple[str, ...] = ()

    def own(self, *without: str) -> np.ndarray:
        """Parameters that differ between flights, but for some terms."""
        return free_of(self.space, [h.term for h in self.accepted if h.own and h.term not in without])


HIGH = number("mismatch.naming.high")
LIMITS = terms_that(lambda term: term.is_limit)
"""Terms without a slope at their value at rest."""
FAR = terms_that(lambda term: term.far)
"""Terms that may act far from linearly, so that their first-order rank is unreliable: a long delay makes a loop
swing."""


def started(model: Model, term: str) -> Model | None:
    """Where the fit of a term begins, if not at ``model``."""
    values = model.parameters
    moved = {slot.name: slot.parameter.search_start for slot in model.slots if slot.term.name == term
             and isinstance(slot.parameter.search_start, float) and values[slot.name] == 0.0}
    return model.with_parameters(moved) if moved else None


def _limits(moments: Moments, model: Model, term: str) -> list[Model]:
    """Starts for a limit, which has no effect at rest, one for each of its parameters: of inputs, or thrusts."""
    inputs = np.concatenate([np.column_stack([t.motor, t.battery_V])[t.counts] for t in moments.wrench.tracks])
    thrust = np.stack(equations(model, ROW_S).command([*inputs.T, *inputs.T[:model.rotors], np.zeros(len(inputs))]))
    high = {"inputs": float(np.quantile(inputs[:, :model.rotors], HIGH)), "thrusts": float(np.quantile(thrust, HIGH))}
    values = model.parameters
    starts = {slot.name: high[slot.parameter.search_start] for slot in model.slots if slot.term.name == term
              and isinstance(slot.parameter.search_start, str)}
    return [model.with_parameters({n: v}) for n, v in starts.items() if v < values[n]]


def name_effects(moments: Moments, space: Space, simulator: Model,
                 progress: Callable[[str], None] | None = None) -> Named:
    """Forward: add the hypothesis that explains most, while it explains enough and exceeds the noise floor. Backward:
    drop those that later ones made redundant."""
    search = _Search(moments, space, simulator)
    nothing = search.current
    scores: dict[str, float] = {}
    while len(search.accepted) < MOST:
        tried = search.tried()
        if not search.accepted:
            scores = {h.term: h.gain for h in tried}
        best = search.best(tried)
        if best is None:
            break
        search.accept(best, tried)
        if progress:
            progress(f"{best.term} takes {best.gain:.0f} of {nothing.loss:.0f}")
    search.backward()
    return Named(tuple(search.accepted), tuple(search.alike[h.term] for h in search.accepted), search.space,
                 search.current, nothing.loss, scores, search.rejected, tuple(search.feigned))


class _Search:
    """State of the search."""

    def __init__(self, moments: Moments, space: Space, simulator: Model) -> None:
        self.moments, self.space, self.home, self.known = moments, space, space, Slopes(moments)
        self.known.anchor = space.model
        self.other = space_of_other_map(simulator, moments.wrench.battery_V, space.unasked)
        self.nothing = self.current = fit(self.known, space.model, [])
        self.accepted: list[Hypothesis] = []
        self.alike: dict[str, tuple[str, ...]] = {}
        self.rejected: dict[str, str] = {}
        self.feigned: list[str] = []

    @property
    def names(self) -> list[str]:
        return list(dict.fromkeys(h.term for h in self.accepted))

    def tried(self) -> list[Hypothesis]:
        """Every hypothesis to first order, the best of them fitted to the end; best first."""
        level = self.space.terms if not set(LEVEL) & set(self.names) else ()
        candidates = [(t, self.space, started(self.current.model, t) or self.current.model) for t in self.space.terms
                      if t not in self.names and t not in LIMITS and (t not in LEVEL or t in level)]
        candidates += [(t, self.space, m) for t in LIMITS if t in self.space.terms and t not in self.names
                       for m in _limits(self.moments, self.current.model, t)]
        if self.other is not None and not any(name in MAPS for name in self.names):
            term = next(t for t in PWM_MAPS if t in self.other.model)
            candidates.append((term, self.other, carried(self.current.model, self.other.model)))
        ranked = sorted(candidates, key=lambda c: -self._promise(*c))
        found = []
        for term, space, start in [*ranked[:TRIED], *(c for c in ranked[TRIED:] if c[0] in FAR)]:
            done = fit(self.known, start, free_of(space, [*self.names, term]), own=self.own_of(space))
            found.append(Hypothesis(term, done, self.current.loss - done.loss - PER_PARAMETER * len(space.free(term))))
        return sorted([*found, *self._tried_own(found)], key=lambda h: -h.gain)

    def own_of(self, space: Space, more: Sequence[str] = ()) -> np.ndarray:
        """Parameters of terms that differ between flights."""
        return free_of(space, [*(h.term for h in self.accepted if h.own), *more])

    def _tried_own(self, shared: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Terms that may differ between flights, when that explains clearly more than one value for all."""
        flights = len(np.unique(self.moments.wrench.flight))
        found = []
        if flights < 2:
            return []
        for term in CHANGING:
            if term not in self.space.terms or any(h.own and h.term == term for h in self.accepted):
                continue
            free = self.space.free(term)
            both = free_of(self.space, [*self.names, *([] if term in self.names else [term])])
            done = fit(self.known, self.current.model, both, own=self.own_of(self.space, [term]))
            gain = self.current.loss - done.loss - PER_PARAMETER * len(free) * flights
            one = next((h.gain for h in shared if h.term == term), 0.0)
            if gain > one + LEAST_GAIN + CHANGED * max(one, 0.0):
                found.append(Hypothesis(term, done, gain, own=True))
        return found

    def _promise(self, term: str, space: Space, start: Model) -> float:
        held, free = free_of(space, self.names), space.free(term)
        left, near = self.known.left(start), self._near(start)
        beside = np.concatenate([self._differing(start), self.known.directions(near, held),
                                 self.known.directions(near, free)], axis=1)
        return -float(left @ left) + self._explained(beside, left) - PER_PARAMETER * len(free)

    def _near(self, start: Model) -> Model:
        """Slopes suffice to rank hypotheses at the simulator's parameters, unless the start was moved on purpose."""
        return self.known.near(start) if start is self.current.model else start

    def _differing(self, model: Model) -> np.ndarray:
        """(K, N) columns of the parameters that differ between flights."""
        own = free_of(self.space, [h.term for h in self.accepted if h.own])
        return self.known.of_flights(model, own) if len(own) else np.zeros((len(self.moments.owner), 0))

    def best(self, tried: list[Hypothesis]) -> Hypothesis | None:
        """The first that is allowed; of those that take nearly as much, the one with fewest parameters."""
        allowed: list[Hypothesis] = []
        feign: list[str] = []
        for h in tried:
            if h.gain < LEAST_GAIN + self._errors_of_others(h) or self._rest_of_another(h):
                continue
            if h.term in PUSHES and self._turning(h) > MOSTLY and self._lifting(h) < ALONE * self._least(h):
                continue
            if h.term in ANSWERED and self._lifting(h) < self._least(h):
                continue
            why = impossible(h.term, h.fit, self.current.model)
            if not why and (why := feigned(h.term, h.fit, self.current.model, self.moments)):
                feign.append(h.term)
            elif not why and feign and self._beside(h.term, feign) < h.gain * REDUNDANT:
                why = f"better explained by {' and '.join(feign)}, which errors of logging could cause"
            if why:
                self.rejected.setdefault(h.term, why)
            else:
                allowed.append(h)
        self.feigned += [term for term in feign if term not in self.feigned]
        if not allowed:
            return None
        close = [h for h in allowed if allowed[0].gain - h.gain < self._margin(allowed[0])]
        return min(close, key=lambda h: (len(h.fit.free), -h.gain))

    def _rest_of_another(self, h: Hypothesis) -> bool:
        return any(h.term in self.alike[a.term] and h.gain < REST * a.gain for a in self.accepted)

    def _errors_of_others(self, h: Hypothesis) -> float:
        """The part that errors of the accepted effects may explain where ``h`` acts."""
        if not self.accepted:
            return 0.0
        owner = self.moments.owner

        def by_channel(left: np.ndarray) -> np.ndarray:
            return np.array([float(left[owner == c] @ left[owner == c]) for c in range(6)])

        here = by_channel(self.current.left)
        explained = np.maximum(by_channel(self.nothing.left) - here, 0.0)
        gone = np.maximum(here - by_channel(h.fit.left), 0.0)
        here_too = SLOPPY * float(explained @ gone) / max(float(gone.sum()), 1e-9)
        return max(here_too, min(ELSEWHERE * float(explained.sum()), AT_MOST))

    def _least(self, h: Hypothesis) -> float:
        return LEAST_GAIN + PER_PARAMETER * (len(h.fit.free) - len(self.current.free))

    def _lifting(self, h: Hypothesis) -> float:
        """How much of the force a hypothesis explains: gains of torque alone are no thrust curve."""
        gone = self.current.left**2 - h.fit.left**2
        return float(gone[self.moments.owner < 3].sum())

    def _turning(self, h: Hypothesis) -> float:
        """Share of the torques in the part that a hypothesis explains."""
        gone = self.current.left**2 - h.fit.left**2
        turned = float(gone[self.moments.owner >= 3].sum())
        return turned / max(float(gone.sum()), 1e-9)

    def _margin(self, best: Hypothesis) -> float:
        return max(ALIKE_SD2, ALIKE_LEFT * (best.fit.loss - len(best.fit.left)))

    def accept(self, best: Hypothesis, tried: Sequence[Hypothesis]) -> None:
        """``alike``: hypotheses that explain nearly as much of the same residual, so that little remains for them after
        the best."""
        close = [h for h in tried if h.term != best.term and best.gain - h.gain < self._margin(best) and h.gain > 0.0
                 and not _contains(h.term, best.term)]
        self.accepted = [h for h in self.accepted if h.term != best.term]  # one value for all gives way to one each
        self.accepted.append(best)
        self.current = best.fit
        if best.term in MAPS and best.term not in self.space.model and self.other is not None:
            self.space = self.other
            self.known.anchor = best.fit.model
        self.alike[best.term] = tuple(dict.fromkeys(h.term for h in close if h.term not in self.names
                                                    and self._beside(h.term) < REDUNDANT * h.gain))

    def _beside(self, term: str, others: Sequence[str] = ()) -> float:
        """How much a term would still explain after the accepted ones and ``others``, to first order."""
        start = started(self.current.model, term) or self.current.model
        held = free_of(self.space, [*self.names, *(o for o in others if o in self.space.terms)])
        left, near = self.known.left(start), self._near(start)
        beside = np.concatenate([self._differing(start), self.known.directions(near, held)], axis=1)
        if term in self.space.terms:
            free = self.known.directions(near, self.space.free(term))
        elif self.other is not None and term in self.other.terms and not any(n in MAPS for n in self.names):
            there = carried(start, self.other.model)
            swap = left - self.known.left(there)  # the other map acts with its initial coefficients
            free = np.column_stack([swap, self.known.columns(there, self.other.free(term))])
        else:
            return 0.0
        both = np.concatenate([beside, free], axis=1)
        return self._explained(both, left) - self._explained(beside, left)

    def _explained(self, columns: np.ndarray, left: np.ndarray) -> float:
        """Squared length of ``left`` after removing the scatter between flights with its prior."""
        levels = self.known.levels([self.space.model.names[i] for i in self.own_of(self.space)])[1]
        many = levels.shape[1]
        wide = np.concatenate([np.concatenate([columns, np.zeros((many, columns.shape[1]))]),
                               np.concatenate([levels, np.eye(many)])], axis=1) if many else columns
        return _explained(wide, np.concatenate([left, np.zeros(many)]))

    def backward(self) -> None:
        """Remove effects that the others now explain, and replace a curve that is only an offset by that offset."""
        self._levelled()
        while len(self.accepted) > 1:
            losses = []
            for i, h in enumerate(self.accepted):
                names = [n for k, n in enumerate(self.names) if k != i]
                space = self.home if h.term in MAPS else self.space
                own = free_of(space, [g.term for k, g in enumerate(self.accepted) if g.own and k != i])
                without = fit(self.known, rested(self.current.model, [h.term], self.space, self.home),
                              free_of(space, names), own=own)
                losses.append((without.loss - self.current.loss - PER_PARAMETER * len(self.space.free(h.term)), i,
                               without))
            lost, i, without = min(losses, key=lambda entry: entry[0])
            if lost >= LEAST_GAIN:
                return
            if self.accepted[i].term in MAPS:
                self.space = self.home
            del self.accepted[i]
            self.current = without

    def _levelled(self) -> None:
        """Later effects may make a thrust curve redundant, where mass or a thrust scale is enough."""
        curve = next((h for h in self.accepted if h.term in MAPS), None)
        if curve is None or len(self.accepted) < 2 or set(LEVEL) & set(self.names):
            return
        start = rested(self.current.model, [curve.term], self.space, self.home)
        others = [n for n in self.names if n != curve.term]
        own = free_of(self.home, [h.term for h in self.accepted if h.own and h is not curve])
        tried = sorted(((fit(self.known, start, free_of(self.home, [*others, t]), own=own), t) for t in LEVEL
                        if t in self.home.terms), key=lambda entry: entry[0].loss)
        if not tried:
            return
        done, term = tried[0]
        spared = PER_PARAMETER * (len(self.space.free(curve.term)) - len(self.home.free(term)))
        if done.loss - self.current.loss - spared >= LEAST_GAIN or impossible(term, done, start) or \
                feigned(term, done, start, self.moments):
            return
        self.accepted = [Hypothesis(term, done, curve.gain) if h is curve else h for h in self.accepted]
        self.alike[term] = tuple(t for f, t in tried[1:] if f.loss - done.loss < self._margin(self.accepted[0]))
        self.space, self.current = self.home, done


def _contains(wider: str, term: str) -> bool:
    """Whether ``wider`` contains ``term``: a thrust map can be any scale, so an equal explanation is no evidence for
    it."""
    return wider in MAPS and term in LEVEL


def free_of(space: Space, terms: Sequence[str]) -> np.ndarray:
    """Indices of the parameters of some terms."""
    return np.concatenate([space.free(t) for t in terms]).astype(int) if terms else np.zeros(0, int)


def _explained(columns: np.ndarray, left: np.ndarray) -> float:
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 1e-9] / size[size > 1e-9]
    return float(columns @ np.linalg.lstsq(columns, left, rcond=1e-7)[0] @ left) if columns.shape[1] else 0.0


def rested(model: Model, terms: Sequence[str], space: Space, home: Space) -> Model:
    """``model`` of ``space`` with some terms as in ``home``, the simulator's space. If the other thrust map is among
    them, the simulator's map replaces it."""
    if any(t in MAPS and t not in home.terms for t in terms):
        model, space = carried(model, home.model), home
    return model.with_parameters({n: v for n, v in space.model.parameters.items() if n.partition(".")[0] in terms})


def carried(model: Model, other: Model) -> Model:
    """``other`` at the values of ``model`` where both have the parameter."""
    values = model.parameters
    return other.with_parameters({n: values[n] for n in other.names if n in values})


__all__ = ["Hypothesis", "Named", "carried", "free_of", "name_effects", "rested"]
