"""Data for the plots of a diagnosis by rules."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import lfilter

from .decide import Decision
from .fitting import Slopes
from .left import Left, Residual, Structure
from .moments import Moments
from .naming import LEAST_GAIN
from .proof import Proof
from .standing import PLAIN
from .wrench import Wrench

TAKEN: dict[str, Any] = {
    "axis": ("takes away", "sd²"), "least": LEAST_GAIN, "title": "What each hypothesis takes away alone",
    "note": "Squared standard deviations of the residual, beyond chance; left of the dotted line nothing is named. "
            "More explains more, but the most is a name only if nothing disqualifies it."}


def left_by_rules(moments: Moments, decision: Decision, proof: Proof) -> Left:
    """Residuals, predictions and structure of one decision."""
    named = bool(decision.findings)
    start = Slopes(moments).left(decision.space.model)
    sides = [excess_by_group(moments, side) for side in (start, decision.fit.left if named else start)]
    before = moments.wrench.residual(proof.models[0])
    return Left(moments.wrench, before, _corrected(moments.wrench, decision, proof) if named else before, named,
                floor(moments), proof, scores(decision),
                Structure(sides[0][1], sides[0][0], sides[1][0], PLAIN * len(moments.owner)))


def _corrected(wrench: Wrench, decision: Decision, proof: Proof) -> Residual:
    """Residual of the corrected simulator; a term that differs between flights has a per-flight value."""
    model = proof.models[1]
    own = {name: row for name, row in decision.fit.own.items() if name in model.names}
    force, torque = (part.copy() for part in wrench.residual(model))
    for k, flight in enumerate(np.unique(wrench.flight) if own else ()):
        shared = model.parameters
        here = wrench.residual(model.with_parameters({n: shared[n] + float(row[k]) for n, row in own.items()}))
        for whole, part, at in ((force, here[0], wrench.force_at), (torque, here[1], wrench.torque_at)):
            mine = wrench.flight[at] == flight
            whole[mine] = part[mine]
    return force, torque


def floor(moments: Moments) -> np.ndarray:
    """(6,) RMS of the residual of a right simulator: disturbances and noise that no covariate predicts."""
    impulse = np.zeros(2000)
    impulse[0] = 1.0
    return np.array([c.sd * np.linalg.norm(lfilter([1.0], np.concatenate([[1.0], -c.memory.weights]), impulse))
                     for c in moments.channels])


def excess_by_group(moments: Moments, projection: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """(6, G) squared length of each channel along each group of covariates, above the plain level, and the groups."""
    groups = list(dict.fromkeys(g for c in moments.channels for g in c.groups))
    column = np.array([groups.index(g) for c in moments.channels for g in c.groups])
    squares, many = np.zeros((6, len(groups))), np.zeros((6, len(groups)))
    np.add.at(squares, (moments.owner, column), projection**2)
    np.add.at(many, (moments.owner, column), 1.0)
    return np.maximum(squares - PLAIN * many, 0.0), groups


def scores(decision: Decision) -> dict[str, Any]:
    """How much each hypothesis explains when it is tried first, and its outcome."""
    named = {f.hypothesis.term for f in decision.findings}
    alike = {t for f in decision.findings for t in f.equivalent}
    withdrawn = {t for t, _ in decision.withdrawn}

    def fate(term: str, gain: float) -> str:
        return ("named" if term in named else "withdrawn" if term in withdrawn else "equivalent" if term in alike else
                "rejected" if term in decision.rejected else "small" if gain < LEAST_GAIN else "explained")

    ordered = sorted(decision.scores.items(), key=lambda entry: -entry[1])
    return {**TAKEN, "rows": [{"term": t, "gain": round(g, 1), "fate": fate(t, g)} for t, g in ordered]}
