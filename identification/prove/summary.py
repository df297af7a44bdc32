"""Many scored cases -> what a proof says: rates with intervals, recall, confusion, coverage, calibration, power."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from scipy.stats import binomtest

from nanobench_tools.results.result import OPTIONAL, Result

from .case_kinds import OUTCOMES
from .effects import SIZES
from .score import CaseScore, EffectScore, IntervalScore

STATED = (0.0, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Edges of the groups of stated confidence."""
ALONE = ("single", "twin")
"""Kinds with one effect in all flights: recall by size and power are of these."""


@dataclass(frozen=True, repr=False)
class Share(Result):
    """ci95: exact binomial interval (Clopper and Pearson 1934); None for no case at all."""

    n: int
    right: int
    share: float | None
    ci95: tuple[float, float] | None

    @classmethod
    def of(cls, right: Iterable[bool], *more: Any) -> Self:
        """How often ``right`` holds; ``more``: further fields.

        >>> Share.of([True, False]).share
        0.5
        """
        found = list(right)
        hits = sum(found)
        if not found:
            return cls(0, 0, None, None, *more)
        ends = binomtest(int(hits), len(found)).proportion_ci(0.95, method="exact")
        return cls(len(found), int(hits), hits / len(found), (float(ends.low), float(ends.high)), *more)


@dataclass(frozen=True, repr=False)
class Recall(Share):
    """Effects named, or small and rightly below what could be seen; both also apart."""

    named: int
    below_power: int


@dataclass(frozen=True, repr=False)
class KindRates(Share):
    """Cases of one kind that are right; flights_right, fault_right where any case of the kind has them."""

    false_names: Share
    outcomes: Mapping[str, int]
    flights_right: Share | None = field(default=None, metadata=OPTIONAL)
    fault_right: Share | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class EngineRates(Share):
    """Cases of one engine that are right."""

    false_names: Share


@dataclass(frozen=True, repr=False)
class Pairs(Result):
    """How many of two effects were named."""

    both: Share
    one: int
    none: int


@dataclass(frozen=True, repr=False)
class Classes(Result):
    """How sharp right names are: share that is the true term itself, and the mean number of terms in a class."""

    exactly: Share
    mean_size: float | None


@dataclass(frozen=True, repr=False)
class Spread(Result):
    """Quantiles of n values."""

    n: int
    median: float | None = None
    p10: float | None = None
    p90: float | None = None
    max: float | None = None

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of any number of values."""
        if not len(values):
            return cls(0)
        low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
        return cls(len(values), float(middle), float(low), float(high), float(np.max(values)))


@dataclass(frozen=True, repr=False)
class TermError(Result):
    """Of a term the median over parameters of |value - true| over the change |true - believed|."""

    n: int
    median: float


@dataclass(frozen=True, repr=False)
class Details(Result):
    """n and interval of each figure of a summary."""

    recall_by_size: Mapping[str, Recall]
    unknown_on_foreign: Share
    coverage95: Share
    false_name_rate: Share
    share_of_achievable: Spread


@dataclass(frozen=True, repr=False)
class Summary(Result):
    """Summary of a blind proof.

    - false_names: cases with a false name; false_name_rate with ci95 over all cases.
    - recall_by_size: share of single effects (singles and twins) identified, of small ones also those rightly below
      the stated detectable size.
    - coverage95: share of 95 % intervals that hold the true value.
    - calibration: [stated confidence, share of findings that are right, findings].
    - share_of_achievable: median over rightly identified cases.
    - confusion: {true effect: {identified effect: count}}.
    - abstained: cases with an effect of the vocabulary and a verdict without a decision."""

    cases: int
    right: int
    false_names: int
    false_name_rate: float | None
    ci95: tuple[float, float] | None
    recall_by_size: Mapping[str, float | None]
    unknown_on_foreign: float | None
    coverage95: float | None
    calibration: Sequence[tuple[float, float, int]]
    share_of_achievable: float | None
    by_kind: Mapping[str, KindRates]
    by_engine: Mapping[str, EngineRates]
    pairs: Pairs
    confusion: Mapping[str, Mapping[str, int]]
    abstained: Share
    classes: Classes
    parameter_error: Mapping[str, TermError]
    run_time_s: Spread
    details: Details


@dataclass(frozen=True, repr=False)
class TermPower(Result):
    """Single effects of one term named, by size; minimum_detectable: median stated by the verdicts of all cases."""

    small: Recall | None = field(default=None, metadata=OPTIONAL)
    medium: Recall | None = field(default=None, metadata=OPTIONAL)
    large: Recall | None = field(default=None, metadata=OPTIONAL)
    minimum_detectable: float | None = None
    unit: str | None = None


def summarise(cases: Sequence[CaseScore]) -> Summary:
    """``summary`` of prove.json."""
    false = Share.of(c.false_name for c in cases)
    unknown = Share.of(c.right for c in cases if c.foreign)
    intervals = [entry for c in cases for entry in c.intervals]
    covered = Share.of(entry.covered for entry in intervals)
    recall = {size: _recall([e for c in cases if c.kind in ALONE for e in c.effects if e.size == size])
              for size in SIZES}
    kinds = {kind: [c for c in cases if c.kind == kind]
             for kind in dict.fromkeys([*OUTCOMES, *(c.kind for c in cases)])}
    engines = {engine: [c for c in cases if c.engine == engine]
               for engine in dict.fromkeys(c.engine for c in cases) if engine}
    pairs = [sum(e.named for e in c.effects) for c in cases if len(c.effects) == 2]
    named = [e for c in cases for e in c.effects if e.named]
    gained = Spread.of([x for c in cases if c.right and c.named
                        and (x := (c.improvement or {}).get("share_of_achievable")) is not None])
    return Summary(
        len(cases), sum(c.right for c in cases), false.right, false.share, false.ci95,
        recall_by_size={size: found.share for size, found in recall.items()},
        unknown_on_foreign=unknown.share, coverage95=covered.share, calibration=calibration(cases),
        share_of_achievable=gained.median, by_kind={kind: _by_kind(mine) for kind, mine in kinds.items() if mine},
        by_engine={engine: EngineRates.of((c.right for c in mine), Share.of(c.false_name for c in mine))
                   for engine, mine in engines.items()},
        pairs=Pairs(Share.of(count == 2 for count in pairs), pairs.count(1), pairs.count(0)),
        confusion=confusion(cases),
        abstained=Share.of(c.outcome in ("unknown", "insufficient") for c in cases if c.effects),
        classes=Classes(Share.of(e.exactly for e in named),
                        float(np.mean([e.class_size for e in named])) if named else None),
        parameter_error=_parameter_error(intervals), run_time_s=Spread.of([c.elapsed_s for c in cases]),
        details=Details(recall, unknown, covered, false, gained))


def _recall(effects: Sequence[EffectScore]) -> Recall:
    quiet = [e.size == "small" and e.below_power for e in effects]
    named = [e.named for e in effects]
    return Recall.of((q or n for q, n in zip(quiet, named, strict=True)), sum(named), sum(quiet))


def _by_kind(cases: Sequence[CaseScore]) -> KindRates:
    flights, faults = ([x for x in found if x is not None] for found in
                       ([c.flights_right for c in cases], [c.fault_right for c in cases]))
    return KindRates.of((c.right for c in cases), Share.of(c.false_name for c in cases),
                        Counter(c.outcome for c in cases), Share.of(flights) if flights else None,
                        Share.of(faults) if faults else None)


def confusion(cases: Sequence[CaseScore]) -> dict[str, dict[str, int]]:
    """{truth: {diagnosis: count}}. Rows: terms, ``nothing``, ``fault KIND``, ``foreign NAME``. Columns: identified
    terms, else the outcome. A missed effect is paired with a false finding of its case, if there is one. Further
    false findings are in the row ``nothing``."""
    table: dict[str, Counter[str]] = {}

    def count(there: str, answer: str) -> None:
        table.setdefault(there, Counter())[answer] += 1

    for case in cases:
        false = case.false
        silence = "none" if case.outcome == "named" else case.outcome
        for effect in case.effects:
            count(effect.term, effect.by or (false.pop(0) if false else silence))
        others = [f"foreign {name}" for name in case.foreign]
        if case.kind == "fault":
            others += [f"fault {name}" for name in case.truth]
        for there in others or ([] if case.effects else ["nothing"]):
            count(there, false.pop(0) if false else silence)
        for answer in false:
            count("nothing", answer)
    return {there: dict(answer.most_common()) for there, answer in sorted(table.items())}


def calibration(cases: Sequence[CaseScore]) -> list[tuple[float, float, int]]:
    """[mean stated confidence, share of findings that are right, findings] per group of ``STATED``."""
    stated = np.array([f.confidence for c in cases for f in c.findings], float)
    right = np.array([f.right for c in cases for f in c.findings], float)
    group = np.clip(np.searchsorted(STATED, stated, side="right") - 1, 0, len(STATED) - 2)
    return [(float(stated[group == g].mean()), float(right[group == g].mean()), int(np.sum(group == g)))
            for g in range(len(STATED) - 1) if (group == g).any()]


def _parameter_error(intervals: Sequence[IntervalScore]) -> dict[str, TermError]:
    found: dict[str, list[float]] = {}
    for entry in intervals:
        change = abs(entry.true - (entry.believed or 0.0))
        if change > 0.0:
            found.setdefault(entry.parameter.partition(".")[0], []).append(abs(entry.value - entry.true) / change)
    return {term: TermError(len(errors), float(np.median(errors))) for term, errors in sorted(found.items())}


def power_by_term(cases: Sequence[CaseScore]) -> dict[str, TermPower]:
    """``power`` of prove.json."""
    effects = [e for c in cases if c.kind in ALONE for e in c.effects]
    stated: dict[str, list[Mapping[str, Any]]] = {}
    for case in cases:
        for term, entry in case.power.items():
            if entry.get("minimum_detectable") is not None:
                stated.setdefault(term, []).append(entry)
    found = {}
    for term in sorted({*stated, *(e.term for e in effects)}):
        sizes = {size: [e for e in effects if e.term == term and e.size == size] for size in SIZES}
        unit, of_unit = _usual_unit(stated.get(term, []))
        found[term] = TermPower(**{size: _recall(mine) for size, mine in sizes.items() if mine},
                                minimum_detectable=float(np.median(of_unit)) if of_unit else None, unit=unit)
    return found


def _usual_unit(stated: Sequence[Mapping[str, Any]]) -> tuple[str | None, list[float]]:
    """The unit most verdicts state a minimum in, and these minima."""
    if not stated:
        return None, []
    unit = Counter(entry["unit"] for entry in stated).most_common(1)[0][0]
    return unit, [entry["minimum_detectable"] for entry in stated if entry["unit"] == unit]
