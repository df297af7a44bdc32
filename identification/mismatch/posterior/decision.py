"""From probabilities to findings: identified effects, indistinguishable alternatives of each, and sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number

from ..space import reduced
from ..wrench import CHANNELS
from .background import FORCES, MOMENTS, turning_size
from .build import Case, rest_of
from .in_motion import only_in_motion
from .set_evidence import FAMILIES
from .sizing import CERTAIN, INSIDE, Refined, nuisance, on_map, parts_of
from .strained import strained
from .weighing import Weighing

NAMED = number("posterior.decision.named")
"""Probability from which an effect is identified: a false effect costs p / (1 - p) times as much as a missed one."""
LEANING = number("posterior.decision.leaning")
ALTERNATIVE = number("posterior.decision.alternative")
"""Loss of log evidence by an exchange, below which two effects are indistinguishable in these flights."""
MATTERS_M_S2 = number("posterior.decision.matters_m_s2")
"""Unmodelled physics below this is as good as flights allow."""
OUTWEIGHS = number("posterior.decision.outweighs")
"""Times the force that no effect explains."""
DECISIVE = number("posterior.decision.decisive")
"""Nats: evidence for an effect alone, from which on it is there although flights differ in its size."""
KINDS = count("posterior.decision.kinds")
"""Kinds of effects that one finding may leave open."""
NINETY_FIVE = 1.96
TWINS: dict[str, tuple[str, ...]] = {"com_offset": ("motor_imbalance",), "mass": ("thrust_scale",),
                                     "thrust_scale": ("mass",)}
"""Terms that differ in gains of torque only, which no flight shows well enough. In roll and pitch, unequal motors act
like an offset of the centre of mass, and free flight shows only thrust per mass."""
LATE = ("motor_lag", "command_delay")
ALWAYS = ("mass", "thrust_scale")
"""Terms that act at any speed alike."""
IN_MOTION = "at rest less than half of it is there"
BEYOND = "its best size lies on a bound of what such a vehicle can have"
INCLUDES = "the 95 % interval includes the simulator's value"
SCATTERS = "its size scatters between flights by as much"
SHOWS = 0.3
"""An effect shows along an axis from this share of its strongest one on."""


@dataclass(frozen=True)
class Size:
    """One parameter: value of the simulator, estimate from the flights, and half width of its 95 % interval."""

    believed: float
    value: float
    half: float
    unit: str

    @property
    def share(self) -> float:
        """Distance from the simulator's value, in half widths of the interval."""
        return abs(self.value - self.believed) / max(self.half, 1e-30)


@dataclass(frozen=True)
class Finding:
    """One identified effect.

    ``equivalent``: terms that are indistinguishable from it in these flights, with the probability of each.
    ``probability``: of the class. ``sizes``: by parameter. ``force_m_s2``, ``torque_rad_s2``: its contribution, m/s^2
    RMS of force and rad/s^2 RMS of turning. ``size_m_s2``: both together, moments as thrust at the motors' arms.
    """

    term: str
    equivalent: Mapping[str, float]
    probability: float
    sizes: Mapping[str, Size]
    force_m_s2: float
    torque_rad_s2: float
    size_m_s2: float
    axes: tuple[str, ...]


@dataclass(frozen=True)
class Decision:
    """Decision on all effects.

    - leaning {term: probability}; rejected {term: reason}; alone {term: log odds over no effect}.
    - found: sizes of the identified effects; corrected: the simulator with these sizes.
    - left_open: effects that are there but may be of more than KINDS kinds, as findings. Their sizes are those in the
      most probable set.
    """

    findings: tuple[Finding, ...]
    leaning: Mapping[str, float]
    rejected: Mapping[str, str]
    found: Refined
    corrected: Model | None
    alone: Mapping[str, float]
    left_open: tuple[Finding, ...] = ()


def decide(case: Case, judge: Callable[[Refined, Refined], float],
           again: Callable[[Model], Iterable[frozenset[str]]] | None = None) -> Decision:
    """Identify the classes of effects whose probability reaches NAMED.

    ``judge`` compares predictions of left-out flights: log likelihood of the first sizes over the second. ``again``
    returns the terms of each finding in a corrected simulator. With ``again``, only the largest of several effects
    is identified at once. The others must be identified again after the largest is corrected, since slopes far from the
    truth suggest effects that do not exist.
    """
    evidence, rejected = case.evidence, dict[str, str]()
    while True:
        weighing = Weighing(case, judge)
        best, posterior, unsure = _certain_of_size(weighing)
        rejected |= unsure
        sizes = weighing.sizes(best)
        beyond = {case.effects[i].term: BEYOND for i in best if _on_bound(case, i, sizes)}
        beyond |= {term: IN_MOTION for i in best if case.effects[i].term in ALWAYS and only_in_motion(case, sizes, i)
                   for term in ALWAYS}
        if not beyond:
            break
        rejected |= beyond
        case.give_up(set(beyond))
    discrepancy = unexplained(case, weighing.sizes(best))
    by_term = _by_term(case, posterior)
    kinds = {i: _with_twins(_class_of(weighing, best, i) | _alike(case, weighing.sizes(best), i, discrepancy)
                            | _of_family(case.effects[i].term, by_term) | _between(weighing, i)) for i in best}
    sure = {i: sum(p for s, p in posterior.items()
                   if {evidence.effects[j].term for j in s} & set(kinds[i])) for i in best}
    sure_ones = tuple(i for i in best if sure[i] >= NAMED)
    left_open = {tuple(sorted(kinds[i])): _finding(case, i, weighing.sizes(best), kinds[i], sure[i], by_term)
                 for i in sure_ones if kinds_of(kinds[i]) > KINDS}
    rejected |= {open_one.term: f"these flights do not show which of {', '.join(terms)} it is"
                 for terms, open_one in left_open.items()}
    found = _standing(weighing, tuple(i for i in sure_ones if tuple(sorted(kinds[i])) not in left_open), rejected)
    if again is not None and len(found.chosen) > 1:
        first = max(found.chosen, key=lambda i: _size_of(case, i, found))
        there = list(again(_written(case, weighing.sizes((first,)))))
        gone = set[int]()
        for i in sorted(set(found.chosen) - {first}, key=lambda i: -_size_of(case, i, found)):
            same = next((terms for terms in there if terms & set(kinds[i])), None)
            if same is None:
                gone.add(i)
            else:
                there.remove(same)  # one finding there confirms one effect here
        rejected |= {case.effects[i].term: f"no longer identified once {case.effects[first].term} is corrected"
                     for i in gone}
        found = _standing(weighing, tuple(i for i in found.chosen if i not in gone), rejected)
    findings = tuple(_finding(case, i, found, kinds[i], sure[i], by_term) for i in found.chosen)
    named = {t for f in findings for t in (f.term, *f.equivalent)}
    leaning = {t: p for t, p in by_term.items() if p >= LEANING and t not in named and t not in rejected}
    rejected |= {t: f"probability {p:.2g}, below {NAMED:g}" for t, p in by_term.items()
                 if t not in named and t not in rejected and t not in leaning}
    alone = {case.effects[i].term: weighing.score((i,)) - weighing.score(())
             for i in sorted(range(len(case.effects)), key=lambda i: weighing.score((i,)))}
    return Decision(findings, leaning, rejected, found, _written(case, found) if findings else None, alone,
                    tuple(left_open.values()))


def _certain_of_size(weighing: Weighing) -> tuple[tuple[int, ...], dict[tuple[int, ...], float], dict[str, str]]:
    """Most probable set whose effects all differ from the simulator, the probabilities, and {term: reason} of others.

    Only predictions favour those others; the residual does not show them. One is left out at a time: two that are
    alike are both uncertain until one has gone.
    """
    case, unsure = weighing.case, dict[str, str]()
    while True:
        posterior = weighing.weigh()
        best = _inside_bounds(weighing, max(posterior, key=lambda s: posterior[s]))
        found = weighing.sizes(best)
        least = min(best, key=lambda i: _certainty(case, i, found), default=None)
        why = None if least is None else _uncertain(case, least, found)
        if least is None or why is None:
            return best, posterior, unsure
        term = case.effects[least].term
        unsure[term] = why
        weighing.without.add(term)


def _certainty(case: Case, which: int, found: Refined) -> float:
    """Distance between the simulator and an effect of a set, relative to the 95 % limit.

    The smallest one counts: that of its best known parameter, that of the region of all its directions,
    ``_over_error``, or ``_over_scatter``.
    """
    alone = max(size.share for size in _sizes(case, which, found).values())
    return float(min(_region(case, which, found, found.covariance), alone, _over_error(case, which, found),
                     _over_scatter(case, which, found)))


def _region(case: Case, which: int, found: Refined, covariance: np.ndarray) -> float:
    """Distance relative to the limit of the 95 % region of all directions of an effect."""
    mine = _mine(case, which, found)
    part = found.step[mine]
    return float(np.sqrt(part @ np.linalg.solve(covariance[mine, mine], part) / chi2.ppf(0.95, len(part))))


def _over_scatter(case: Case, which: int, found: Refined) -> float:
    """As ``_region``, with the scatter between flights. It decides unless the evidence for the effect alone is
    DECISIVE: flights may differ in the size of an effect that is there beyond doubt."""
    if case.evidence.weighed((which,))[0] >= DECISIVE:
        return float("inf")
    return _region(case, which, found, found.spread(case))


def _mine(case: Case, which: int, found: Refined) -> slice:
    """Coefficients of one effect among those of a set."""
    ends = np.concatenate([[0], np.cumsum([case.effects[i].width for i in found.chosen])])
    return slice(*ends[found.chosen.index(which):][:2].astype(int))


def _over_error(case: Case, which: int, found: Refined) -> float:
    """Size of an effect far from linear, relative to that by which its term may be off without being a finding. Its
    evidence is that of slopes where it ends, and such an error is taken where it begins."""
    if not case.effects[which].far:
        return float("inf")
    spike = case.evidence.spike[case.evidence.columns((which,))]
    readings = sum(e.term == case.effects[which].term for e in case.effects)
    return _size_of(case, which, found) / max(float(np.sqrt(readings)) * float(np.linalg.norm(spike)), 1e-12)


def _uncertain(case: Case, which: int, found: Refined) -> str | None:
    """Why an effect of a set is not certain; None if it is."""
    if _certainty(case, which, found) > 1.0:
        return None
    if _over_error(case, which, found) <= 1.0:
        return f"{_size_of(case, which, found):.2g} m/s^2, by which any term may be off"
    sizes = _sizes(case, which, found)
    sure = max(size.share for size in sizes.values()) > 1.0 and _region(case, which, found, found.covariance) > 1.0
    return f"{SCATTERS if sure else INCLUDES}: {_shortest(sizes)}"


def _standing(weighing: Weighing, chosen: tuple[int, ...], rejected: dict[str, str]) -> Refined:
    """Sizes of the accepted effects of a set. An accepted effect changes the simulator, lies inside its bounds and is
    large compared with the unexplained force. The others are added to ``rejected`` {term: reason}."""
    case, found = weighing.case, weighing.sizes(chosen)
    while found.chosen:
        said = {i: why for i in found.chosen if (why := _uncertain(case, i, found)) is not None}
        said |= {i: BEYOND for i in found.chosen if i not in said and _on_bound(case, i, found)}
        said = said or _overshadowed(case, found)
        if not said:
            break
        rejected |= {case.effects[i].term: why for i, why in said.items()}
        found = weighing.sizes(tuple(i for i in found.chosen if i not in said))
    return found


def unexplained(case: Case, found: Refined) -> dict[str, float]:
    """m/s^2 RMS by group of the discrepancy: the part that no effect explains, given a set at its sizes."""
    return case.evidence.sizes_of(nuisance(case, found)[case.evidence.P:])


def force_of(discrepancy: Mapping[str, float]) -> float:
    """m/s^2 RMS of the force in ``unexplained``."""
    return float(np.sqrt(sum(discrepancy.get(group, 0.0) ** 2 for group in FORCES)))


def moment_of(discrepancy: Mapping[str, float]) -> float:
    """m/s^2 RMS at the arm of the moment in ``unexplained``."""
    return float(np.sqrt(sum(discrepancy.get(group, 0.0) ** 2 for group in MOMENTS)))


def _overshadowed(case: Case, found: Refined) -> dict[int, str]:
    """{number: reason} of the smallest effect, if it is masked: less than OUTWEIGHS times the unexplained force.

    Such a force could imitate the effect, if it acts along the same axes. That of the background has no mean, so it
    cannot imitate the constant part of an effect. ``strained`` forces can, and so can a force of the place, whose mean
    may be as large as its changes. Empty if the unexplained force is too small to matter. Effects that act more as a
    moment are compared with the moment of ``strained`` errors.
    """
    coefficients, groups = nuisance(case, found)[case.evidence.P:], case.background.group
    along, placed = (((case.background.force[..., mine] @ coefficients[mine]) ** 2).mean(0)
                     for mine in (np.isin(groups, FORCES), groups == "place"))
    pushed, turned = strained(case, found)
    constant, imitated = (pushed**2).mean(0), float(turning_size(turned, case.arm))
    strain = float(np.hypot(np.sqrt(constant.sum()), imitated))
    masked = dict[int, tuple[float, float]]()
    for i, part in parts_of(case, found.chosen, found.step):
        acts = case.effects[i].force @ part
        force = (acts**2).mean(0)
        varies = (force - acts.mean(0) ** 2).sum() / max(force.sum(), 1e-12)
        push, turn = float(np.sqrt(force.sum())), float(turning_size(case.effects[i].torque @ part, case.arm))
        like = varies * along + (1.0 - varies) * placed + constant
        left = float(np.sqrt(len(force) * force @ like / max(force.sum(), 1e-12)))
        if left >= MATTERS_M_S2 and turn < push < OUTWEIGHS * left:
            masked[i] = push, left
        elif strain >= MATTERS_M_S2 and push <= turn < OUTWEIGHS * imitated:
            masked[i] = turn, imitated
    if not masked:
        return {}
    least = min(masked, key=lambda i: masked[i])
    push, left = masked[least]
    return {least: f"{push:.2g} m/s^2 next to {left:.2g} m/s^2 along the same axes that no effect explains"}


def _size_of(case: Case, which: int, found: Refined) -> float:
    """m/s^2 RMS, force and moment together."""
    part = dict(parts_of(case, found.chosen, found.step))[which]
    return float(np.linalg.norm(part * case.evidence.unit[case.evidence.columns((which,))]))


def _on_bound(case: Case, which: int, found: Refined) -> bool:
    """Whether the flights require a size outside a bound, other than that where the term has no effect."""
    effect, (part, beyond) = case.effects[which], (
        dict(parts_of(case, found.chosen, values))[which] for values in (found.step, found.beyond))
    at = (((part <= INSIDE * effect.lower) & (effect.lower < 0.0))
          | ((part >= INSIDE * effect.upper) & (effect.upper > 0.0))) & (beyond >= CERTAIN)
    slots = {slot.name: slot for slot in case.space.model.slots}
    before, after = case.space.model.parameters, found.model.parameters
    for name, way in effect.moves.items():
        rest = rest_of(slots[name], case.space.model)
        if abs(after[name] - rest) < 2.0 * (1.0 - INSIDE) * abs(before[name] - rest):
            at &= way == 0.0
    return bool(at.any())


def _shortest(sizes: Mapping[str, Size]) -> str:
    name, size = next(iter(sizes.items()))
    return f"{name} {size.value:.3g} +- {size.half:.2g} {size.unit}"


def _by_term(case: Case, posterior: Mapping[tuple[int, ...], float]) -> dict[str, float]:
    found = dict.fromkeys((e.term for e in case.effects), 0.0)
    for chosen, p in posterior.items():
        for term in {case.effects[i].term for i in chosen}:
            found[term] += p
    return found


def _exchanges(weighing: Weighing, chosen: tuple[int, ...], which: int) -> Iterator[tuple[int, tuple[int, ...], float]]:
    """(other effect, set with it in place of ``which``, log odds lost) for all effects that flights cannot
    distinguish."""
    evidence = weighing.case.evidence
    for other, effect in enumerate(evidence.effects):
        exchanged = tuple(sorted({*chosen, other} - {which}))
        if (effect.term != evidence.effects[which].term and len(exchanged) == len(chosen)
                and evidence.allowed(exchanged)):
            lost = weighing.score(chosen) - weighing.score(exchanged)
            if lost < ALTERNATIVE:
                yield other, exchanged, lost


def _class_of(weighing: Weighing, chosen: tuple[int, ...], which: int) -> dict[str, float]:
    """{term: log odds lost by the exchange}: terms that could replace one of a set."""
    effects = weighing.case.effects
    found = {effects[which].term: 0.0}
    for other, _, lost in _exchanges(weighing, chosen, which):
        term = effects[other].term
        found[term] = min(lost, found.get(term, np.inf))
    return found


def _with_twins(kind: Mapping[str, float]) -> dict[str, float]:
    """With the twins of every member of a class."""
    found = dict(kind)
    for term, lost in kind.items():
        for twin in TWINS.get(term, ()):
            found[twin] = min(lost, found.get(twin, np.inf))
    return found


def _of_family(term: str, by_term: Mapping[str, float]) -> dict[str, float]:
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


def _between(weighing: Weighing, which: int) -> dict[str, float]:
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


def _alike(case: Case, found: Refined, which: int, discrepancy: Mapping[str, float]) -> dict[str, float]:
    """{term: 0}: terms that could replace one effect of a set, up to a difference below the unexplained physics.

    The size of such a term lies inside its bounds. However probable the effect is, its shape is not known better than
    that difference. Empty if the effect itself is below the unexplained physics.
    """
    evidence = case.evidence
    mine = evidence.columns((which,))
    does = dict(parts_of(case, found.chosen, found.step))[which] * evidence.unit[mine]
    parts = evidence.work[:3].sum(0), evidence.work[3:].sum(0)
    limits = force_of(discrepancy), moment_of(discrepancy)
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


def _inside_bounds(weighing: Weighing, best: tuple[int, ...]) -> tuple[int, ...]:
    """The set with another member of the class in the place of an effect that would have to lie on its bound."""
    case = weighing.case
    for i in best:
        if _on_bound(case, i, weighing.sizes(best)):
            for other, exchanged, _ in sorted(_exchanges(weighing, best, i), key=lambda e: e[2]):
                if case.effects[other].term not in weighing.without and not _on_bound(case, other,
                                                                                      weighing.sizes(exchanged)):
                    return exchanged
    return best


def _sizes(case: Case, which: int, found: Refined) -> dict[str, Size]:
    mine = _mine(case, which, found)
    effect, part, covariance = case.effects[which], found.step[mine], found.covariance[mine, mine]
    if effect.map_share:
        return {f"{effect.term}.share": Size(0.0, float(part[0]), NINETY_FIVE * float(np.sqrt(covariance[0, 0])), "1")}
    units = dict(zip(found.model.names, found.model.units, strict=True))
    around, believed = case.space.model.parameters, case.simulator.parameters
    return {name: Size(believed.get(name, around[name]), around[name] + float(way @ part),
                       NINETY_FIVE * float(np.sqrt(way @ covariance @ way)), units[name])
            for name, way in effect.moves.items()}


def _finding(case: Case, which: int, found: Refined, kind: Mapping[str, float], probability: float,
             by_term: Mapping[str, float]) -> Finding:
    effect = case.effects[which]
    part = dict(parts_of(case, found.chosen, found.step))[which]
    force, torque = effect.force @ part, effect.torque @ part
    by_axis = np.concatenate([np.sqrt((force**2).mean(0)),
                              np.sqrt((torque**2).mean(0)) * case.arm if len(torque) else np.zeros(3)])
    axes = tuple(n for n, size in zip(CHANNELS, by_axis, strict=True) if size > SHOWS * by_axis.max())
    others = {t: by_term[t] for t in kind if t != effect.term and t in by_term}
    return Finding(effect.term, others, probability, _sizes(case, which, found),
                   float(np.sqrt((force**2).sum(1).mean())),
                   float(np.sqrt((torque**2).sum(1).mean())) if len(torque) else 0.0,
                   _size_of(case, which, found), axes)


def _written(case: Case, found: Refined) -> Model:
    """The corrected simulator: its own terms and the identified ones; the other map if that is identified."""
    named = tuple(case.effects[i].term for i in found.chosen)
    return reduced(on_map(case, found.chosen, found.model), case.space.believed, named)


