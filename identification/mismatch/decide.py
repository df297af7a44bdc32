"""From fitted hypotheses to a decision: effects identified, unknown, a fault of the data, or no mismatch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nanobench_tools.flight import Fault
from nanobench_tools.physics import Model
from nanobench_tools.settings import number

from .fitting import Fit, Slopes, bootstrap, fit, force_left
from .leftover import Structure, gusts, structures
from .moments import Moments
from .naming import ALIKE_LEFT, LEAST_GAIN, PER_PARAMETER, Hypothesis, Named, carried, free_of, rested
from .recordings import Recordings
from .space import IN_PRODUCTS, LEVEL, MAPS, Space
from .standing import (
    LEAST_FORCE_M_S2,
    LEAST_LEFT,
    excess,
    hollow,
    in_vain,
    left_without,
    overshadowed,
    passing,
    rested_in,
)
from .tolerance import feigned, impossible
from .wrench import CHANNELS

LEAST_ALONE = number("mismatch.decide.least_alone")
LEAST_TURNING = number("mismatch.decide.least_turning")
WIDER = number("mismatch.decide.wider")
SYSTEMATIC = number("mismatch.decide.systematic")
HEIGHT = 'com_offset.r_m[2]'
HEIGHT_SD_M = number("mismatch.decide.height_sd_m")
INERTIA = 'inertia.inertia_kg_m2'
INERTIA_SD = number("mismatch.decide.inertia_sd")
TOGETHER = (*MAPS, *IN_PRODUCTS)
NORMAL95 = 1.96
MOST_SURE = number("mismatch.decide.most_sure")
UNSURE = number("mismatch.decide.unsure")
UNPROVED = "it does not predict flights better that were left out of the fit"
BESIDE = number("mismatch.decide.beside")
ACTS_SHARE = number("mismatch.decide.acts_share")
DOUBT = number("mismatch.decide.doubt")


@dataclass(frozen=True)
class Finding:
    """One identified effect.

    ``equivalent``: indistinguishable effects. ``sd``: standard deviations of its parameters by name. ``share``: the
    fraction of the residual's structure that it explains. ``axes``: channels where it acts.
    """

    hypothesis: Hypothesis
    equivalent: tuple[str, ...]
    sd: dict[str, float]
    share: float
    axes: tuple[str, ...]
    covariate: str
    confidence: float


@dataclass(frozen=True)
class Decision:
    """Decision on all effects.

    ``outcome``: as in DESIGN. ``own``: terms that differ between flights. ``scores``: initial gain of each hypothesis.
    ``findings``: identified effects. ``unknown``: structures that no term explains. ``fit``: of the identified effects,
    and its space. ``faults``: data faults that forbid an answer (``Recordings.forbidding``). ``before``, ``after``
    (6,): squared length above the plain level.
    """

    outcome: str
    findings: tuple[Finding, ...]
    withdrawn: tuple[tuple[str, str], ...]
    unknown: tuple[Structure, ...]
    fit: Fit
    space: Space
    own: tuple[str, ...]
    faults: tuple[tuple[str, Fault], ...]
    before: np.ndarray
    after: np.ndarray
    rejected: dict[str, str]
    scores: dict[str, float] = field(default_factory=dict)


def decide(recordings: Recordings, moments: Moments, space: Space, named: Named) -> Decision:
    """Accept effects that explain nearly all of the residual where they act; the rest is unknown."""
    known = Slopes(moments)
    nothing = fit(known, space.model, [])
    before = excess(moments, nothing.left)
    faults = recordings.forbidding
    final = named.fit
    # an artefact of the logging is no finding, and no unknown either
    faint = [t for t in named.feigned if t in named.space.terms and t not in {h.term for h in named.accepted}]
    free = free_of(named.space, [*(h.term for h in named.accepted), *faint])
    lenient = fit(known, final.model, free, own=named.own()) if faint else final
    lenient = min(lenient, final, key=lambda f: f.loss)  # a search for more may end in another valley
    after = excess(moments, lenient.left)
    found = structures(moments, force_left(known, lenient))
    rough = _roughness(moments, lenient.left, after)
    if rough is not None and not found:
        found = [rough]
    bursts = next((s for s in found if s.rows is not None), None)
    kept: list[Hypothesis] = []
    withdrawn: list[tuple[str, str]] = []
    alike = dict(zip((h.term for h in named.accepted), named.alike, strict=True))
    for h in named.accepted:
        why = hollow(moments, known, named, h, after, space, found) or passing(moments, named, h, space, bursts)
        if why:
            withdrawn.append((h.term, why))
        else:
            kept.append(h)
    unsure = bool(withdrawn) or any(h.own for h in kept)
    here = named.space
    if any(t in MAPS for t, _ in withdrawn) and not set(LEVEL) & {h.term for h in kept}:
        instead = _level_instead(moments, known, space, kept, named.fit.model, found)
        if instead is not None:
            named, kept = instead, list(instead.accepted)
            alike[kept[-1].term] = named.alike[-1]
            final = named.fit
    if withdrawn:  # the rest has to explain the residual alone, on the simulator's own map if the other was rejected
        gone = [t for t, _ in withdrawn]
        here = space if any(t in MAPS for t in gone) else here
        start = carried(rested_in(named, gone, space), here.model)
        kept, final, more = _still(known, here, space, kept, _refit(known, here, kept, start))
        here = space if any(t in MAPS for t, _ in more) else here
        withdrawn += more
        for weak in (overshadowed, in_vain):
            more = weak(moments, known, replace(named, accepted=tuple(kept), space=here, fit=final), space)
            if more:
                withdrawn += more
                here, kept, final = _drop(known, here, space, kept, final, [t for t, _ in more])
    findings = [_finding(moments, known, named, h, alike[h.term], final, nothing.loss, space) for h in kept]
    idle = [f.hypothesis.term for f in findings if not _moved(f, final.model, space)]
    small = {f.hypothesis.term: why for f in findings if f.hypothesis.term not in (*TOGETHER, *idle)
             if (why := feigned(f.hypothesis.term, final, space.model, moments))}
    if idle or small:  # both may result from the rejected effects
        withdrawn += [(term, "its interval includes the simulator's value") for term in idle] + list(small.items())
        idle += list(small)
        here, kept, final = _drop(known, here, space, kept, final, idle)
        findings = [_finding(moments, known, named, h, alike[h.term], final, nothing.loss, space) for h in kept]
    if not kept:
        here, final = space, nothing
    findings = [replace(f, confidence=UNSURE) if unsure or idle or _strange_beside(f, found) else f for f in findings]
    if withdrawn and not found:
        biggest = int(np.argmax(after))
        found = [Structure("motion", _force_rms(moments, lenient.left, biggest), float(after[biggest]),
                           (CHANNELS[biggest],), "structure that no single term explains")]
    if not found and (air := gusts(moments, force_left(known, final if kept else lenient))) is not None:
        found = [air]
    if findings:
        found = [s for s in found if s.kind != "motion" or s.gain > BESIDE * float(before.sum())]
    outcome = "named" if findings else _unnamed(faults, found)
    return Decision(outcome, tuple(findings), tuple(withdrawn), tuple(found), final, here,
                    tuple(h.term for h in kept if h.own), faults, before, after, named.rejected, named.scores)


def _unnamed(faults: Sequence[tuple[str, Fault]], found: Sequence[Structure]) -> str:
    """Outcome without an identified effect: apparent physics in faulty rows is attributed to the data."""
    return "data_fault" if faults else "unknown" if found else "none"


def unproved(moments: Moments, decision: Decision, space: Space) -> Decision:
    """The decision without identified effects that do not improve the prediction of unseen flights."""
    withdrawn = (*decision.withdrawn, *((f.hypothesis.term, UNPROVED) for f in decision.findings))
    found = decision.unknown
    worst = int(np.argmax(decision.before))
    if not found and decision.before[worst] > LEAST_LEFT:
        like = " and ".join(f.hypothesis.term for f in decision.findings)
        found = (Structure("motion", 0.0, float(decision.before[worst]), (CHANNELS[worst],),
                           f"{CHANNELS[worst]} differs, most like {like}, which predicts unseen flights no better"),)
    outcome = _unnamed(decision.faults, found)
    return Decision(outcome, (), withdrawn, found, fit(Slopes(moments), space.model, []), space, (), decision.faults,
                    decision.before, decision.before, decision.rejected, decision.scores)


def without(moments: Moments, decision: Decision, terms: Sequence[str], why: str) -> Decision:
    """The decision without some of its effects; the others are fitted again."""
    kept = tuple(replace(f, confidence=UNSURE) for f in decision.findings if f.hypothesis.term not in terms)
    rest = {n: v for n, v in decision.space.model.parameters.items() if n.partition(".")[0] in terms}
    own = tuple(t for t in decision.own if t not in terms)
    final = fit(Slopes(moments), decision.fit.model.with_parameters(rest),
                free_of(decision.space, [f.hypothesis.term for f in kept]), own=free_of(decision.space, own))
    found = replace(decision, findings=kept, withdrawn=(*decision.withdrawn, *((t, why) for t in terms)), fit=final,
                    own=own)
    for term in (f.hypothesis.term for f in kept if f.hypothesis.term not in TOGETHER):
        small = feigned(term, final, decision.space.model, moments)
        if small:  # it resulted from the removed effects
            return without(moments, found, [term], small)
    return found


def _refit(known: Slopes, here: Space, kept: Sequence[Hypothesis], start: Model) -> Fit:
    own = free_of(here, [h.term for h in kept if h.own])
    return fit(known, start, free_of(here, [h.term for h in kept]), own=own)


def _drop(known: Slopes, here: Space, home: Space, kept: Sequence[Hypothesis], final: Fit,
          terms: Sequence[str]) -> tuple[Space, list[Hypothesis], Fit]:
    """Space, effects and fit without some of the effects."""
    start = rested(final.model, terms, here, home)
    here = home if any(t in MAPS for t in terms) else here
    left = [h for h in kept if h.term not in terms]
    return here, left, _refit(known, here, left, start)


def _still(known: Slopes, here: Space, home: Space, kept: list[Hypothesis],
           final: Fit) -> tuple[list[Hypothesis], Fit, list[tuple[str, str]]]:
    """Effects that still explain something after others were rejected, their fit, and the rejected ones."""
    gone: list[tuple[str, str]] = []
    while kept:
        tried = []
        for k, h in enumerate(kept):
            there = here if h.term in home.terms else home
            less = _refit(known, there, [g for g in kept if g is not h], rested(final.model, [h.term], here, home))
            tried.append((less.loss - final.loss - PER_PARAMETER * len(here.free(h.term)), k, less))
        least, k, less = min(tried, key=lambda entry: entry[0])
        if least >= LEAST_GAIN:
            break
        gone.append((kept[k].term, "it explains too little without the rejected effects"))
        here = here if kept[k].term in home.terms else home
        kept, final = [h for i, h in enumerate(kept) if i != k], less
    return kept, final, gone


def _moved(finding: Finding, model: Model, home: Space) -> bool:
    """Whether a parameter lies outside the interval around the simulator's value. Curves and products are judged by all
    parameters together."""
    term = finding.hypothesis.term
    if term in TOGETHER or finding.hypothesis.own:
        return True
    before = home.model.parameters
    return any(abs(model.parameters[name] - before[name]) > NORMAL95 * sd for name, sd in finding.sd.items())


def _strange_beside(finding: Finding, found: Sequence[Structure]) -> bool:
    """Whether an unknown structure acts along the same axes."""
    mine = {axis.removeprefix("force ") for axis in finding.axes}
    return any(s.kind != "motion" and mine & set(s.axes) for s in found)


def _level_instead(moments: Moments, known: Slopes, space: Space, kept: Sequence[Hypothesis], model: Model,
                   found: Sequence[Structure]) -> Named | None:
    """Where a thrust curve is rejected, its level may be accepted with the kept effects: mass, or a thrust scale.
    ``model``: with the curve."""
    start = carried(model, space.model).with_parameters(
        {n: v for n, v in space.model.parameters.items() if n.partition(".")[0] in MAPS})
    names = [h.term for h in kept]
    own = free_of(space, [h.term for h in kept if h.own])
    nothing = fit(known, start, free_of(space, names), own=own)
    tried = []
    for term in (t for t in LEVEL if t in space.terms):
        done = fit(known, nothing.model, free_of(space, [*names, term]), own=own)
        gain = nothing.loss - done.loss - PER_PARAMETER
        if gain > LEAST_GAIN and not (impossible(term, done, nothing.model) or
                                      feigned(term, done, nothing.model, moments)):
            tried.append(Hypothesis(term, done, gain))
    if not tried:
        return None
    best = max(tried, key=lambda h: h.gain)
    alike = tuple(h.term for h in tried if h is not best and best.gain - h.gain < ALIKE_LEFT * best.gain)
    named = Named((*kept, best), (*((),) * len(kept), alike), space, best.fit, nothing.loss)
    return None if hollow(moments, known, named, best, excess(moments, best.fit.left), space, found) else named


def _roughness(moments: Moments, left: np.ndarray, after: np.ndarray) -> Structure | None:
    """Structure along the covariates that no hypothesis explains, when it is large enough to matter."""
    c = int(np.argmax(after))
    if after[c] < LEAST_ALONE:
        return None
    size = _force_rms(moments, left, c)
    if size < (LEAST_FORCE_M_S2 if c < 3 else LEAST_TURNING):
        return None
    mine = np.flatnonzero(moments.owner == c)
    top = moments.channels[c].names[int(np.argmax(np.abs(left[mine])))]
    return Structure("motion", size if c < 3 else 0.0, float(after[c]), (CHANNELS[c],),
                     f"{CHANNELS[c]} goes with {top}")


def _force_rms(moments: Moments, left: np.ndarray, c: int) -> float:
    """RMS of the residual that the covariates predict: m/s^2 of force, share of the residual of torque."""
    channel, mine = moments.channels[c], moments.owner == c
    white = channel.basis @ (left[mine] * channel.sd)
    judged = channel.memory.judged
    share = float(np.sum(white[judged] ** 2) / max(channel.sd**2 / channel.spread * judged.sum(), 1e-12))
    if c >= 3:
        return float(np.sqrt(share))
    return float(np.sqrt(np.mean(channel.memory.colour(white)[judged] ** 2)))


def _finding(moments: Moments, known: Slopes, named: Named, h: Hypothesis, alike: tuple[str, ...], final: Fit,
             before: float, home: Space) -> Finding:
    model = final.model
    without = left_without(known, named, h, final, home)
    owner = moments.owner
    taken = np.array([max(float(without[owner == c] @ without[owner == c])
                          - float(final.left[owner == c] @ final.left[owner == c]), 0.0) for c in range(6)])
    axes = tuple(CHANNELS[c] for c in range(6) if taken[c] > ACTS_SHARE * taken.sum())
    gone = without - final.left
    slow = [(abs(g), name) for g, name, group in zip(gone, _names(moments), _groups(moments), strict=True)
            if group not in ("hypothesis", "turning", "flight")]
    wide = np.sqrt(WIDER * max(final.loss / max(len(final.left), 1), 1.0))
    drawn = bootstrap(known, final, named.own())
    believed = home.model.parameters
    sd = {model.names[i]: float(np.hypot(max(wide * np.sqrt(final.covariance[k, k]), drawn[k]),
                                         _systematic(model.names[i], model.values[i], believed)))
          for k, i in enumerate(final.free) if model.names[i].startswith(f"{h.term}.")}
    doubt = 12.0 / (12.0 + max(h.gain - LEAST_GAIN, 0.0))
    return Finding(h, alike, sd, float(taken.sum() / max(before - final.loss, taken.sum(), 1e-9)), axes,
                   max(slow)[1] if slow else "", float(np.clip(MOST_SURE - DOUBT * doubt, UNSURE, MOST_SURE)))


def _systematic(name: str, value: float, believed: Mapping[str, float]) -> float:
    """Standard deviation of a value that is not in the scatter of its moments."""
    if name == HEIGHT:
        return HEIGHT_SD_M
    if name.startswith(INERTIA):
        return INERTIA_SD * abs(value)
    return SYSTEMATIC * abs(value - believed.get(name, 0.0))


def _names(moments: Moments) -> list[str]:
    return [n for c in moments.channels for n in c.names]


def _groups(moments: Moments) -> list[str]:
    return [g for c in moments.channels for g in c.groups]


__all__ = ["LEAST_GAIN", "PER_PARAMETER", "Decision", "Finding", "decide", "without"]
