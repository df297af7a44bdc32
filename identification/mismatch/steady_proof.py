"""What a comparison of trims could have seen, and how well its cause predicts flights that were left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.settings import number

from .causes import Body
from .trim import Trim
from .weigh import GROUPS, Normal, hypotheses_of, weigh, weigh_change

SURE = number("mismatch.steady_proof.sure")
"""Probability from which a cause, or a motor, is named."""
TWINS = ({"weight", "slung"}, {"mass", "battery", "weight"})
"""Causes that a trim cannot tell from each other: a load that does not swing, and a weight that sits in the middle."""
POSSIBLE = number("mismatch.steady_proof.possible")
"""Probability below which a twin is not worth its mention."""


def smallest(normal: Normal, sd: Mapping[str, float], body: Body) -> dict[str, dict[str, Any]]:
    """Of each cause the smallest size that would be named, had the flights shown it exactly: thrust lost by motor 1
    [%], a weight under motor 1 [g], a change of the mass [%]."""
    lever = body.motors / np.mean(body.motors**2, axis=0)
    known = hypotheses_of(body)
    under = 1.0 + lever @ body.motors[0]

    def named(cause: str, gains: np.ndarray) -> bool:
        delta = {**{name: np.where(np.isnan(normal.mean[name]), np.nan, 0.0) for name in GROUPS}, "gains": gains}
        chances = weigh_change(delta, sd, normal, body, normal.known_lift, known).by_cause()
        twins = next((t for t in TWINS if cause in t), {cause})
        return sum(chances[c] for c in twins) >= SURE

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
    """Each flight's motors predicted from the normal flights, and from these with what the other flights of its folder
    say of the cause: root mean square error of the thrust asked of a motor [%]. floor: a normal flight's."""
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
