"""Data for the plots of a diagnosis by posterior."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..left import Left
from .build import Case
from .decision import NAMED, Decision
from .left_out_flights import Improvement
from .sizing import parts_of

LEAST = float(np.log(NAMED / (1.0 - NAMED)))
WORTH: dict[str, Any] = {"axis": ("log odds over no effect", "nats"), "least": LEAST,
         "title": "What each effect is worth alone",
         "note": "Log odds of the effect alone against none, from the residual and from predictions of flights left "
                 "out. Right of the dotted line it would be identified, if no other effect explained the same better."}


def left_by_posterior(case: Case, decision: Decision, improvement: Improvement) -> Left:
    """Residuals before and after, predictions, and the worth of each effect."""
    found = decision.found
    before = case.wrench.residual(case.space.model)
    force, torque = case.wrench.residual(found.model)
    for i, part in parts_of(case, found.chosen, found.step):
        if case.effects[i].map_share:  # another thrust map is no parameter of the model
            force, torque = force - case.effects[i].force @ part, torque - case.effects[i].torque @ part
    return Left(case.wrench, before, (force, torque), bool(decision.findings), noise(case, found.chosen, force, torque),
                improvement, worth(case, decision))


def noise(case: Case, chosen: tuple[int, ...], force: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """(6,) RMS, m/s^2 and rad/s^2, of a residual without the errors of the terms and the discrepancy."""
    evidence = case.evidence
    beside = evidence.everything(chosen)
    for i, effect in enumerate(case.effects):
        column = evidence.columns((i,))
        off = beside[column] / evidence.unit[column]
        force, torque = force - effect.force @ off, torque - effect.torque @ off
    force = force - case.background.force @ beside[evidence.P:]
    torque = torque - case.background.torque @ beside[evidence.P:]
    return np.concatenate([np.sqrt((part**2).mean(0)) if len(part) else np.zeros(3) for part in (force, torque)])


def worth(case: Case, decision: Decision) -> Mapping[str, Any]:
    """Log odds of each term alone, and its outcome."""
    named = {f.term for f in decision.findings}
    alike = {t for f in decision.findings for t in f.equivalent}

    def fate(term: str, odds: float) -> str:
        return ("named" if term in named else "equivalent" if term in alike else
                "leaning" if term in decision.leaning else "small" if odds < LEAST else "explained")

    ordered = sorted(decision.alone.items(), key=lambda entry: -entry[1])
    return {**WORTH, "rows": [{"term": t, "gain": round(g, 1), "fate": fate(t, g)} for t, g in ordered]}
