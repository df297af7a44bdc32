"""From probabilities to findings: identified effects, indistinguishable alternatives of each, and sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number

from ..space import reduced
from ..wrench import CHANNELS
from .build import Case
from .certainty import Size, certainty, on_bound, overshadowed, size_of, sizes_of, uncertain, unnamed
from .in_motion import only_in_motion
from .indistinguishable import alike, between, class_of, inside_bounds, kinds_of, of_family, with_twins
from .sizing import Refined, on_map, parts_of
from .weighing import Weighing

NAMED = number("posterior.decision.named")
"""Probability from which an effect is identified: a false effect costs p / (1 - p) times as much as a missed one."""
LEANING = number("posterior.decision.leaning")
KINDS = count("posterior.decision.kinds")
"""Kinds of effects that one finding may leave open."""
SPOILT = number("posterior.decision.spoilt")
"""Times the error of predictions without an effect, above which it is none."""
MENDED = number("posterior.decision.mended")
"""The same, above which an effect is none where the evidence already favoured another that spoilt predictions."""
ALWAYS = ("mass", "thrust_scale")
"""Terms that act at any speed alike."""
IN_MOTION = "at rest less than half of it is there"
SPOILS = "with it, flights that were left out are predicted much worse"
NOT_MENDED = "with it, flights that were left out are predicted no better, where another effect spoils predictions"
BEYOND = "its best size lies on a bound of what such a vehicle can have"
SHOWS = 0.3
"""An effect shows along an axis from this share of its strongest one on."""


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
    - hidden {term: reason}: those of ``rejected`` that a force without an effect may imitate.
    """

    findings: tuple[Finding, ...]
    leaning: Mapping[str, float]
    rejected: Mapping[str, str]
    found: Refined
    corrected: Model | None
    alone: Mapping[str, float]
    left_open: tuple[Finding, ...] = ()
    hidden: Mapping[str, str] = field(default_factory=dict)


def decide(case: Case, judge: Callable[[Refined, Refined], float],
           worse: Callable[[Refined, Refined], Sequence[float]] = lambda found, without: (0.0,),
           again: Callable[[Model], Iterable[frozenset[str]]] | None = None) -> Decision:
    """Identify the classes of effects whose probability reaches NAMED.

    ``judge`` compares predictions of left-out flights: log likelihood of the first sizes over the second. ``worse``
    returns mean logs of the ratios of their errors. ``again`` returns the terms of each finding in a corrected
    simulator. With ``again``, only the largest of several effects is identified at once. The others must be identified
    again after the largest is corrected, since slopes far from the truth suggest effects that do not exist.
    """
    evidence, rejected, hidden = case.evidence, dict[str, str](), dict[str, str]()
    while True:
        weighing = Weighing(case, judge)
        best, posterior, unsure = _certain_of_size(weighing, worse)
        rejected |= unsure
        sizes = weighing.sizes(best)
        beyond = {case.effects[i].term: BEYOND for i in best if on_bound(case, i, sizes)}
        beyond |= {term: IN_MOTION for i in best if case.effects[i].term in ALWAYS and only_in_motion(case, sizes, i)
                   for term in ALWAYS}
        if not beyond:
            break
        rejected |= beyond
        case.give_up(set(beyond))
    limits = unnamed(case, weighing.sizes(best))
    by_term = _by_term(case, posterior)
    kinds = {i: with_twins(class_of(weighing, best, i) | alike(case, weighing.sizes(best), i, limits)
                            | of_family(case.effects[i].term, by_term) | between(weighing, i)) for i in best}
    sure = {i: sum(p for s, p in posterior.items()
                   if {evidence.effects[j].term for j in s} & set(kinds[i])) for i in best}
    sure_ones = tuple(i for i in best if sure[i] >= NAMED)
    left_open = {tuple(sorted(kinds[i])): _finding(weighing, i, weighing.sizes(best), kinds[i], sure[i], by_term)
                 for i in sure_ones if kinds_of(kinds[i]) > KINDS}
    rejected |= {open_one.term: f"these flights do not show which of {', '.join(terms)} it is"
                 for terms, open_one in left_open.items()}
    found = _standing(weighing, tuple(i for i in sure_ones if tuple(sorted(kinds[i])) not in left_open), rejected,
                      hidden)
    if again is not None and len(found.chosen) > 1:
        first = max(found.chosen, key=lambda i: size_of(case, i, found))
        there = list(again(_written(case, weighing.sizes((first,)))))
        gone = set[int]()
        for i in sorted(set(found.chosen) - {first}, key=lambda i: -size_of(case, i, found)):
            same = next((terms for terms in there if terms & set(kinds[i])), None)
            if same is None:
                gone.add(i)
            else:
                there.remove(same)  # one finding there confirms one effect here
        rejected |= {case.effects[i].term: f"no longer identified once {case.effects[first].term} is corrected"
                     for i in gone}
        found = _standing(weighing, tuple(i for i in found.chosen if i not in gone), rejected, hidden)
    findings = tuple(_finding(weighing, i, found, kinds[i], sure[i], by_term) for i in found.chosen)
    named = {t for f in findings for t in (f.term, *f.equivalent)}
    leaning = {t: p for t, p in by_term.items() if p >= LEANING and t not in named and t not in rejected}
    rejected |= {t: f"probability {p:.2g}, below {NAMED:g}" for t, p in by_term.items()
                 if t not in named and t not in rejected and t not in leaning}
    alone = {case.effects[i].term: weighing.score((i,)) - weighing.score(())
             for i in sorted(range(len(case.effects)), key=lambda i: weighing.score((i,)))}
    return Decision(findings, leaning, rejected, found, _written(case, found) if findings else None, alone,
                    tuple(left_open.values()), hidden)


def _certain_of_size(weighing: Weighing, worse: Callable[[Refined, Refined], Sequence[float]]
                     ) -> tuple[tuple[int, ...], dict[tuple[int, ...], float], dict[str, str]]:
    """Most probable set whose effects all differ from the simulator and spoil no prediction, the probabilities, and
    {term: reason} of others.

    Only predictions favour those others, and the residual does not show them, or the reverse. One is left out at a
    time: two that are alike are both uncertain until one has gone. If one spoilt predictions, the evidence of the
    residual is misleading, and what is left has to improve them.
    """
    case, unsure, misled = weighing.case, dict[str, str](), False
    while True:
        posterior = weighing.weigh()
        best = inside_bounds(weighing, max(posterior, key=lambda s: posterior[s]))
        found = weighing.sizes(best)
        told = {i: partial(weighing.gained, best, i) for i in best}
        least = min(best, key=lambda i: certainty(case, i, found, told[i]), default=None)
        why = None if least is None else uncertain(case, least, found, told[least])
        if why is None:
            least, why = _spoiling(weighing, best, worse, misled), NOT_MENDED if misled else SPOILS
            misled = True
        if least is None:
            return best, posterior, unsure
        term = case.effects[least].term
        unsure[term] = why
        weighing.without.add(term)


def _standing(weighing: Weighing, chosen: tuple[int, ...], rejected: dict[str, str],
              hidden: dict[str, str]) -> Refined:
    """Sizes of the accepted effects of a set. An accepted effect changes the simulator, lies inside its bounds and is
    large compared with the unexplained force. The others are added to ``rejected`` {term: reason}. Those that are too
    small next to the unexplained force are added to ``hidden`` as well."""
    case, found = weighing.case, weighing.sizes(chosen)
    while found.chosen:
        said = {i: why for i in found.chosen
                if (why := uncertain(case, i, found, partial(weighing.gained, found.chosen, i))) is not None}
        said |= {i: BEYOND for i in found.chosen if i not in said and on_bound(case, i, found)}
        if not said:
            said = overshadowed(case, found)
            hidden |= {case.effects[i].term: why for i, why in said.items()}
        if not said:
            break
        rejected |= {case.effects[i].term: why for i, why in said.items()}
        found = weighing.sizes(tuple(i for i in found.chosen if i not in said))
    return found


def _spoiling(weighing: Weighing, chosen: tuple[int, ...], worse: Callable[[Refined, Refined], Sequence[float]],
              misled: bool) -> int | None:
    """The effect of a set that spoils predictions most, or None.

    That is the effect without which predictions are best. With ``misled``, an effect that does not improve them is
    enough."""
    found = weighing.sizes(chosen)
    errors = {i: worse(found, weighing.sizes(tuple(j for j in chosen if j != i))) for i in chosen}
    most = max(chosen, key=lambda i: max(errors[i]), default=None)
    limits = np.log(SPOILT), np.log(MENDED)
    if most is not None and max(errors[most]) > limits[0]:
        return most
    return next((i for i in chosen if min(errors[i]) > limits[1]), None) if misled else None


def _by_term(case: Case, posterior: Mapping[tuple[int, ...], float]) -> dict[str, float]:
    found = dict.fromkeys((e.term for e in case.effects), 0.0)
    for chosen, p in posterior.items():
        for term in {case.effects[i].term for i in chosen}:
            found[term] += p
    return found


def _finding(weighing: Weighing, which: int, found: Refined, kind: Mapping[str, float], probability: float,
             by_term: Mapping[str, float]) -> Finding:
    case = weighing.case
    effect = case.effects[which]
    part = dict(parts_of(case, found.chosen, found.step))[which]
    force, torque = effect.force @ part, effect.torque @ part
    by_axis = np.concatenate([np.sqrt((force**2).mean(0)),
                              np.sqrt((torque**2).mean(0)) * case.arm if len(torque) else np.zeros(3)])
    axes = tuple(n for n, size in zip(CHANNELS, by_axis, strict=True) if size > SHOWS * by_axis.max())
    others = {t: by_term[t] for t in kind if t != effect.term and t in by_term}
    sizes = sizes_of(case, which, found, partial(weighing.gained, found.chosen, which))
    return Finding(effect.term, others, probability, sizes,
                   float(np.sqrt((force**2).sum(1).mean())),
                   float(np.sqrt((torque**2).sum(1).mean())) if len(torque) else 0.0,
                   size_of(case, which, found), axes)


def _written(case: Case, found: Refined) -> Model:
    """The corrected simulator: its own terms and the identified ones; the other map if that is identified."""
    named = tuple(case.effects[i].term for i in found.chosen)
    return reduced(on_map(case, found.chosen, found.model), case.space.believed, named)
