"""Detection limits of a comparison of trims, and how well its cause predicts left-out flights."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.settings import number

from .causes import CAUSES, Body
from .trim import Trim
from .weigh import GROUPS, NONE, Normal, Weighed, hypotheses_of, weigh, weigh_change

SURE = number("mismatch.trim_proof.sure")
ALIKE = number("mismatch.trim_proof.alike")


def class_of(found: Weighed) -> list[str]:
    """The identified causes, most probable first: all that explain the change about as well as the best (ALIKE), if
    their sum is SURE. None if they include no change.

    Two neighbouring propellers and a load between them need the same thrusts. A load that does not swing is a weight. A
    weight in the middle is another mass. One trim shows that it was one of these causes, but not which.
    """
    chances = found.by_cause()
    best: dict[str, float] = {}
    for h, log_likelihood in zip(found.hypotheses, found.log_likelihood, strict=True):
        name = NONE if h is None else h.cause
        best[name] = max(best.get(name, -np.inf), float(log_likelihood))
    first = max(chances, key=lambda name: chances[name])
    alike = {n for n in chances if n == first or best.get(n, -np.inf) > best[first] - ALIKE}
    alike |= {general for n in alike - {NONE} if (general := CAUSES[n].special_of) in chances and general in best}
    named = sorted(alike, key=lambda name: -chances[name])
    sure = sum(chances[n] for n in named) >= SURE
    return named if sure and NONE not in named else []


def smallest(normal: Normal, sd: Mapping[str, float], body: Body) -> dict[str, dict[str, Any]]:
    """Smallest identified size of each cause, if the flights showed it exactly.

    The causes are thrust lost by motor 1 [%], a weight under motor 1 [g] and a change of the mass [%].
    """
    lever = body.motors / np.mean(body.motors**2, axis=0)
    known = hypotheses_of(body)
    under = 1.0 + lever @ body.motors[0]

    def named(cause: str, gains: np.ndarray) -> bool:
        delta = {**{name: np.where(np.isnan(normal.mean[name]), np.nan, 0.0) for name in GROUPS}, "gains": gains}
        return cause in class_of(weigh_change(delta, sd, normal, body, normal.known_lift, known))

    found: dict[str, dict[str, Any]] = {}
    kinds: tuple[tuple[str, str, float, Callable[[float], np.ndarray]], ...] = (
            ("propeller", "%", 100.0, lambda s: -np.log1p(-s) * np.eye(4)[0]),
            ("weight", "g", 1e3 * body.mass_kg, lambda s: np.log(np.maximum(1.0 + s * under, 0.05))),
            ("mass", "%", 100.0, lambda s: np.full(4, np.log1p(s))))
    for cause, unit, factor, change in kinds:
        low, high = 0.0, 0.3
        if not named(cause, change(high)):
            found[cause] = {"minimum_detectable": None, "unit": unit}
            continue
        for _ in range(6):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if named(cause, change(middle)) else (middle, high)
        found[cause] = {"minimum_detectable": factor * high, "unit": unit}
    return found


def held_out(trims: Sequence[Trim], normal: Normal, body: Body, findings: Sequence[Mapping[str, Any]]
             ) -> dict[str, Any] | None:
    """Root mean square error of the predicted thrust command of a motor [%], on flights left out.

    Each flight is predicted from the normal flights alone, and with the cause as estimated from the other flights of
    its folder. ``floor``: the error of a normal flight.
    """
    if not findings or len(trims) < 2:
        return None
    names = set(findings[0]["causes"])
    before, after = [], []
    for t in trims:
        others = weigh([o for o in trims if o is not t], normal, body)
        shift = np.zeros(4)
        share = 0.0
        for h, p, w in zip(others.hypotheses, others.probability, others.weights, strict=True):
            if h is not None and h.cause in names:
                shift = shift + p * (others.delta["gains"] if w is None else w @ h.gains)
                share += float(p)
        away = t.gains - normal.mean["gains"]
        before.append(100.0 * float(np.sqrt(np.mean(away**2))))
        after.append(100.0 * float(np.sqrt(np.mean((away - shift / max(share, 1e-9)) ** 2))))
    floor = 100.0 * normal.sd["gains"]
    gain = float(np.mean(before)) - floor
    return {"trim": {"before": float(np.mean(before)), "after": float(np.mean(after)), "floor": floor, "unit": "%"},
            "by_flight": [{"flight": t.name, "before": b, "after": a} for t, b, a in
                          zip(trims, before, after, strict=True)],
            "share_of_achievable": None if gain <= 0.0 else
            min(1.0, (float(np.mean(before)) - float(np.mean(after))) / gain),
            "held_out": [t.name for t in trims]}
