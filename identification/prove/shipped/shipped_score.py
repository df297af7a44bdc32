"""One case scored: is the known error identified, with its size, and is it gone after the makers' correction?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.prove.corrupted.beliefs import LEVELS, truth_of
from identification.prove.corrupted.sizes import VISIBLE
from identification.prove.score import class_of
from nanobench_tools.physics import Model
from nanobench_tools.results.result import Result

from .shipped_cases import ANOTHER, EFFECT, GEOMETRY, ShippedCase

REFUSED = "refused"
"""Outcome where the simulator has a value that no vehicle can have: one line names it, and no flight is judged."""


@dataclass(frozen=True, repr=False)
class ShippedAnswer(Result):
    """Result of a diagnosis: outcome, paragraph, findings and corrected simulator as in verdict.json.

    Outcomes before any physics are ``motor_geometry`` and ``refused``."""

    outcome: str
    paragraph: str
    findings: tuple[Mapping[str, Any], ...] = ()
    corrected: Mapping[str, Any] | None = None


@dataclass(frozen=True, repr=False)
class KnownError(Result):
    """One error that the simulator shipped with.

    - terms: any of them is right; by: the finding that has one, None where none has.
    - parameter, true, value, ci95: as the makers corrected it and as identified, None where it is not compared. Of
      mass and thrust, the ratio of thrust to weight over the shipped one.
    - inside: whether all intervals of the finding hold the makers' values."""

    terms: tuple[str, ...]
    by: str | None
    parameter: str | None
    true: float | None
    value: float | None
    ci95: tuple[float, float] | None
    inside: bool | None


@dataclass(frozen=True, repr=False)
class ShippedErrors(Result):
    """Prediction error of one quantity at one horizon: the one that the shipped error raises most."""

    quantity: str
    unit: str
    ahead_s: float
    shipped: float | None
    identified: float | None
    corrected: float | None


@dataclass(frozen=True, repr=False)
class ShippedScore(Result):
    """One case.

    - shown: largest rise of a prediction error over that of the corrected simulator; visible: by a quarter or more,
      or the answer is no effect.
    - named: terms identified in the simulator as shipped; also: in the corrected one.
    - false: identified as shipped and not part of the known error. Effects that are identified in the corrected or
      the nominal simulator, too, are not counted.
    - again: identified in the corrected simulator although it is right there.
    - sized: all known errors have their size in the interval; right: the whole answer; why not, in words."""

    name: str
    answer: str
    before: ShippedAnswer
    after: ShippedAnswer
    known: tuple[KnownError, ...]
    named: tuple[str, ...]
    also: tuple[str, ...]
    false: tuple[str, ...]
    again: tuple[str, ...]
    shown: float | None
    visible: bool
    identified: bool
    sized: bool | None
    right: bool
    why: str


def score_shipped(case: ShippedCase, models: tuple[Model | None, Model], answers: tuple[ShippedAnswer, ShippedAnswer],
                  usual: ShippedAnswer | None, lift: float | None, shown: float | None) -> ShippedScore:
    """``models``, ``answers``: as shipped and corrected. ``usual``: answer on the nominal simulator, where it is the
    basis. ``lift``: ratio of thrust to weight, corrected over shipped. ``shown``: see ShippedScore."""
    before, after = answers
    known = tuple(_known(terms, before, models, lift) for terms in case.known)
    mine = {term for terms in case.known for term in terms}
    in_nominal, in_after = _classes(usual), _classes(after)
    false = tuple(f["term"] for f in before.findings
                  if class_of(f).isdisjoint(mine | in_nominal | in_after))
    if usual is None:  # a whole simulator of others is known to be right in what was corrected alone
        again = tuple(f["term"] for f in after.findings if not class_of(f).isdisjoint(mine))
    else:
        again = tuple(f["term"] for f in after.findings if class_of(f).isdisjoint(in_nominal))
    visible = case.answer != EFFECT or shown is None or shown >= VISIBLE
    identified, why = _identified(case, before, known)
    sizes = [k.inside for k in known if k.inside is not None]
    sized = all(sizes) if sizes else None
    wrong = [why] if not identified and visible else []
    if sized is False:
        wrong.append("the size is not in the interval")
    if false:
        wrong.append(f"also identified: {', '.join(false)}")
    if again:
        wrong.append(f"identified after the correction: {', '.join(again)}")
    if case.after == ANOTHER and not of_another_vehicle(after):
        wrong.append("the corrected simulator is not taken for another vehicle")
    if not case.after and after.outcome in (GEOMETRY, REFUSED):
        wrong.append(f"the corrected simulator is refused: {after.paragraph}")
    if not case.after and of_another_vehicle(after):
        wrong.append("the corrected simulator is taken for another vehicle")
    if not wrong and not identified:
        why = "predictions hardly show it, and it is rightly not identified"
    return ShippedScore(case.name, case.answer, before, after, known, tuple(f["term"] for f in before.findings),
                        tuple(f["term"] for f in after.findings), false, again, shown, visible, identified, sized,
                        not wrong, "; ".join(wrong) or ("" if identified else why))


def of_another_vehicle(answer: ShippedAnswer) -> bool:
    """Whether the verdict is that the simulator is of another vehicle."""
    return answer.outcome == "insufficient" and "of another vehicle" in answer.paragraph


def _identified(case: ShippedCase, before: ShippedAnswer, known: Sequence[KnownError]) -> tuple[bool, str]:
    if case.answer == ANOTHER:
        return of_another_vehicle(before), "not taken for another vehicle"
    if case.answer == GEOMETRY:
        return before.outcome == GEOMETRY, "motor order and spins are not refused"
    assert case.answer == EFFECT
    if of_another_vehicle(before):
        return False, "taken for another vehicle, so the effect is not identified"
    missing = [" or ".join(k.terms) for k in known if k.by is None]
    return not missing, f"not identified: {', '.join(missing)}"


def _classes(answer: ShippedAnswer | None) -> frozenset[str]:
    return frozenset(term for f in (answer.findings if answer else ()) for term in class_of(f))


def _known(terms: tuple[str, ...], before: ShippedAnswer, models: tuple[Model | None, Model],
           lift: float | None) -> KnownError:
    if before.outcome == REFUSED:
        by = next((t for t in terms if t in before.paragraph), None)
        return KnownError(terms, by, None, None, None, None, None)
    finding = next((f for f in before.findings if not class_of(f).isdisjoint(terms)), None)
    if finding is None:
        return KnownError(terms, None, None, None, None, None, None)
    term, values = finding["term"], finding["parameters"]
    if term in LEVELS:
        return _level(terms, term, values, lift)
    shipped, corrected = models
    assert shipped is not None  # it was diagnosed
    truth = {n: p for e in truth_of(corrected, shipped, "", ()) if e.term == term for n, p in e.parameters.items()}
    compared = [n for n in values if n in truth and values[n].get("ci95")]
    if not compared:
        return KnownError(terms, term, None, None, None, None, None)
    inside = all(values[n]["ci95"][0] <= truth[n].value <= values[n]["ci95"][1] for n in compared)
    first = compared[0]
    return KnownError(terms, term, first, truth[first].value, values[first]["value"],
                      (values[first]["ci95"][0], values[first]["ci95"][1]), inside)


def _level(terms: tuple[str, ...], term: str, values: Mapping[str, Any], lift: float | None) -> KnownError:
    """Mass and thrust as one factor of thrust over weight."""
    (found,) = list(values.values())[:1]
    believed, (low, high) = found["believed"], found["ci95"]

    def factor(x: float) -> float:
        return float(believed / x if term == "mass" else x / believed)

    if not believed or lift is None or not np.isfinite(lift):
        return KnownError(terms, term, None, None, None, None, None)
    ends = sorted((factor(low), factor(high)))
    return KnownError(terms, term, "thrust over weight", lift, factor(found["value"]), (ends[0], ends[1]),
                      ends[0] <= lift <= ends[1])
