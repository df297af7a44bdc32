"""Many scored cases -> what a proof says: rates with intervals, recall, confusion, coverage, calibration, power."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from .case_kinds import OUTCOMES
from .effects import SIZES

Scored = Mapping[str, Any]

STATED = (0.0, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Edges of the groups of stated confidence."""
ALONE = ("single", "twin")
"""Kinds with one effect in all flights: recall by size and power are of these."""


def share(right: int, n: int) -> dict[str, Any]:
    """{n, right, share, ci95}: exact binomial interval (Clopper and Pearson 1934); None for no case at all."""
    if not n:
        return {"n": 0, "right": 0, "share": None, "ci95": None}
    ends = binomtest(int(right), n).proportion_ci(0.95, method="exact")
    return {"n": n, "right": int(right), "share": right / n, "ci95": [float(ends.low), float(ends.high)]}


def summarise(cases: Sequence[Scored]) -> dict[str, Any]:
    """``summary`` of prove.json from entries of ``score.score_case``.

    false_names: cases with a false name, false_name_rate with ci95 over all cases; recall_by_size: share of single
    effects (singles and twins) named, of small ones also those rightly below the stated detectable size;
    unknown_on_foreign; coverage95: share of 95 % intervals that hold the true value; calibration: [stated confidence,
    share of findings that are right, findings]; share_of_achievable: median over rightly named cases. ``details`` holds
    n and interval of each; confusion: {what was there: {what was said: how often}}.
    """
    false = share(sum(c["false_name"] for c in cases), len(cases))
    foreign = [c for c in cases if c["foreign"]]
    unknown = share(sum(c["right"] for c in foreign), len(foreign))
    intervals = [entry for c in cases for entry in c["intervals"]]
    covered = share(sum(entry["covered"] for entry in intervals), len(intervals))
    recall = {size: _recall([e for c in cases if c["kind"] in ALONE for e in c["effects"] if e["size"] == size])
              for size in SIZES}
    gained = _achieved(cases)
    return {
        "cases": len(cases), "right": sum(c["right"] for c in cases), "false_names": false["right"],
        "false_name_rate": false["share"], "ci95": false["ci95"],
        "recall_by_size": {size: found["share"] for size, found in recall.items()},
        "unknown_on_foreign": unknown["share"], "coverage95": covered["share"], "calibration": calibration(cases),
        "share_of_achievable": gained["median"], "by_kind": _by_kind(cases), "by_engine": _by_engine(cases),
        "pairs": _pairs(cases), "confusion": confusion(cases), "abstained": _abstained(cases),
        "classes": _classes(cases), "parameter_error": _parameter_error(intervals),
        "run_time_s": _spread([c["elapsed_s"] for c in cases]),
        "details": {"recall_by_size": recall, "unknown_on_foreign": unknown, "coverage95": covered,
                    "false_name_rate": false, "share_of_achievable": gained}}


def _recall(effects: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """``share`` of effects named, or small and rightly below what could be seen; both also apart."""
    quiet = sum(e["size"] == "small" and e["below_power"] for e in effects)
    named = sum(e["named"] for e in effects)
    return {**share(named + quiet, len(effects)), "named": named, "below_power": quiet}


def _by_kind(cases: Sequence[Scored]) -> dict[str, Any]:
    found = {}
    for kind in dict.fromkeys([*OUTCOMES, *(c["kind"] for c in cases)]):
        mine = [c for c in cases if c["kind"] == kind]
        if mine:
            found[kind] = {**share(sum(c["right"] for c in mine), len(mine)),
                           "false_names": share(sum(c["false_name"] for c in mine), len(mine)),
                           "outcomes": dict(Counter(c["outcome"] for c in mine))}
            for what in ("flights_right", "fault_right"):
                if judged := [c[what] for c in mine if c[what] is not None]:
                    found[kind][what] = share(sum(judged), len(judged))
    return found


def _by_engine(cases: Sequence[Scored]) -> dict[str, Any]:
    found = {}
    for engine in dict.fromkeys(c["engine"] for c in cases if c["engine"]):
        mine = [c for c in cases if c["engine"] == engine]
        found[engine] = {**share(sum(c["right"] for c in mine), len(mine)),
                         "false_names": share(sum(c["false_name"] for c in mine), len(mine))}
    return found


def _pairs(cases: Sequence[Scored]) -> dict[str, Any]:
    """How many of two effects were named."""
    counts = [sum(e["named"] for e in c["effects"]) for c in cases if len(c["effects"]) == 2]
    return {"both": share(counts.count(2), len(counts)), "one": counts.count(1), "none": counts.count(0)}


def confusion(cases: Sequence[Scored]) -> dict[str, dict[str, int]]:
    """{what was there: {what was said: count}}. Rows: terms, ``nothing``, ``fault KIND``, ``foreign NAME``. Columns:
    terms named, else the outcome. A missed effect is said to be what a false finding of its case says, if there is
    one; false findings beyond that stand in the row ``nothing``."""
    table: dict[str, Counter[str]] = {}

    def count(there: str, said: str) -> None:
        table.setdefault(there, Counter())[said] += 1

    for case in cases:
        false = [f["term"] for f in case["findings"] if not f["right"]]
        silence = "none" if case["outcome"] == "named" else case["outcome"]
        for effect in case["effects"]:
            count(effect["term"], effect["by"] or (false.pop(0) if false else silence))
        others = [f"foreign {name}" for name in case["foreign"]]
        if case["kind"] == "fault":
            others += [f"fault {name}" for name in case["truth"]]
        for there in others or ([] if case["effects"] else ["nothing"]):
            count(there, false.pop(0) if false else silence)
        for said in false:
            count("nothing", said)
    return {there: dict(said.most_common()) for there, said in sorted(table.items())}


def _abstained(cases: Sequence[Scored]) -> dict[str, Any]:
    """Cases with something in the vocabulary to be named where the verdict is that it cannot tell."""
    mine = [c for c in cases if c["effects"]]
    return share(sum(c["outcome"] in ("unknown", "insufficient") for c in mine), len(mine))


def _classes(cases: Sequence[Scored]) -> dict[str, Any]:
    """How sharp right names are: share that is the true term itself, and the mean number of terms in a class."""
    named = [e for c in cases for e in c["effects"] if e["named"]]
    return {"exactly": share(sum(e["exactly"] for e in named), len(named)),
            "mean_size": float(np.mean([e["class_size"] for e in named])) if named else None}


def calibration(cases: Sequence[Scored]) -> list[list[float]]:
    """[mean stated confidence, share of findings that are right, findings] per group of ``STATED``."""
    stated = np.array([f["confidence"] for c in cases for f in c["findings"]], float)
    right = np.array([f["right"] for c in cases for f in c["findings"]], float)
    group = np.clip(np.searchsorted(STATED, stated, side="right") - 1, 0, len(STATED) - 2)
    return [[float(stated[group == g].mean()), float(right[group == g].mean()), int(np.sum(group == g))]
            for g in range(len(STATED) - 1) if (group == g).any()]


def _achieved(cases: Sequence[Scored]) -> dict[str, Any]:
    return _spread([x for c in cases if c["right"] and c["named"]
                    and (x := (c["improvement"] or {}).get("share_of_achievable")) is not None])


def _parameter_error(intervals: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Of each term the median over parameters of |value - true| over the change |true - believed|."""
    found: dict[str, list[float]] = {}
    for entry in intervals:
        change = abs(entry["true"] - (entry["believed"] or 0.0))
        if change > 0.0:
            found.setdefault(entry["parameter"].partition(".")[0], []).append(
                abs(entry["value"] - entry["true"]) / change)
    return {term: {"n": len(errors), "median": float(np.median(errors))} for term, errors in sorted(found.items())}


def _spread(values: Sequence[float]) -> dict[str, Any]:
    x = np.array([v for v in values if v is not None], float)
    if not len(x):
        return {"n": 0, "median": None, "p10": None, "p90": None, "max": None}
    low, middle, high = np.quantile(x, [0.1, 0.5, 0.9])
    return {"n": len(x), "median": float(middle), "p10": float(low), "p90": float(high), "max": float(x.max())}


def power_by_term(cases: Sequence[Scored]) -> dict[str, Any]:
    """``power`` of prove.json: {term: {size: share named of single effects, minimum_detectable: median stated by the
    verdicts of all cases, unit}}."""
    effects = [e for c in cases if c["kind"] in ALONE for e in c["effects"]]
    stated: dict[str, list[Mapping[str, Any]]] = {}
    for case in cases:
        for term, entry in case["power"].items():
            if entry.get("minimum_detectable") is not None:
                stated.setdefault(term, []).append(entry)
    found: dict[str, Any] = {}
    for term in sorted({*stated, *(e["term"] for e in effects)}):
        sizes = {size: [e for e in effects if e["term"] == term and e["size"] == size] for size in SIZES}
        unit, of_unit = _usual_unit(stated.get(term, []))
        found[term] = {**{size: _recall(mine) for size, mine in sizes.items() if mine},
                       "minimum_detectable": float(np.median(of_unit)) if of_unit else None, "unit": unit}
    return found


def _usual_unit(stated: Sequence[Mapping[str, Any]]) -> tuple[str | None, list[float]]:
    """The unit most verdicts state a minimum in, and these minima."""
    if not stated:
        return None, []
    unit = Counter(entry["unit"] for entry in stated).most_common(1)[0][0]
    return unit, [entry["minimum_detectable"] for entry in stated if entry["unit"] == unit]
