"""Terms that these flights cannot distinguish from an identified effect, and the number of their kinds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from nanobench_tools.settings import number

from .build import Case
from .certainty import on_bound
from .set_evidence import FAMILIES, OFFSETS
from .sizing import Refined, parts_of
from .weighing import Weighing

ALTERNATIVE = number("posterior.indistinguishable.alternative")
"""Loss of log evidence by an exchange, below which two effects are indistinguishable in these flights."""
TWINS: dict[str, tuple[str, ...]] = {"com_offset": ("motor_imbalance",), "mass": ("thrust_scale",),
                                     "thrust_scale": ("mass",)}
"""Terms that differ in gains of torque only, which no flight shows well enough. In roll and pitch, unequal motors act
like an offset of the centre of mass, and free flight shows only thrust per mass."""
LATE = ("motor_lag", "command_delay")


def exchanges(weighing: Weighing, chosen: tuple[int, ...], which: int) -> Iterator[tuple[int, tuple[int, ...], float]]:
    """(other effect, set with it in place of ``which``, log odds lost) for all effects that flights cannot
    distinguish."""
    evidence = weighing.case.evidence
    for other, effect in enumerate(evidence.effects):
        exchanged = tuple(sorted({*chosen, other} - {which}))
        if (effect.term != evidence.effects[which].term and len(exchanged) == len(chosen)
                and evidence.allowed(exchanged)):
            both = {effect.term, evidence.effects[which].term} <= {*OFFSETS}
            rate = weighing.evidence if both else weighing.score  # flights of a session share offsets of any size
            lost = rate(chosen) - rate(exchanged)
            if lost < ALTERNATIVE:
                yield other, exchanged, lost


def class_of(weighing: Weighing, chosen: tuple[int, ...], which: int) -> dict[str, float]:
    """{term: log odds lost by the exchange}: terms that could replace one of a set."""
    effects = weighing.case.effects
    found = {effects[which].term: 0.0}
    for other, _, lost in exchanges(weighing, chosen, which):
        term = effects[other].term
        found[term] = min(lost, found.get(term, np.inf))
    return found


def with_twins(kind: Mapping[str, float]) -> dict[str, float]:
    """With the twins of every member of a class."""
    found = dict(kind)
    for term, lost in kind.items():
        for twin in TWINS.get(term, ()):
            found[twin] = min(lost, found.get(twin, np.inf))
    return found


def of_family(term: str, by_term: Mapping[str, float]) -> dict[str, float]:
    """{term: log odds lost}: other terms of its family, of which a set has one only, that are nearly as probable."""
    lost = {other: float(np.log(max(by_term[term], 1e-12) / max(by_term.get(other, 0.0), 1e-12)))
            for family in FAMILIES if term in family for other in family - {term}}
    return {other: max(nats, 0.0) for other, nats in lost.items() if nats < ALTERNATIVE}


def kinds_of(terms: Iterable[str]) -> int:
    """Number of kinds of effects among terms: those of one family, and twins, are one kind."""
    alike = [*FAMILIES, *({term, *twins} for term, twins in TWINS.items())]
    parts = list[set[str]]()
    for term in terms:
        near = {term}.union(*(group for group in alike if term in group))
        parts = [*(p for p in parts if not p & near), near.union(*(p for p in parts if p & near))]
    return len(parts)


def between(weighing: Weighing, which: int) -> dict[str, float]:
    """{term: 0}: the other of two LATE terms, if both together explain more than either.

    Thrust then comes late in a way that is neither a pure lag nor a pure delay. Their evidence compares two shapes
    that are both wrong, and does not show which of them is missing.
    """
    case, term = weighing.case, weighing.case.effects[which].term
    if term not in LATE:
        return {}
    readings = [[i for i, e in enumerate(case.effects) if e.term == t] for t in LATE]
    if not all(readings):
        return {}
    one, other = (max(of, key=lambda i: weighing.sizes((i,)).log) for of in readings)
    apart = max(weighing.sizes((i,)).log + case.evidence.log_prior((i,)) for i in (one, other))
    pair = tuple(sorted((one, other)))
    gained = weighing.sizes(pair).log + case.evidence.log_prior(pair) - apart
    return dict.fromkeys(set(LATE) - {term}, 0.0) if gained > ALTERNATIVE else {}


def alike(case: Case, found: Refined, which: int, limits: tuple[float, float]) -> dict[str, float]:
    """{term: 0}: terms that could replace one effect of a set, up to a difference below the unexplained physics.

    ``limits``: that of force and moment (``unnamed``). The size of such a term lies inside its bounds. However probable
    the effect is, its shape is not known better than that difference. Empty if the effect itself is below the
    unexplained physics.
    """
    evidence = case.evidence
    mine = evidence.columns((which,))
    does = dict(parts_of(case, found.chosen, found.step))[which] * evidence.unit[mine]
    parts = evidence.work[:3].sum(0), evidence.work[3:].sum(0)
    alike = dict[str, float]()
    if all(float(does @ part[np.ix_(mine, mine)] @ does) <= most**2 for part, most in zip(parts, limits, strict=True)):
        return alike
    for other, effect in enumerate(case.effects):
        theirs = evidence.columns((other,))
        whole = (parts[0] + parts[1])[np.ix_(theirs, theirs)]
        size = np.linalg.lstsq(whole, (parts[0] + parts[1])[np.ix_(theirs, mine)] @ does, rcond=None)[0]
        both = np.concatenate([does, -np.clip(size, evidence.lower[theirs], evidence.upper[theirs])])
        index = np.ix_(np.concatenate([mine, theirs]), np.concatenate([mine, theirs]))
        differs = [float(np.sqrt(max(both @ part[index] @ both, 0.0))) for part in parts]
        if effect.term != case.effects[which].term and all(d <= most for d, most in zip(differs, limits, strict=True)):
            alike[effect.term] = 0.0
    return alike


def inside_bounds(weighing: Weighing, best: tuple[int, ...]) -> tuple[int, ...]:
    """The set with another member of the class in the place of an effect that would have to lie on its bound."""
    case = weighing.case
    for i in best:
        if on_bound(case, i, weighing.sizes(best)):
            for other, exchanged, _ in sorted(exchanges(weighing, best, i), key=lambda e: e[2]):
                if case.effects[other].term not in weighing.without and not on_bound(case, other,
                                                                                      weighing.sizes(exchanged)):
                    return exchanged
    return best
