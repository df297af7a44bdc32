"""Why the other causes are rejected: the size that each would need, and the part of the trim that it does not
explain."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from nanobench_tools.settings import number

from .causes import CAUSES
from .weigh import NONE, Weighed

BALANCES = (("lift", (1, 1, 1, 1)), ("the balance left to right", (-1, -1, 1, 1)),
            ("the balance front to back", (-1, 1, 1, -1)), ("the yaw balance", (-1, 1, -1, 1)))
"""Sums of the commands of motors 1..4, with their signs."""
LEFT = number("mismatch.ruled_out.left")
UNLIKELY = number("mismatch.ruled_out.unlikely")


def against(found: Weighed, best: str, named: Collection[str]) -> list[dict[str, Any]]:
    """Per other cause: {cause, odds, why}; odds of it against the identified one."""
    reasons = []
    for cause in (*CAUSES, NONE):
        if cause in named:
            continue
        odds = found.of(cause) / max(found.of(*named), 1e-300)
        reasons.append({"cause": cause, "odds": odds, "why": _why(found, cause, odds)})
    order = {name: k for k, name in enumerate((NONE, "weight", "propeller", "tape", "vehicle"))}
    return sorted((r for r in reasons if r["cause"] in order and r["cause"] != best), key=lambda r: order[r["cause"]])


def _why(found: Weighed, cause: str, odds: float) -> str:
    words = "no change" if cause == NONE else CAUSES[cause].short
    chance = f"odds 1 to {float(f'{1.0 / odds:.2g}'):,.0f}" if odds > 1e-6 else "odds below one in a million"
    left = found.delta["gains"]
    would = ""
    mine = [(p, h) for h, p in zip(found.hypotheses, found.probability, strict=True)
            if h is not None and h.cause == cause and h.sizes]
    if mine:
        _, h = max(mine, key=lambda entry: entry[0])
        away = found.delta["gains"] - h.gains
        at = int(np.argmin((away**2).sum(axis=1)))
        left = away[at]
        would = ", which would have to be " + ", ".join(
            f"{s.values[at]:.1f} {s.unit}" + (f" ({s.name})" if s.name in "xy" else "") for s in h.sizes)
    if cause == "vehicle":
        return f"{words} ({chance}: its motors and sensors would differ more than these do)"
    sums = {name: float(left @ np.array(signs)) / 4.0 for name, signs in BALANCES}
    worst = max(sums, key=lambda name: abs(sums[name]))
    if abs(sums[worst]) * 2.0 > LEFT * found.sd["gains"]:
        return f"{words}{would} ({chance}: leaves {100 * sums[worst]:+.1f} % in {worst})"
    return f"{words}{would} ({chance}: it has more freedom than the flights require)" if odds < UNLIKELY else \
        f"{words}{would} ({chance})"
