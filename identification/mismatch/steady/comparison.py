"""Diagnosis from the steady trim: flights against normal flights of the same vehicle, from streams that most logs have.

``normal_flights`` describes the normal state, ``compare`` the change: verdict.json with the cause in plain words. A
cause is identified when its probability is at least SURE. Two causes with the same effect on a trim are reported
together. A remainder is "unknown" if "no change" is all but excluded, and otherwise below the detection limit.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import f as fisher

from nanobench_tools.errors import InputError
from nanobench_tools.physics.pendulum import lengths_m
from nanobench_tools.settings import number

from .causes import CAUSES, Body, Hypothesis
from .causes.cause import Sizes
from .known import LOADS, NOTHING, Known
from .periodic import RESOLUTION_HZ, Swing, spectra, swing_of, where_to
from .ruled_out import against
from .smallest_swing import smallest_swing
from .trim import Trim
from .trim_proof import SURE, class_of, held_out, smallest
from .trim_words import ALL, paragraph, unknown_of
from .weigh import NONE, Normal, Weighed, normal_of, quantiles, weigh

TURNED = number("mismatch.comparison.turned")
YAW = np.array([-1.0, 1.0, -1.0, 1.0]) / 2.0
SUREST = number("mismatch.comparison.surest")
ODD = number("mismatch.comparison.odd")
MENTIONED = number("mismatch.comparison.mentioned")
FEWEST = 2
"""Minimum number of normal flights, and of flights of a folder, to identify a cause."""
ASKEW = number("mismatch.comparison.askew")
STRANGE = number("mismatch.comparison.strange")


@dataclass(frozen=True)
class Flights:
    """The normal state. trims: those that count; odd {name: reason}: those that do not; swing: of the normal
    flights."""

    normal: Normal
    trims: tuple[Trim, ...]
    odd: Mapping[str, str]


def normal_flights(trims: Sequence[Trim], body: Body, known: Known = NOTHING) -> Flights:
    """Normal flights that agree with each other. InputError for fewer than FEWEST."""
    if len(trims) < FEWEST:
        raise InputError("normal flights", f"{len(trims)} with a trim", f"{FEWEST} are needed: one has no spread")
    odd = _foreign(trims, Counter(t.commands for t in trims).most_common(1)[0][0])
    kept = [t for t in trims if t.name not in odd]
    if len(kept) < FEWEST:
        raise InputError("normal flights", f"{len(kept)} of {len(trims)} log the same motor commands",
                         f"{FEWEST} are needed: one has no spread")
    while len(kept) > FEWEST + 1:
        against_rest = [weigh([t], normal_of([o for o in kept if o is not t], known.same_day), body).of(NONE)
                        for t in kept]
        worst = int(np.argmin(against_rest))
        if against_rest[worst] >= ODD:
            break
        odd[kept[worst].name] = (f"differs from the other normal flights (probability that nothing changed "
                                 f"{against_rest[worst]:.2f})")
        del kept[worst]
    return Flights(normal_of(kept, known.same_day), tuple(kept), odd)


def compare(trims: Sequence[Trim], flights: Flights, body: Body, *, left_out: Mapping[str, str] | None = None,
            swings: tuple[Sequence[Swing], Sequence[Swing]] = ((), ()), least: int = FEWEST,
            started: float | None = None) -> dict[str, Any]:
    """verdict.json of the flights ``trims``. left_out {recording: why}: without a trim. ``swings``: of them and of the
    normal flights. ``least``: minimum number of flights for an identification."""
    started = time.perf_counter() if started is None else started
    left_out = dict(left_out or {})
    if not trims:
        why = "; ".join(f"{name}: {reason}" for name, reason in left_out.items()) or "no flight"
        return _body("insufficient", f"No conclusion: {why}.", [], None, left_out, flights, {}, None, started)
    normal = flights.normal
    if flights.trims:
        left_out |= _foreign(trims, flights.trims[0].commands)
    trims = [t for t in trims if t.name not in left_out]
    left_out |= _apart(trims, normal)
    trims = [t for t in trims if t.name not in left_out]
    if not trims:
        return compare([], flights, body, left_out=left_out, started=started)
    swing = swing_of(*swings)
    body = replace(body, swing=swing, height_m=float(np.nanmean([t.height_m for t in trims])))
    found = weigh(trims, normal, body)
    findings = _findings(found, normal, body) if len(trims) >= least else []
    for finding in findings:
        finding["where"]["flights"] = [t.name for t in trims]
    nothing = found.of(NONE)
    unknown = None
    if findings:
        outcome = "named"
    elif (nothing < 1.0 - SURE and len(trims) >= least) or swing is not None:
        outcome, unknown = "unknown", unknown_of(found, swing)
    else:
        outcome = "none" if len(trims) >= least else "insufficient"
    power = {**smallest(normal, found.sd, body), "slung": smallest_swing(*swings, body.mass_kg)}
    improvement = held_out(trims, normal, body, findings)
    text = paragraph(outcome, findings, unknown, found, trims, normal, flights.odd, power, improvement, left_out, least)
    verdict = _body(outcome, text, findings, unknown, left_out, flights, power, improvement, started)
    verdict["causes"] = _causes(found)
    verdict["trim"] = _trim_table(trims, flights, found)
    verdict["swing"] = {**spectra(*swings), "found": swing}
    verdict["not_named"] = [{"cause": name, "probability": p} for name, p in
                            sorted(found.by_cause().items(), key=lambda item: -item[1])
                            if name not in {c for f in findings for c in f["causes"]}]
    return verdict


def _foreign(trims: Sequence[Trim], commands: tuple[str, ...]) -> dict[str, str]:
    """Flights whose motor commands are another quantity than those of the normal flights, and why they are left out."""
    return {t.name: f"its motor commands are {', '.join(t.commands)}, those of the normal flights "
                    f"{', '.join(commands)}: a log of other variables" for t in trims if t.commands != commands}


def _apart(trims: Sequence[Trim], normal: Normal) -> dict[str, str]:
    """The one outlier among three or more flights: further from the others than normal flights of different days are
    from each other."""
    if len(trims) < FEWEST + 1:
        return {}
    gains = np.array([t.gains for t in trims])
    n = len(trims)
    away = gains - (gains.sum(axis=0) - gains) / (n - 1)
    away = away if normal.known_lift else away - away.mean(axis=1, keepdims=True)
    scale = normal.sd["gains"] ** 2 * (1.0 + 1.0 / (n - 1)) * 4.0
    chance = n * fisher.sf((away**2).sum(axis=1) / scale, 4, normal.freedom["gains"])
    worst = int(np.argmin(chance))
    if chance[worst] > STRANGE:
        return {}
    why = (f"its trim is not that of the other {n - 1} flights (p = {chance[worst]:.1e}): another log than those, or "
           "something changed in between")
    return {trims[worst].name: why}


def _body(outcome: str, text: str, findings: list[dict[str, Any]], unknown: Any, left_out: Mapping[str, str],
          flights: Flights, power: Mapping[str, Any], improvement: Any, started: float) -> dict[str, Any]:
    faults: list[dict[str, Any]] = [
              {"flight": name, "kind": kind, "stream": "motor", "columns": [], "start_s": None, "end_s": None,
               "size": None, "unit": "", "evidence": reason}
              for kind, reasons in (("no_trim", left_out), ("stands_apart", flights.odd))
              for name, reason in reasons.items()]
    return {"outcome": outcome, "paragraph": text, "findings": findings, "unknown": unknown, "data_faults": faults,
            "power": dict(power), "improvement": improvement, "corrected_simulator": None,
            "elapsed_s": time.perf_counter() - started}


def _findings(found: Weighed, normal: Normal, body: Body) -> list[dict[str, Any]]:
    """The cause that is sure, or those that are sure together (``class_of``)."""
    turned = abs(YAW @ found.delta["gains"]) > TURNED * found.sd["gains"]
    every, found = found, found.without(LOADS - {"mass"}) if turned else found
    named = class_of(found)
    causes, best = set(named), named[0] if named else max(CAUSES, key=found.of)
    if not normal.n and np.isnan(normal.mean["level"]).all() and causes & {"propeller", "tape"}:
        causes |= {"vehicle"}  # a simulator of unknown mounting may be of another one
    elif not causes or (causes == {"vehicle"} and not _askew(found, normal)):
        return []
    together = found.of(*causes)
    motors, h, weights = _best(found, best)
    sizes = {s.name: (*quantiles(s.values, weights), s.unit) for s in h.sizes} if h is not None else {}
    motors = motors or _nearest(h, weights, body)
    cause = CAUSES[best]
    if best == "slung" and body.swing is not None:
        sizes |= _pendulum(body.swing, sizes["mass"][0] / 1e3 / body.mass_kg)
    sentence = _sentence(found, normal, best, {k: v[:3] for k, v in sizes.items()}, motors)
    twins = sorted(causes - {best})
    if best == "slung" and body.swing is not None:
        sentence += f", {where_to(body.swing)}"
    for twin in twins:
        sentence += f"; or, as likely as {found.of(twin):.2f}, {_said(found, normal, twin, body)}"
    return [{"term": cause.term, "equivalent": sorted({t for c in twins if (t := CAUSES[c].term)} - {cause.term}),
             "cause": best if not twins else None, "causes": [best, *twins],
             "confidence": min(together, SUREST),
             "motors": list(motors),
             "where": {"axes": _axes(best), "frame": "per motor" if motors else "body", "covariate": None,
                       "flights": [], "regime": "steady"},
             "parameters": {name: {"value": v[0], "ci95": [v[1], v[2]], "unit": v[3], "believed": 0.0}
                            for name, v in sizes.items()},
             "residual_share": _share(found, h, weights), "sentence": sentence,
             "members": [_member(found, name) for name in [best, *twins]],
             "ruled_out": against(every, best, causes),
             "settle_with": _settle(causes)}]


def _said(found: Weighed, normal: Normal, cause: str, body: Body) -> str:
    """Explanation for the reader if the cause were ``cause``."""
    motors, h, weights = _best(found, cause)
    sizes = {s.name: quantiles(s.values, weights) for s in h.sizes} if h is not None else {}
    sentence = _sentence(found, normal, cause, sizes, motors or _nearest(h, weights, body))
    return sentence[0].lower() + sentence[1:]


def _sentence(found: Weighed, normal: Normal, cause: str, sizes: Sizes, motors: Sequence[int]) -> str:
    """A cause in words. With the angle between thrust and sensors unchanged, another vehicle is only motors that all
    changed."""
    changed = cause == "vehicle" and not _askew(found, normal)
    return ALL[0].upper() + ALL[1:] if changed else CAUSES[cause].say(sizes, motors)


def _causes(found: Weighed) -> list[dict[str, Any]]:
    """Every cause with its motors that is worth a mention, likeliest first: {cause, motors, posterior, dose: {name:
    {value, ci95, unit}}}; ``none``: nothing changed."""
    entries = [{"cause": NONE if h is None else h.cause, "motors": [] if h is None else list(h.motors),
                "posterior": float(p), "dose": _dose(h, weights)}
               for h, p, weights in zip(found.hypotheses, found.probability, found.weights, strict=True)
               if p >= MENTIONED]
    return sorted(entries, key=lambda entry: -entry["posterior"])


def _member(found: Weighed, cause: str) -> dict[str, Any]:
    """One identified cause: {cause, motors that it surely affects, posterior, dose}."""
    motors, h, weights = _best(found, cause)
    return {"cause": cause, "motors": list(motors), "posterior": found.of(cause), "dose": _dose(h, weights)}


def _dose(h: Hypothesis | None, weights: np.ndarray | None) -> dict[str, dict[str, Any]]:
    if h is None or weights is None or len(weights) < 2:
        return {}
    sizes = {s.name: (*quantiles(s.values, weights), s.unit) for s in h.sizes}
    return {name: {"value": v, "ci95": [low, high], "unit": unit} for name, (v, low, high, unit) in sizes.items()}


def _askew(found: Weighed, normal: Normal) -> bool:
    """Whether the angle between thrust and sensors changed. Unequal motors alone do not make another vehicle."""
    away = found.delta["level"][~np.isnan(found.delta["level"])]
    chance = fisher.sf(float(away @ away) / found.sd["level"] ** 2 / max(len(away), 1), max(len(away), 1),
                       normal.freedom["level"])
    return bool(len(away) and chance < ASKEW)


def _pendulum(swing: Mapping[str, Any], mass_share: float) -> dict[str, tuple[float, float, float, str]]:
    """Frequency [Hz] and length of the string [m] of a swing, each with its interval.

    The interval of the length lies between two limits: the controller holds the knot fixed, or the vehicle is free to
    follow.
    """
    f, low, high = (swing["frequency_hz"] + sign * RESOLUTION_HZ for sign in (0.0, -1.0, 1.0))
    ends = lengths_m(f, mass_share)
    return {"frequency": (f, low, high, "Hz"),
            "length": (sum(ends) / 2.0, lengths_m(high, mass_share)[0], lengths_m(low, mass_share)[1], "m")}


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
    """Share of the squared change of the motors' trim that the cause explains."""
    if h is None:
        return None
    left = found.delta["gains"] - weights @ h.gains
    return float(1.0 - (left @ left) / max(found.delta["gains"] @ found.delta["gains"], 1e-12))


def _axes(cause: str) -> list[str]:
    return {"mass": ["force z"], "battery": ["force z"], "wind": ["force x", "force y"]}.get(
        cause, ["force z", "torque x", "torque y", "torque z"] if cause in ("propeller", "tape", "vehicle") else
        ["force z", "torque x", "torque y"])


def _settle(causes: set[str]) -> str | None:
    """How to separate the causes of a class, or to confirm a cause masked by others."""
    ways = []
    if "slung" in causes:
        ways.append("a sideways step higher than a string could be long: only a load on a string swings")
    if "battery" in causes:
        ways.append("flights at another state of charge")
    if len(causes) > 1 and "vehicle" in causes:
        ways.append("--same-vehicle, if you know that")
    if len(causes) > 1 and causes & {"propeller", "tape"}:
        ways.append("a look at the propellers; --nothing-added, if you know that; normal flights of the same day "
                    "(--same-day)")
    if causes & {"battery"} or (len(causes) > 1 and causes & LOADS):
        ways.append("a weighing")
    return "; ".join(ways) or None


def _trim_table(trims: Sequence[Trim], flights: Flights, found: Weighed) -> dict[str, Any]:
    """Data of the plot: change of each motor's commanded thrust [%], its spread, and the values of each flight."""
    normal = flights.normal
    base = normal.mean["gains"]
    return {"motors": [1, 2, 3, 4], "change_percent": (100.0 * found.delta["gains"]).tolist(),
            "sd_percent": 100.0 * found.sd["gains"], "normal_sd_percent": 100.0 * normal.sd["gains"],
            "flights": [{"flight": t.name, "change_percent": (100.0 * (t.gains - base)).tolist(),
                         "battery_V": t.battery_V, "height_m": t.height_m,
                         "course": [[*row[:3], *(100.0 * (np.array(row[3:]) - base)).tolist()] for row in t.course]}
                        for t in trims],
            "normal": list(normal.names),
            "normal_flights": [{"flight": t.name, "change_percent": (100.0 * (t.gains - base)).tolist()}
                               for t in flights.trims],
            "probability": found.by_cause(), "known_lift": found.known_lift,
            "level_m_s2": found.delta["level"].tolist(), "level_sd_m_s2": found.sd["level"]}


