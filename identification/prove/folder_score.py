"""Verdicts on folders against their labels: right cause and motors, false names, size found against size done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from .condition_labels import NORMAL, Label
from .folders import LEAVE_ONE_OUT, Judged
from .summary import share

Verdict = Mapping[str, Any]


def score_folder(folder: str, label: Label, verdict: Verdict, stranger: bool) -> dict[str, Any]:
    """The entry of ``cases`` (prove.json) of one folder. right: the label's cause is named, with just its motors where
    both name any; of normal flights, that nothing is. A finding of several causes (``cause`` null) is neither right nor
    false while the label's is among them. stranger: the normal flights are another vehicle's, whose name is right too.
    """
    findings = list(verdict["findings"])
    truth = [c for c in (label.cause, *(["vehicle"] if stranger else [])) if c != NORMAL]
    named = [f["cause"] for f in findings if f["cause"]]
    motors = sorted({m for f in findings if f["cause"] == label.cause for m in f["motors"]})
    motors_right = None if not label.motors or not motors else motors == sorted(label.motors)
    right = any(c in truth for c in named) and motors_right is not False if truth else not findings
    return {"case": folder, "kind": "vehicle" if stranger else label.cause, "truth": truth,
            "motors": list(label.motors), "cut_mm": [list(c) for c in label.cut_mm], "mass_g": label.mass_g,
            "outcome": verdict["outcome"], "named": [f["term"] for f in findings],
            "cause": named[0] if named else None, "causes": [c for f in findings for c in f["causes"]],
            "motors_named": motors, "motors_right": motors_right, "right": bool(right),
            "false_name": any(not set(f["causes"]) & set(truth) for f in findings) or motors_right is False,
            "below": not findings and bool(truth) and _below(label, verdict),
            "size": found_size(label, verdict), "confidence": findings[0]["confidence"] if findings else None,
            "improvement": verdict.get("improvement"), "power": verdict.get("power") or {}, "trim": verdict.get("trim"),
            "paragraph": verdict["paragraph"], "elapsed_s": verdict["elapsed_s"]}


def found_size(label: Label, verdict: Verdict) -> dict[str, Any] | None:
    """{loss_percent per labelled motor, total_percent, sd_percent}: what the trim says at the labelled motors, whether
    anything was named or not."""
    trim = verdict.get("trim")
    if not trim:
        return None
    change = np.array(trim["change_percent"]) / 100.0
    return {"loss_percent": [float(100.0 * -np.expm1(-change[m - 1])) for m in label.motors],
            "total_percent": float(25.0 * np.expm1(change).sum()), "sd_percent": trim["sd_percent"]}


def _below(label: Label, verdict: Verdict) -> bool:
    """Whether what the trim shows of a label that was not named lies below the stated detectable size."""
    size, power = found_size(label, verdict), verdict.get("power") or {}
    least = (power.get("propeller") or {}).get("minimum_detectable")
    if label.cause not in ("propeller", "tape", "weight", "slung") or size is None or least is None:
        return False
    return max([*size["loss_percent"], 0.0]) < least


def score_folders(judged: Judged, labels: Mapping[str, Label], stranger: bool) -> dict[str, Any]:
    """The keys of prove.json of a proof on folders."""
    cases = [score_folder(name, labels[name], verdict, stranger) for name, verdict in judged.verdicts.items()
             if name in labels]
    nothing = Label(NORMAL)
    alarms = [score_folder(LEAVE_ONE_OUT + name, nothing, verdict, False) for name, verdict in judged.alarms.items()]
    every = [*cases, *alarms]
    false = share(sum(c["false_name"] for c in every), len(every))
    kinds = {kind: {**share(sum(c["right"] for c in mine), len(mine)), "below": sum(c["below"] for c in mine),
                    "false_names": sum(c["false_name"] for c in mine),
                    "outcomes": dict(Counter(c["outcome"] for c in mine))}
             for kind in dict.fromkeys(c["kind"] for c in every) if (mine := [c for c in every if c["kind"] == kind])}
    sure = [(c["confidence"], c["cause"] in c["truth"]) for c in every if c["cause"]]
    gains = [c["improvement"]["share_of_achievable"] for c in cases if c["improvement"] and
             c["improvement"]["share_of_achievable"] is not None]
    summary = {"cases": len(every), "right": sum(c["right"] for c in every), "false_names": false["right"],
               "false_name_rate": false["share"], "ci95": false["ci95"], "by_kind": kinds,
               "recall_by_size": {}, "unknown_on_foreign": None, "coverage95": None,
               "calibration": [[float(np.mean([s for s, _ in sure])), float(np.mean([r for _, r in sure])), len(sure)]]
               if sure else [], "share_of_achievable": float(np.median(gains)) if gains else None,
               "false_alarms": share(sum(c["false_name"] for c in alarms), len(alarms)),
               "dose": dose_and_response(cases)}
    return {"cases": every, "summary": summary, "power": _power(cases),
            "unlabelled": sorted(set(judged.verdicts) - set(labels)),
            "without_folder": sorted(name for name, label in labels.items()
                                     if name not in judged.verdicts and label.cause != NORMAL),
            "normal": list(judged.normal)}


def dose_and_response(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Millimetres cut off both blades against thrust lost at that motor [%], folders with one motor cut; all motors
    beside it. spearman None below three doses."""
    single = [(sum(c["cut_mm"][0]), c["size"]["loss_percent"][0]) for c in cases
              if c["truth"][:1] == ["propeller"] and len(c["motors"]) == 1 and c["cut_mm"] and c["size"]]
    every = [(sum(cut), loss) for c in cases if c["truth"][:1] == ["propeller"] and c["cut_mm"] and c["size"]
             for cut, loss in zip(c["cut_mm"], c["size"]["loss_percent"], strict=True)]
    return {"one_motor": _spearman(single), "all_motors": _spearman(every)}


def _spearman(pairs: Sequence[tuple[float, float]]) -> dict[str, Any]:
    doses, sizes = [d for d, _ in pairs], [s for _, s in pairs]
    known = len(set(doses)) >= 3
    return {"n": len(pairs), "cut_mm": doses, "loss_percent": sizes,
            "spearman": float(spearmanr(doses, sizes).statistic) if known else None}


def _power(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Median over folders of the smallest size that would have been named."""
    found: dict[str, dict[str, Any]] = {}
    for cause in ("propeller", "weight", "mass", "slung"):
        rows = [c["power"][cause] for c in cases if cause in c["power"]]
        sizes = [r["minimum_detectable"] for r in rows if r["minimum_detectable"] is not None]
        if rows:
            found[cause] = {"minimum_detectable": float(np.median(sizes)) if sizes else None, "unit": rows[0]["unit"]}
    return found
