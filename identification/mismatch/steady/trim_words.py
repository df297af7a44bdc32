"""Text of a comparison of trims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.physics.pendulum import lengths_m
from nanobench_tools.settings import number

from .causes import CAUSES
from .periodic import where_to
from .smallest_swing import say as say_swing
from .trim import Trim
from .weigh import NONE, Normal, Weighed

MOST = number("mismatch.trim_words.most")
ALL = "several motors that changed separately, as on another vehicle"
RATHER = number("mismatch.trim_words.rather")
WORTH = number("mismatch.trim_words.worth")


def unknown_of(found: Weighed, swing: Mapping[str, Any] | None) -> dict[str, Any]:
    chances = sorted(((p, name) for name, p in found.by_cause().items() if name != NONE), reverse=True)
    hint = " or ".join(f"{ALL if name == 'vehicle' else CAUSES[name].short} ({min(p, MOST):.0%})"
                       for p, name in chances[:3] if p >= WORTH)
    if swing is not None:
        hint = (f"periodic, at {swing['frequency_hz']:.2f} Hz, horizontal, {where_to(swing)}, as a load on a string of "
                f"{lengths_m(swing['frequency_hz'], 0.0)[0]:.2f} m would; " + hint)
    size = float(np.abs(found.delta["gains"]).max())
    return {"where": {"axes": ["force z", "torque x", "torque y", "torque z"],
                      "kind": "steady" if swing is None else "periodic", "flights": []},
            "bound_m_s2": size * 9.81 / 4.0, "hint": hint,
            "frequency_hz": None if swing is None else swing["frequency_hz"]}


def _rather(found: Weighed) -> str:
    """Possible causes, where a change is likely and its cause uncertain."""
    chances = sorted(((p, name) for name, p in found.by_cause().items() if name != NONE), reverse=True)[:3]
    at = f", strongest at motor {int(np.argmax(np.abs(found.delta['gains']))) + 1}" if found.known_lift else ""
    return (f" Something may have changed{at}, but no cause is sure: " +
            ", ".join(f"{CAUSES[name].short} {p:.0%}" for p, name in chances) + ".")


def paragraph(outcome: str, findings: Sequence[Mapping[str, Any]], unknown: Mapping[str, Any] | None, found: Weighed,
               trims: Sequence[Trim], normal: Normal, odd: Mapping[str, str], power: Mapping[str, Any],
               improvement: Mapping[str, Any] | None, left_out: Mapping[str, str], least: int) -> str:
    """Cause, place, size, certainty, rejected causes with reasons, and the prediction of left-out flights."""
    change = ", ".join(f"{100 * d:+.1f}" for d in found.delta["gains"])
    usual, count = ("normal", f"{normal.n} normal flights, ") if normal.n else ("the simulator", "")
    seen = (f"Commanded thrust of motors 1 to 4 against {usual}: {change} % (spread of a normal flight "
            f"{100 * normal.sd['gains']:.1f} %, {count}{len(trims)} here).")
    parts: list[str] = []
    for f in findings:
        parts.append(f"{f['sentence']}, with {f['confidence']:.0%} confidence.")
        if len(f["causes"]) > 1:
            parts.append("Flights like these cannot distinguish " + " from ".join(CAUSES[c].short for c in f["causes"])
                         + f". To distinguish them: {f['settle_with']}.")
        parts.append(seen)
        if f["ruled_out"]:
            parts.append("Ruled out: " + "; ".join(r["why"] for r in f["ruled_out"]) + ".")
    if improvement is not None:
        t = improvement["trim"]
        parts.append(f"In a flight left out, the commanded thrust of a motor is predicted to {t['after']:.1f} % "
                     f"instead of {t['before']:.1f} %.")
    loss, load = power.get("propeller", {}), power.get("weight", {})
    limits = ", ".join(f"{words} from {entry['minimum_detectable']:.{d}f} {entry['unit']} on" for words, entry, d in (
        ("one motor's thrust lost", loss, 0), ("a weight under a motor", load, 1))
        if entry.get("minimum_detectable") is not None)
    if outcome == "none":
        rather = _rather(found) if found.of(NONE) < RATHER else ""
        limits = limits or "only changes above 30 %"
        parts.append(f"No change can be shown: {seen}{rather} These flights would show {limits}. Smaller changes "
                     f"would not show (probability of no change {found.of(NONE):.2f}).")
    if outcome == "insufficient":
        parts.append(f"{len(trims)} flight with a trim; {least} are needed to identify a cause. {seen}")
    if unknown is not None:
        parts.append(f"Something changed, but its cause is uncertain: {unknown['hint']}. {seen}")
    if outcome in ("none", "unknown") and (unknown is None or unknown["frequency_hz"] is None):
        parts.append(say_swing(power.get("slung")))
    if not found.known_lift:
        parts.append("Without a measured battery voltage only the shares of the motors count. A weight in the middle, "
                     "or all motors weaker alike, cannot be detected.")
    if np.isnan(found.delta["push"]).all():
        parts.append("Without an attitude wind cannot be detected.")
    elif np.isnan(found.delta["push"]).any():
        parts.append("Without a measured pitch, wind from ahead or behind cannot be detected.")
    for name, why in {**left_out, **odd}.items():
        parts.append(f"{name} is left out: {why}.")
    return " ".join(part for part in parts if part)
