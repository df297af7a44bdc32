"""Diagnosis from the steady trim: flights against normal flights of the same vehicle, from streams that most logs have.

``normal_flights`` says what is normal, ``compare`` what changed: verdict.json with the cause in a person's words. A
cause is named when it is at least SURE; two that do the same to a trim are named together; what is left over is
"unknown" when nothing having changed is as good as excluded, and otherwise below what these flights can show.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError

from .causes import CAUSES, Body, Hypothesis
from .periodic import Swing, swing_of
from .ruled_out import against
from .trim import Trim
from .weigh import GROUPS, NONE, Normal, Weighed, normal_of, quantiles, weigh, weigh_change

SURE = 0.9
"""Probability from which a cause, or a motor, is named."""
ODD = 0.5
"""A normal flight that is rather changed than not, judged by the others, does not say what is normal."""
FEWEST = 2
"""Normal flights, and flights of a folder, without which nothing is named."""
TWINS = ({"mass", "battery"}, {"weight", "slung"})
"""Causes that a trim cannot tell from each other, whatever their size."""


@dataclass(frozen=True)
class Flights:
    """What is normal. trims: those that count; odd {name: why} of those that do not; swing: of the normal flights."""

    normal: Normal
    trims: tuple[Trim, ...]
    odd: Mapping[str, str]


def normal_flights(trims: Sequence[Trim], body: Body) -> Flights:
    """Normal flights that agree with each other. InputError for fewer than FEWEST."""
    if len(trims) < FEWEST:
        raise InputError("normal flights", f"{len(trims)} with a trim", f"{FEWEST} are needed: one has no spread")
    kept, odd = list(trims), {}
    while len(kept) > FEWEST + 1:
        against_rest = [weigh([t], normal_of([o for o in kept if o is not t]), body).of(NONE) for t in kept]
        worst = int(np.argmin(against_rest))
        if against_rest[worst] >= ODD:
            break
        odd[kept[worst].name] = (f"stands apart from the other normal flights (probability that nothing changed "
                                 f"{against_rest[worst]:.2f})")
        del kept[worst]
    return Flights(normal_of(kept), tuple(kept), odd)


def compare(trims: Sequence[Trim], flights: Flights, body: Body, *, left_out: Mapping[str, str] | None = None,
            swings: tuple[Sequence[Swing], Sequence[Swing]] = ((), ()), least: int = FEWEST,
            started: float | None = None) -> dict[str, Any]:
    """verdict.json of the flights ``trims``; left_out {recording: why} had no trim; swings of them and of the normal
    flights; least: flights without which nothing is named."""
    started = time.perf_counter() if started is None else started
    left_out = dict(left_out or {})
    if not trims:
        why = "; ".join(f"{name}: {reason}" for name, reason in left_out.items()) or "no flight"
        return _body("insufficient", f"Nothing can be said: {why}.", [], None, left_out, flights, {}, None, started)
    normal = flights.normal
    swing = swing_of(*swings)
    body = replace(body, swing=swing, height_m=float(np.nanmean([t.height_m for t in trims])))
    found = weigh(trims, normal, body)
    findings = _findings(found, normal, body) if len(trims) >= least else []
    nothing = found.of(NONE)
    unknown = None
    if findings:
        outcome = "named"
    elif nothing < 1.0 - SURE and len(trims) >= least or swing is not None:
        outcome, unknown = "unknown", _unknown(found, swing)
    else:
        outcome = "none" if len(trims) >= least else "insufficient"
    power = smallest(normal, found.sd, body)
    improvement = held_out(trims, flights, body, findings)
    text = _paragraph(outcome, findings, unknown, found, trims, flights, power, improvement, left_out, least)
    verdict = _body(outcome, text, findings, unknown, left_out, flights, power, improvement, started)
    verdict["trim"] = _trim_table(trims, normal, found)
    verdict["not_named"] = [{"cause": name, "probability": p} for name, p in
                            sorted(found.by_cause().items(), key=lambda item: -item[1])
                            if name not in {c for f in findings for c in f["causes"]}]
    return verdict


def _body(outcome: str, text: str, findings: list, unknown: Any, left_out: Mapping[str, str], flights: Flights,
          power: Mapping[str, Any], improvement: Any, started: float) -> dict[str, Any]:
    faults = [{"flight": name, "kind": "no_trim", "stream": "motor", "columns": [], "start_s": None, "end_s": None,
               "size": None, "unit": "", "evidence": reason} for name, reason in left_out.items()]
    faults += [{"flight": name, "kind": "stands_apart", "stream": "motor", "columns": [], "start_s": None,
                "end_s": None, "size": None, "unit": "", "evidence": reason} for name, reason in flights.odd.items()]
    return {"outcome": outcome, "paragraph": text, "findings": findings, "unknown": unknown, "data_faults": faults,
            "power": dict(power), "improvement": improvement, "corrected_simulator": None,
            "elapsed_s": time.perf_counter() - started}


def _findings(found: Weighed, normal: Normal, body: Body) -> list[dict[str, Any]]:
    """The cause that is sure, or the twins that are sure together; none else."""
    chances = found.by_cause()
    best = max(CAUSES, key=lambda name: chances[name])
    causes = {best}
    if chances[best] < SURE:
        causes = next((t for t in TWINS if best in t and sum(chances[c] for c in t) >= SURE), set())
    if not causes:
        return []
    together = found.of(*causes)
    motors, h, weights = _best(found, best)
    sizes = {s.name: (*quantiles(s.values, weights), s.unit) for s in h.sizes} if h is not None else {}
    motors = motors or _nearest(h, weights, body)
    cause = CAUSES[best]
    sentence = cause.say({k: v[:3] for k, v in sizes.items()}, motors)
    twins = sorted(causes - {best})
    return [{"term": cause.term, "equivalent": sorted({t for c in twins if (t := CAUSES[c].term)} - {cause.term}),
             "cause": best if not twins else None, "causes": [best, *twins], "confidence": together,
             "motors": list(motors),
             "where": {"axes": _axes(best), "frame": "per motor" if motors else "body", "covariate": None,
                       "flights": [], "regime": "steady"},
             "parameters": {name: {"value": v[0], "ci95": [v[1], v[2]], "unit": v[3], "believed": 0.0}
                            for name, v in sizes.items()},
             "residual_share": _share(found, h, weights), "sentence": sentence,
             "ruled_out": against(found, best, causes, normal, body),
             "settle_with": _settle(causes)}]


def _best(found: Weighed, cause: str) -> tuple[tuple[int, ...], Hypothesis | None, np.ndarray]:
    """Motors that are sure, the hypothesis of just these (else the likeliest), and the weights of its draws."""
    mine = [(h, p, w) for h, p, w in zip(found.hypotheses, found.probability, found.weights, strict=True)
            if h is not None and h.cause == cause]
    total = sum(p for _, p, _ in mine)
    motors = tuple(m for m in (1, 2, 3, 4) if sum(p for h, p, _ in mine if m in h.motors) >= SURE * total)
    exact = [entry for entry in mine if entry[0].motors == motors]
    h, _, weights = max(exact or mine, key=lambda entry: entry[1])
    return motors, h if h.sizes else None, np.ones(1) if weights is None else weights


def _nearest(h: Hypothesis | None, weights: np.ndarray, body: Body) -> tuple[int, ...]:
    """The motor in whose quarter a weight surely sits."""
    places = {s.name: s.values for s in h.sizes} if h is not None else {}
    if "x" not in places:
        return ()
    for m, (x, y) in enumerate(body.motors):
        if weights[(places["x"] * x > 0) & (places["y"] * y > 0)].sum() >= SURE:
            return (m + 1,)
    return ()


def _share(found: Weighed, h: Hypothesis | None, weights: np.ndarray) -> float | None:
    """Of the squared change of the motors' trim, what the cause explains."""
    if h is None:
        return None
    left = found.delta["gains"] - weights @ h.gains
    return float(1.0 - (left @ left) / max(found.delta["gains"] @ found.delta["gains"], 1e-12))


def _axes(cause: str) -> list[str]:
    return {"mass": ["force z"], "battery": ["force z"], "wind": ["force x", "force y"]}.get(
        cause, ["force z", "torque x", "torque y", "torque z"] if cause in ("propeller", "tape", "vehicle") else
        ["force z", "torque x", "torque y"])


def _settle(causes: set[str]) -> str | None:
    if "slung" in causes:
        return "a sideways step higher than a string could be long: only a load on a string swings"
    if "battery" in causes:
        return "scales, or flights at another state of charge"
    return None


def _unknown(found: Weighed, swing: Mapping[str, Any] | None) -> dict[str, Any]:
    chances = sorted(((p, name) for name, p in found.by_cause().items() if name != NONE), reverse=True)
    hint = " or ".join(f"{CAUSES[name].short} ({p:.0%})" for p, name in chances[:3] if p >= 0.02)
    if swing is not None:
        hint = (f"a horizontal force that comes and goes at {swing['frequency_hz']:.2f} Hz along "
                f"{swing['direction_deg']:.0f} degrees; " + hint)
    size = float(np.abs(found.delta["gains"]).max())
    return {"where": {"axes": ["force z", "torque x", "torque y", "torque z"],
                      "kind": "steady" if swing is None else "periodic", "flights": []},
            "bound_m_s2": size * 9.81 / 4.0, "hint": hint,
            "frequency_hz": None if swing is None else swing["frequency_hz"]}


def smallest(normal: Normal, sd: Mapping[str, float], body: Body) -> dict[str, dict[str, Any]]:
    """Of each cause the smallest size that would be named, had the flights shown it exactly: thrust lost by motor 1
    [%], a weight under motor 1 [g], a change of the mass [%]."""
    lever = body.motors / np.mean(body.motors**2, axis=0)
    under = 1.0 + lever @ body.motors[0]

    def named(cause: str, gains: np.ndarray) -> bool:
        delta = {**{name: np.where(np.isnan(normal.mean[name]), np.nan, 0.0) for name in GROUPS}, "gains": gains}
        chances = weigh_change(delta, sd, normal, body, normal.known_lift).by_cause()
        twins = next((t for t in TWINS if cause in t), {cause})
        return sum(chances[c] for c in twins) >= SURE

    found = {}
    for cause, unit, factor, change in (
            ("propeller", "%", 100.0, lambda s: -np.log1p(-s) * np.eye(4)[0]),
            ("weight", "g", 1e3 * body.mass_kg, lambda s: np.log(np.maximum(1.0 + s * under, 0.05))),
            ("mass", "%", 100.0, lambda s: np.full(4, np.log1p(s)))):
        low, high = 0.0, 0.3
        if not named(cause, change(high)):
            found[cause] = {"minimum_detectable": None, "unit": unit}
            continue
        for _ in range(6):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if named(cause, change(middle)) else (middle, high)
        found[cause] = {"minimum_detectable": factor * high, "unit": unit}
    return found


def held_out(trims: Sequence[Trim], flights: Flights, body: Body, findings: Sequence[Mapping[str, Any]]
             ) -> dict[str, Any] | None:
    """Each flight's motors predicted from the normal flights, and from these with what the other flights of its folder
    say of the cause: root mean square error of the thrust asked of a motor [%]. floor: a normal flight's."""
    if not findings or len(trims) < 2:
        return None
    names = set(findings[0]["causes"])
    before, after = [], []
    for t in trims:
        others = weigh([o for o in trims if o is not t], flights.normal, body)
        shift = np.zeros(4)
        share = 0.0
        for h, p, w in zip(others.hypotheses, others.probability, others.weights, strict=True):
            if h is not None and h.cause in names:
                shift = shift + p * (others.delta["gains"] if w is None else w @ h.gains)
                share += float(p)
        away = t.gains - flights.normal.mean["gains"]
        before.append(100.0 * float(np.sqrt(np.mean(away**2))))
        after.append(100.0 * float(np.sqrt(np.mean((away - shift / max(share, 1e-9)) ** 2))))
    floor = 100.0 * flights.normal.sd["gains"]
    gain = float(np.mean(before)) - floor
    return {"trim": {"before": float(np.mean(before)), "after": float(np.mean(after)), "floor": floor, "unit": "%"},
            "by_flight": [{"flight": t.name, "before": b, "after": a} for t, b, a in
                          zip(trims, before, after, strict=True)],
            "share_of_achievable": None if gain <= 0.0 else
            min(1.0, (float(np.mean(before)) - float(np.mean(after))) / gain),
            "held_out": [t.name for t in trims]}


def _trim_table(trims: Sequence[Trim], normal: Normal, found: Weighed) -> dict[str, Any]:
    """What the picture shows: change of the thrust asked of each motor [%], its spread, and each flight's."""
    base = normal.mean["gains"]
    return {"motors": [1, 2, 3, 4], "change_percent": (100.0 * found.delta["gains"]).tolist(),
            "sd_percent": 100.0 * found.sd["gains"], "normal_sd_percent": 100.0 * normal.sd["gains"],
            "flights": [{"flight": t.name, "change_percent": (100.0 * (t.gains - base)).tolist(),
                         "battery_V": t.battery_V, "height_m": t.height_m} for t in trims],
            "normal": list(normal.names), "known_lift": found.known_lift,
            "level_m_s2": found.delta["level"].tolist(), "level_sd_m_s2": found.sd["level"]}


def _paragraph(outcome: str, findings: Sequence[Mapping[str, Any]], unknown: Mapping[str, Any] | None, found: Weighed,
               trims: Sequence[Trim], flights: Flights, power: Mapping[str, Any],
               improvement: Mapping[str, Any] | None, left_out: Mapping[str, str], least: int) -> str:
    """What, where, how big, how sure, what it is not and why, what flights left out say."""
    change = ", ".join(f"{100 * d:+.1f}" for d in found.delta["gains"])
    seen = (f"Thrust asked of motors 1 to 4 against normal: {change} % (spread of a normal flight "
            f"{100 * flights.normal.sd['gains']:.1f} %, {flights.normal.n} normal flights, {len(trims)} here).")
    parts: list[str] = []
    for f in findings:
        parts.append(f"{f['sentence']}, with {f['confidence']:.0%} confidence.")
        if len(f["causes"]) > 1:
            parts.append("Flights like these cannot tell " + " from ".join(CAUSES[c].short for c in f["causes"]) +
                         f"; what would: {f['settle_with']}.")
        parts.append(seen)
        if f["ruled_out"]:
            parts.append("Ruled out: " + "; ".join(r["why"] for r in f["ruled_out"]) + ".")
    if improvement is not None:
        t = improvement["trim"]
        parts.append(f"Of a flight left out the thrust asked of a motor is predicted to {t['after']:.1f} % instead of "
                     f"{t['before']:.1f} %.")
    loss, load = power.get("propeller", {}), power.get("weight", {})
    limits = ", ".join(f"{words} from {entry['minimum_detectable']:.{d}f} {entry['unit']} on" for words, entry, d in (
        ("one motor's thrust lost", loss, 0), ("a weight under a motor", load, 1))
        if entry.get("minimum_detectable") is not None)
    if outcome == "none":
        parts.append(f"No change can be shown: {seen} These flights would show {limits or 'nothing smaller than 30 %'}"
                     f"; what is smaller is below what they can show (probability of no change "
                     f"{found.of(NONE):.2f}).")
    if outcome == "insufficient":
        parts.append(f"{len(trims)} flight with a trim, {least} are needed for a name. {seen}")
    if unknown is not None:
        parts.append(f"Something changed, and no single cause is sure: {unknown['hint']}. {seen}")
    if not found.known_lift:
        parts.append("Without a measured battery voltage only the shares of the motors count; a weight in the middle, "
                     "or all motors weaker alike, cannot be asked for.")
    if np.isnan(found.delta["push"]).all():
        parts.append("Without an attitude wind cannot be asked for.")
    elif np.isnan(found.delta["push"]).any():
        parts.append("Without a measured pitch wind from ahead or behind cannot be asked for.")
    for name, why in {**left_out, **flights.odd}.items():
        parts.append(f"{name} is left out: {why}.")
    return " ".join(parts)
