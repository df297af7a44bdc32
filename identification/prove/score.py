"""One verdict against one truth: right and false effects, missed ones, and the coverage of intervals.

A finding is a class: its term and its ``equivalent`` terms. It is right if the class contains the term of a concealed
effect, or one that the truth declares indistinguishable from it in free flight. Any other finding is false; so is every
finding on a null, a data fault or a foreign effect. A small effect that was not identified counts as right if its size
is below the smallest detectable one in the verdict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from nanobench_tools.physics.model import find_term
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.results.result import Result

from .truth import TrueEffect, TrueParameter, Truth

Verdict = Mapping[str, Any]
"""The content of verdict.json."""

IN_PRODUCTS = terms_that(lambda term: term.in_products)
"""Terms whose parameters are only seen in a product (rho R^2): a value of one alone is not compared."""


@dataclass(frozen=True, repr=False)
class EffectScore(Result):
    """Whether a concealed effect was identified, ``by`` which finding, ``exactly`` by its own term. ``class_size``:
    number of terms of the finding. ``below_power``: not identified, and below the smallest detectable size."""

    term: str
    size: str
    named: bool
    by: str | None
    exactly: bool
    class_size: int | None
    below_power: bool


@dataclass(frozen=True, repr=False)
class FindingScore(Result):
    """Whether a finding is right, and how sure it was."""

    term: str
    equivalent: tuple[str, ...]
    confidence: float
    right: bool


@dataclass(frozen=True, repr=False)
class IntervalScore(Result):
    """Whether a stated 95 % interval holds the true value; believed: what the simulator says, if anything."""

    parameter: str
    true: float
    believed: float | None
    value: float
    ci95: tuple[float, float]
    covered: bool


@dataclass(frozen=True, repr=False)
class CaseScore(Result):
    """One case.

    Score of one case.

    - truth: concealed or injected effects; outcome, named: the diagnosis.
    - right: all effects and only these are identified, and the outcome fits; false_name: a finding is false.
    - intervals: parameters of rightly identified terms.
    - flights_right, fault_right: whether the flights of a change, and the kinds of faults with their flights, match
      the truth (None without any).
    - improvement, power: as in the verdict.
    """

    case: str
    kind: str
    engine: str | None
    note: str
    truth: tuple[str, ...]
    outcome: str
    named: tuple[str, ...]
    cause: str | None
    right: bool
    false_name: bool
    unknown: bool
    sizes: tuple[str, ...]
    effects: tuple[EffectScore, ...]
    foreign: tuple[str, ...]
    findings: tuple[FindingScore, ...]
    intervals: tuple[IntervalScore, ...]
    flights_right: bool | None
    fault_right: bool | None
    improvement: Mapping[str, Any] | None
    power: Mapping[str, Mapping[str, Any]]
    elapsed_s: float

    @property
    def false(self) -> list[str]:
        """Terms of the false findings."""
        return [f.term for f in self.findings if not f.right]


def score_case(truth: Truth, verdict: Verdict) -> CaseScore:
    """``verdict`` as of ``nanobench diagnose``."""
    findings = list(verdict["findings"])
    effects = [e for e in truth.effects if not e.foreign]
    foreign = [e.term for e in truth.effects if e.foreign]
    right = [any(_names(f, e) for e in effects) for f in findings]
    given = _assigned(effects, findings)
    scored = [_effect(e, None if i is None else findings[i], verdict) for e, i in zip(effects, given, strict=True)]
    return CaseScore(
        truth.case, truth.kind, truth.engine, truth.note,
        (*(e.term for e in truth.effects), *dict.fromkeys(f.kind for f in truth.faults)),
        verdict["outcome"], tuple(f["term"] for f in findings),
        cause=next((f["cause"] for f in findings if f.get("cause")), None),
        right=_right(truth, verdict, scored, bool(foreign), all(right)), false_name=not all(right),
        unknown=_unknown(verdict), sizes=tuple(e.size for e in truth.effects),
        effects=tuple(scored), foreign=tuple(foreign),
        findings=tuple(FindingScore(f["term"], tuple(f.get("equivalent", ())), f["confidence"], ok)
                       for f, ok in zip(findings, right, strict=True)),
        intervals=tuple(entry for e, i in zip(effects, given, strict=True) if i is not None
                        for entry in _intervals(e, findings[i])),
        flights_right=_flights_right(effects, given, findings) if truth.kind == "change" else None,
        fault_right=_fault_right(truth, verdict) if truth.faults else None,
        improvement=verdict.get("improvement"), power=verdict.get("power") or {}, elapsed_s=verdict["elapsed_s"])


def class_of(finding: Mapping[str, Any]) -> set[str]:
    """The terms a finding stands for."""
    return {finding["term"], *finding.get("equivalent", ())}


def _names(finding: Mapping[str, Any], effect: TrueEffect) -> bool:
    return not class_of(finding).isdisjoint({effect.term, *effect.twins})


def _assigned(effects: Sequence[TrueEffect], findings: Sequence[Mapping[str, Any]]) -> list[int | None]:
    """Index of the finding that names each effect: a finding names one effect, rather by its own term."""
    if not effects or not findings:
        return [None] * len(effects)
    fits = np.array([[_names(f, e) + (f["term"] == e.term) for f in findings] for e in effects], float)
    found: list[int | None] = [None] * len(effects)
    for row, column in zip(*linear_sum_assignment(fits, maximize=True), strict=True):
        if fits[row, column]:
            found[row] = int(column)
    return found


def _effect(effect: TrueEffect, finding: Mapping[str, Any] | None, verdict: Verdict) -> EffectScore:
    if finding is not None:
        term = finding["term"]
        return EffectScore(effect.term, effect.size, True, term, term == effect.term, len(class_of(finding)), False)
    stated = (verdict.get("power") or {}).get(effect.term)
    return EffectScore(effect.term, effect.size, False, None, False, None,
                       stated is not None and below(effect, stated))


def below(effect: TrueEffect, stated: Mapping[str, Any]) -> bool:
    """Whether an effect is below the smallest detectable one: ``stated`` {minimum_detectable, unit, parameter}.

    The largest change of that parameter (of any element of it; without ``parameter``, of any parameter in that unit)
    is compared. It counts from the simulator's value, or from the neutral value if the simulator lacks the term. A
    minimum of None means that no size is detectable.
    """
    least = stated["minimum_detectable"]
    if least is None:
        return True
    changes = [abs(p.value - _before(name, p)) for name, p in effect.parameters.items()
               if (_base(name) == _base(stated["parameter"]) if stated.get("parameter")
                   else p.unit == stated["unit"])]
    return bool(changes) and max(changes) < least


def _base(name: str) -> str:
    return name.partition("[")[0]


def _before(name: str, parameter: TrueParameter) -> float:
    if parameter.believed is not None:
        return parameter.believed
    term, _, rest = _base(name).partition(".")
    neutral = next((p.neutral for p in find_term(term).parameters if p.name == rest), None)
    return float(neutral) if isinstance(neutral, (int, float)) else 0.0


def _unknown(verdict: Verdict) -> bool:
    return verdict["outcome"] == "unknown" or verdict.get("unknown") is not None


def _right(truth: Truth, verdict: Verdict, scored: Sequence[EffectScore], foreign: bool, no_false: bool) -> bool:
    if not no_false:
        return False
    if truth.faults:
        return bool(verdict["outcome"] == truth.outcome)
    if foreign and not _unknown(verdict):
        return False
    if not scored and not foreign:
        return bool(verdict["outcome"] == "none")
    return all(e.named or (e.size == "small" and e.below_power) for e in scored)


def _flights_right(effects: Sequence[TrueEffect], given: Sequence[int | None],
                   findings: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the findings name the flights in which the effects act, and no others."""
    return all(i is not None and set((findings[i].get("where") or {}).get("flights") or ()) == set(e.flights)
               for e, i in zip(effects, given, strict=True))


def _fault_right(truth: Truth, verdict: Verdict) -> bool:
    """Whether the data faults of the verdict hold every injected kind, in the flights it is in."""
    stated = {(f.get("flight"), f["kind"]) for f in verdict["data_faults"]}
    return {(f.flight, f.kind) for f in truth.faults} <= stated


def _intervals(effect: TrueEffect, finding: Mapping[str, Any]) -> list[IntervalScore]:
    """Of a term named by its own name only, since its twins have other parameters, and of parameters that the finding
    gives with an interval."""
    if finding["term"] != effect.term or effect.term in IN_PRODUCTS:
        return []
    found = []
    for name, true in effect.parameters.items():
        stated = finding["parameters"].get(name) or finding["parameters"].get(name.partition(".")[2])
        if stated is None or stated.get("ci95") is None:
            continue
        low, high = stated["ci95"]
        found.append(IntervalScore(name, true.value, true.believed, stated["value"], (low, high),
                                   bool(low <= true.value <= high)))
    return found
