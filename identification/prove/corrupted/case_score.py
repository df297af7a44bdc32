"""Verdicts against truths: identified, false, and missed effects that predictions show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from identification.prove.score import IntervalScore, class_of, score_case
from nanobench_tools.results.result import Result

from .cases import CorruptedCase, table_name
from .judge import Diagnosed
from .sizes import VISIBLE


@dataclass(frozen=True, repr=False)
class CorruptedScore(Result):
    """One case.

    - rise: of a prediction error; visible: by VISIBLE or more.
    - outcome, named: of the verdict; identified: every effect there is.
    - false: terms that are not there. In a control these are all that it identifies; they are ``imperfect`` in the
      others of its group, and not counted.
    - missed: visible and not identified; intervals: of right terms.
    - share: of the improvement that the nominal simulator reaches.
    - confidence: of each finding, and whether it is right."""

    case: str
    vehicle: str
    group: int
    kind: str
    belief: str
    times: float
    rise: float
    visible: bool
    outcome: str
    named: tuple[str, ...]
    identified: bool
    false: tuple[str, ...]
    imperfect: tuple[str, ...]
    missed: bool
    intervals: tuple[IntervalScore, ...]
    confidence: tuple[tuple[float, bool], ...]
    share: float | None
    cpu_s: float
    error: str = ""


def score_all(cases: Sequence[CorruptedCase], found: Mapping[str, Diagnosed]) -> list[CorruptedScore]:
    """Of the cases that were diagnosed."""
    judged = [c for c in cases if c.name in found]
    usual = {(c.vehicle, c.group): imperfections(found[c.name].verdict) for c in judged if c.kind == "control"}
    return [score(c, found[c.name], usual.get((c.vehicle, c.group), frozenset())) for c in judged]


def imperfections(verdict: Mapping[str, Any]) -> frozenset[str]:
    """Terms that are identified with the nominal simulator."""
    return frozenset(term for finding in verdict["findings"] for term in class_of(finding))


def score(case: CorruptedCase, found: Diagnosed, usual: frozenset[str] = frozenset()) -> CorruptedScore:
    """``usual``: effects identified in the control of the group."""
    verdict = {"power": {}, "elapsed_s": found.cpu_s, "data_faults": [], **found.verdict}
    whole = score_case(case.truth, verdict)
    right = [entry.right or not class_of(f).isdisjoint(case.near)
             for f, entry in zip(verdict["findings"], whole.findings, strict=True)]
    wrong = [f for f, ok in zip(verdict["findings"], right, strict=True) if not ok]
    imperfect = tuple(f["term"] for f in wrong if not class_of(f).isdisjoint(usual) and case.kind != "control")
    false = tuple(f["term"] for f in wrong if f["term"] not in imperfect)
    if case.kind == "outside":
        identified = any(right) or whole.unknown
    else:
        identified = bool(whole.effects) and all(e.named for e in whole.effects)
    visible = case.kind != "control" and case.rise >= VISIBLE
    return CorruptedScore(
        case.name, case.vehicle, case.group, case.kind, table_name(case), case.times, case.rise, visible,
        verdict["outcome"], tuple(f["term"] for f in verdict["findings"]), identified, false, imperfect,
        visible and not identified, whole.intervals,
        tuple((float(f.get("confidence", 1.0)), ok) for f, ok in zip(verdict["findings"], right, strict=True)
              if f["term"] not in imperfect), found.share, found.cpu_s, found.error)
