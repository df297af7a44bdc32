"""Verdicts on folders against their labels: right cause and motors, false names, size found against size done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from identification.mismatch.steady.known import LOADS
from nanobench_tools.results.result import Result

from .condition_labels import NORMAL, Label
from .folders import LEAVE_ONE_OUT, Judged
from .score import Verdict
from .summary import Share


@dataclass(frozen=True, repr=False)
class FoundSize(Result):
    """What the trim says at the labelled motors, whether anything was named or not: thrust lost [%] of each, and the
    change of the total."""

    loss_percent: tuple[float, ...]
    total_percent: float
    sd_percent: float


@dataclass(frozen=True, repr=False)
class FolderScore(Result):
    """One folder. ``right``: the label's cause is named, with just its motors where both name any; of normal flights,
    that nothing is. ``in_class``: accepted, with just its motors, among several causes that are identified together.
    ``below``: nothing is named, and what the trim shows lies below the stated detectable size. ``improvement``,
    ``power``, ``trim``, ``paragraph``: as of the verdict."""

    case: str
    kind: str
    truth: tuple[str, ...]
    motors: tuple[int, ...]
    cut_mm: tuple[tuple[float, ...], ...]
    mass_g: float | None
    outcome: str
    named: tuple[str, ...]
    cause: str | None
    causes: tuple[str, ...]
    motors_named: tuple[int, ...]
    motors_right: bool | None
    right: bool
    false_name: bool
    below: bool
    size: FoundSize | None
    confidence: float | None
    improvement: Mapping[str, Any] | None
    power: Mapping[str, Mapping[str, Any]]
    trim: Mapping[str, Any] | None
    paragraph: str
    elapsed_s: float
    in_class: bool = False


@dataclass(frozen=True, repr=False)
class LabelRates(Share):
    """Folders of one label that are right; below: not named, and too small to be; false_names: how many have one;
    in_class: named together with others."""

    below: int
    false_names: int
    outcomes: Mapping[str, int]
    in_class: int = 0


@dataclass(frozen=True, repr=False)
class DoseResponse(Result):
    """Millimetres cut off both blades against thrust lost [%]; spearman None below three doses."""

    n: int
    cut_mm: tuple[float, ...]
    loss_percent: tuple[float, ...]
    spearman: float | None

    @classmethod
    def of(cls, pairs: Sequence[tuple[float, float]]) -> DoseResponse:
        """From (dose, loss) of every motor."""
        doses, losses = tuple(d for d, _ in pairs), tuple(x for _, x in pairs)
        known = len(set(doses)) >= 3
        return cls(len(pairs), doses, losses, float(spearmanr(doses, losses).statistic) if known else None)


@dataclass(frozen=True, repr=False)
class Doses(Result):
    """Of folders with one motor cut, and of all motors that were cut."""

    one_motor: DoseResponse
    all_motors: DoseResponse


@dataclass(frozen=True, repr=False)
class FolderSummary(Result):
    """As ``summary.Summary`` where that applies to folders, too; false_alarms: of normal flights left out."""

    cases: int
    right: int
    false_names: int
    false_name_rate: float | None
    ci95: tuple[float, float] | None
    by_kind: Mapping[str, LabelRates]
    recall_by_size: Mapping[str, float]
    unknown_on_foreign: float | None
    coverage95: float | None
    calibration: Sequence[tuple[float, float, int]]
    share_of_achievable: float | None
    false_alarms: Share
    dose: Doses


@dataclass(frozen=True, repr=False)
class LeastSize(Result):
    """Median over folders of the smallest size that would have been named."""

    minimum_detectable: float | None
    unit: str


@dataclass(frozen=True, repr=False)
class FolderProof(Result):
    """prove.json of a proof on folders. ``unlabelled``: folders that were diagnosed and not scored; ``without_folder``:
    labels of no folder here; ``normal``: names of flights; verdicts by folder."""

    cases: tuple[FolderScore, ...]
    summary: FolderSummary
    power: Mapping[str, LeastSize]
    unlabelled: tuple[str, ...]
    without_folder: tuple[str, ...]
    normal: tuple[str, ...]
    verdicts: Mapping[str, Verdict] = field(default_factory=dict)


def score_folder(folder: str, label: Label, verdict: Verdict, stranger: bool) -> FolderScore:
    """A finding of several causes (``cause`` null) is neither right nor false while the label's is among them.
    ``stranger``: the normal flights are another vehicle's, whose name is right too."""
    findings = list(verdict["findings"])
    truth = tuple(c for c in (label.cause, *(["vehicle"] if stranger else [])) if c != NORMAL)
    named = [f["cause"] for f in findings if f["cause"]]
    motors = tuple(sorted({m for f in findings if f["cause"] == label.cause for m in f["motors"]}))
    motors_right = None if not label.motors or not motors else motors == tuple(sorted(label.motors))
    right = any(c in truth for c in named) and motors_right is not False if truth else not findings
    return FolderScore(
        folder, "vehicle" if stranger else label.cause, truth, label.motors, label.cut_mm, label.mass_g,
        verdict["outcome"], tuple(f["term"] for f in findings), cause=named[0] if named else None,
        causes=tuple(c for f in findings for c in f["causes"]), motors_named=motors, motors_right=motors_right,
        right=right, false_name=any(not set(f["causes"]) & set(truth) for f in findings) or motors_right is False,
        below=not findings and bool(truth) and _below(label, verdict), size=found_size(label, verdict),
        confidence=findings[0]["confidence"] if findings else None, improvement=verdict.get("improvement"),
        power=verdict.get("power") or {}, trim=verdict.get("trim"), paragraph=verdict["paragraph"],
        elapsed_s=verdict["elapsed_s"], in_class=not right and any(
            member["cause"] == label.cause and sorted(member["motors"] or label.motors * (label.cause in LOADS)) ==
            sorted(label.motors) for f in findings if not f["cause"] for member in f.get("members", ())))


def found_size(label: Label, verdict: Verdict) -> FoundSize | None:
    """None without a trim."""
    trim = verdict.get("trim")
    if not trim:
        return None
    change = np.array(trim["change_percent"]) / 100.0
    return FoundSize(tuple(float(100.0 * -np.expm1(-change[m - 1])) for m in label.motors),
                     float(25.0 * np.expm1(change).sum()), trim["sd_percent"])


def _below(label: Label, verdict: Verdict) -> bool:
    """Whether what the trim shows of a label that was not named lies below the stated detectable size."""
    size, power = found_size(label, verdict), verdict.get("power") or {}
    least = (power.get("propeller") or {}).get("minimum_detectable")
    if label.cause not in ("propeller", "tape", "weight", "slung") or size is None or least is None:
        return False
    return bool(max([*size.loss_percent, 0.0]) < least)


def score_folders(judged: Judged, labels: Mapping[str, Label], stranger: bool) -> FolderProof:
    """The labels are opened here."""
    cases = [score_folder(name, labels[name], verdict, stranger) for name, verdict in judged.verdicts.items()
             if name in labels]
    nothing = Label(NORMAL)
    alarms = [score_folder(LEAVE_ONE_OUT + name, nothing, verdict, False) for name, verdict in judged.alarms.items()]
    every = [*cases, *alarms]
    false = Share.of(c.false_name for c in every)
    kinds = {kind: [c for c in every if c.kind == kind] for kind in dict.fromkeys(c.kind for c in every)}
    sure = [(c.confidence, c.cause in c.truth) for c in every if c.cause]
    gains = [gain for c in cases if c.improvement and (gain := c.improvement["share_of_achievable"]) is not None]
    summary = FolderSummary(
        len(every), sum(c.right for c in every), false.right, false.share, false.ci95,
        by_kind={kind: LabelRates.of((c.right for c in mine), sum(c.below for c in mine),
                                     sum(c.false_name for c in mine), Counter(c.outcome for c in mine),
                                     sum(c.in_class for c in mine))
                 for kind, mine in kinds.items()},
        recall_by_size={}, unknown_on_foreign=None, coverage95=None,
        calibration=[(float(np.mean([s for s, _ in sure])), float(np.mean([r for _, r in sure])), len(sure))]
        if sure else [], share_of_achievable=float(np.median(gains)) if gains else None,
        false_alarms=Share.of(c.false_name for c in alarms), dose=dose_and_response(cases))
    return FolderProof(tuple(every), summary, _power(cases), tuple(sorted(set(judged.verdicts) - set(labels))),
                       tuple(sorted(name for name, label in labels.items()
                                    if name not in judged.verdicts and label.cause != NORMAL)),
                       judged.normal, judged.verdicts)


def dose_and_response(cases: Sequence[FolderScore]) -> Doses:
    """Of cut propellers."""
    cut = [(c, c.size) for c in cases if c.truth[:1] == ("propeller",) and c.cut_mm and c.size]
    return Doses(DoseResponse.of([(sum(c.cut_mm[0]), size.loss_percent[0]) for c, size in cut if len(c.motors) == 1]),
                 DoseResponse.of([(sum(mm), loss) for c, size in cut
                                  for mm, loss in zip(c.cut_mm, size.loss_percent, strict=True)]))


def _power(cases: Sequence[FolderScore]) -> dict[str, LeastSize]:
    found = {}
    for cause in ("propeller", "weight", "mass", "slung"):
        rows = [c.power[cause] for c in cases if cause in c.power]
        sizes = [r["minimum_detectable"] for r in rows if r["minimum_detectable"] is not None]
        if rows:
            found[cause] = LeastSize(float(np.median(sizes)) if sizes else None, rows[0]["unit"])
    return found
