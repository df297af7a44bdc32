"""Result of a diagnosis: outcome, paragraph, findings, unknown structures, detection limits; also as JSON.

The keys of verdict.json are below. Files without a judged row, and comparisons with normal flights, have fewer.

Attributes
----------
outcome : str
    ``named`` (effects identified), ``unknown``, ``none``, ``data_fault`` or ``insufficient``.
headline : str
    The outcome in one sentence.
paragraph : str
    The whole verdict in words.
findings : list
    Identified effects. ``term``; ``equivalent``: indistinguishable ones; ``confidence``: 0 to 1. ``where``: axes, frame
    and flights. ``parameters`` by name: value, ci95, unit, and the simulator's value ``believed``. ``by_flight``:
    per-flight values. ``cause`` and ``motors``: a possible change of the vehicle. ``settle_with``: the flight or
    measurement that distinguishes it from ``equivalent``. ``residual_share``: the share of the residual that it
    explains.
unknown : mapping or null
    A mismatch that is not identified: ``where``, ``bound_m_s2`` (an upper bound of its size, m/s^2) and ``hint``.
leaning : mapping
    Effects that are not sure enough: probability by term.
withdrawn : list
    Effects that were identified first and then rejected: ``term`` and ``why``. Empty with the engine ``posterior``.
not_named : list
    Effects that were fitted and not identified: ``term`` and ``why``.
not_asked : list
    Effects that these flights cannot show: ``term`` and ``why``.
data_faults : list
    Faults of the audit, with flight, kind, stream, span, size, unit and evidence.
power : mapping
    By term: the smallest change that would have been identified (``minimum_detectable``, ``unit``, ``parameter``).
improvement : mapping
    Mean errors of predictions of flights left out, by steps of 10 ms (``1``, ``10``, ``50``). ``before`` and ``after``
    the correction, and the ``floor`` of a right simulator; ``relative_ci95``: interval of the gain. ``held_out``: the
    flights. ``share_of_achievable``: with the engine ``rules``.
good_for, good_for_corrected : mapping or null
    ``hover``, ``mpc`` and ``learning``: ``yes``, ``no`` or ``cannot say``, for the simulator as given and corrected.
levels : mapping
    Per-flight offsets: standard deviation, unit and values. Empty with the engine ``posterior``.
discrepancy_m_s2 : mapping
    RMS of the forces that no effect explains, by what they go with, m/s^2.
tracked_point_m, tracked_point_sd_m : list
    The tracked point from the centre of mass, body x, y, z, and the standard deviation that noise alone gives.
repeats : mapping
    A force that repeats between flights: its group, share and size.
corrected_simulator : str or null
    Path of simulator_corrected.toml.
simulator : mapping
    Of a simulator without terms: how well fitted terms reproduce it.
refit, bound : mapping
    With ``--refit`` and ``--bound``.
engine : str
    ``posterior`` or ``rules``.
elapsed_s : float
    Seconds that the diagnosis took.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.model import find_term
from nanobench_tools.physics.term_words import in_words
from nanobench_tools.physics.vocabulary import vocabulary
from nanobench_tools.results.result import Result
from nanobench_tools.settings import number

from .commanded import WHY, WHY_STILL
from .decide import Decision, Finding
from .fitting import PRIOR_SD, Slopes
from .headline import good_for, headline
from .left import Left
from .left_by_rules import left_by_rules
from .moments import Moments
from .naming import LEAST_GAIN, PER_PARAMETER, started
from .proof import HORIZONS, QUANTITIES, Proof
from .recordings import Recordings
from .space import scales
from .tolerance import smallest
from .wrench import Wrench

NINE_OF_TEN = 1.28
"""Standard deviations above a limit at which nine of ten are above it."""
UNSEEN = 1e-6
"""Squared length that one scale of a parameter explains, below which flights do not show it."""
SIZES = 6
"""Halvings, by ratio, of the range of a parameter that acts far from linearly."""
UNASKED = {
    "mocap": "(position and attitude) the motion of the vehicle is unknown",
    "imu": "(gyro_x, gyro_y, gyro_z) the rotation of the vehicle is unknown: torque, inertia, lag and delay "
           "cannot be checked",
    "command": "(thrust) the input of the simulator is unknown: no term can be evaluated",
    "motor": "(m1, m2 and so on, one a rotor) the input of the simulator is unknown: no term can be evaluated",
    "rpm": "(m1, m2 and so on, one a rotor) the rotor speeds that this simulator takes are unknown: no term can be "
           "evaluated",
    "battery": "(vbat) a simulator with thrust_voltage cannot be evaluated. One with thrust_pwm could be, without a "
               "check whether thrust follows the voltage"}
"""Consequence of each missing stream."""
ODD_SHARE = number("mismatch.verdict.odd_share")


@dataclass(frozen=True, repr=False)
class Verdict(Result):
    """``body``: the content of verdict.json; ``corrected``: the simulator with the identified effects, None without
    any; ``left``: makes the plot data of the page, None if no row was judged; ``reasoned``: input of a refit;
    ``believed``: the model equivalent to a simulator that is only a callable."""

    body: dict[str, Any]
    corrected: Model | None
    left: Callable[[], Left] | None = None
    reasoned: tuple[Moments, Decision, Proof] | None = None
    believed: Model | None = None

    def to_json(self) -> dict[str, Any]:
        return self.body

    @property
    def paragraph(self) -> str:
        found: str = self.body["paragraph"]
        return found

    @classmethod
    def insufficient(cls, recordings: Recordings, simulator: Model, elapsed_s: float) -> Verdict:
        why = "; ".join(f"{name}: {reason}" for name, reason in recordings.left_out.items()) or \
            f"{recordings.judged_s:.1f} s of flight are too little"
        lacks = any(reason.endswith("stream") for reason in recordings.left_out.values())
        asks = [f"Without {name} {what}." for name, what in UNASKED.items()
                if any(reason.endswith("stream") and name in reason for reason in recordings.left_out.values())]
        outcome = "data_fault" if recordings.forbidding and not lacks else "insufficient"
        text = " ".join([f"No conclusion about physics: {why}.", *asks])
        if outcome == "data_fault":
            text = f"The data are at fault, and what is left of them is too little. {_faults_text(recordings)} {text}"
        return cls({"outcome": outcome, "paragraph": text, "findings": [], "unknown": None,
                    "data_faults": data_faults(recordings), "power": {}, "improvement": None,
                    "corrected_simulator": None, "elapsed_s": elapsed_s}, None)

    @classmethod
    def another_vehicle(cls, recordings: Recordings, ratio: float, elapsed_s: float) -> Verdict:
        """The simulator is too wrong for a finer answer."""
        text = (f"The simulator is of another vehicle: its thrust over mass is {ratio:.2g} times that of these "
                "flights. Check mass_kg and the thrust term, and their units. Smaller errors were not searched.")
        return cls({"outcome": "insufficient", "paragraph": text, "findings": [], "unknown": None,
                    "data_faults": data_faults(recordings), "power": {}, "improvement": None,
                    "corrected_simulator": None, "elapsed_s": elapsed_s, "thrust_ratio": ratio}, None)

    @classmethod
    def of(cls, recordings: Recordings, simulator: Model, moments: Moments, decision: Decision, proof: Proof,
           elapsed_s: float) -> Verdict:
        named = bool(decision.findings)
        findings = [_finding(f, decision, recordings) for f in decision.findings]
        unknown = None
        if decision.unknown:
            first = decision.unknown[0]
            unknown = {"where": {"axes": list(first.axes), "kind": first.kind,
                                 "flights": [recordings.names[i] for i in first.flights]},
                       "bound_m_s2": 2.0 * first.size_m_s2 if first.size_m_s2 else None, "hint": first.hint}
        improvement = {str(h): {"before": _row(proof.before, k), "after": _row(proof.after, k),
                                "floor": _row(proof.floor[None], k) if proof.floor is not None else None,
                                "relative_ci95": list(proof.interval[h]) if h in proof.interval else None}
                       for k, h in enumerate(HORIZONS)}
        body: dict[str, Any] = {"outcome": decision.outcome, "findings": findings, "unknown": unknown,
                "data_faults": data_faults(recordings), "power": power(moments, decision),
                "improvement": {**improvement, "share_of_achievable": proof.share_of_achievable,
                                "held_out": list(proof.flights) if proof.held_out else []},
                "withdrawn": [{"term": t, "why": w} for t, w in decision.withdrawn],
                "not_named": [{"term": t, "why": w} for t, w in decision.rejected.items()],
                "levels": levels(moments, decision, recordings),
                "not_asked": not_asked(moments.wrench),
                "corrected_simulator": None, "elapsed_s": elapsed_s, "engine": "rules"}
        body["paragraph"] = paragraph(body, recordings, proof)
        body["good_for"], body["good_for_corrected"] = good_for(body["improvement"]), (
            good_for(body["improvement"], "after") if named else None)
        body["headline"] = headline(body)
        return cls(body, proof.models[1] if named else None, partial(left_by_rules, moments, decision, proof),
                   (moments, decision, proof))


def not_asked(wrench: Wrench) -> list[dict[str, str]]:
    """Terms that these flights, or any flights, cannot show, and why."""
    return [{"term": t, "why": wrench.why_unasked} for t in wrench.unasked] + [
        {"term": t.name, "why": t.not_asked} for t in vocabulary().values()
        if t.not_asked and t.name not in wrench.unasked]


def _row(errors: np.ndarray, k: int) -> dict[str, float | None]:
    return {q: x if np.isfinite(x) else None for q, x in zip(QUANTITIES, errors.mean(axis=0)[k].tolist(), strict=True)}


def _finding(f: Finding, decision: Decision, recordings: Recordings) -> dict[str, Any]:
    term, model = f.hypothesis.term, decision.fit.model
    units = dict(zip(model.names, model.units, strict=True))
    values = model.parameters
    parameters = {name: {"value": values[name], "ci95": [values[name] - 1.96 * sd, values[name] + 1.96 * sd],
                         "unit": units[name], "believed": decision.space.model.parameters[name]}
                  for name, sd in f.sd.items()}
    about = find_term(term)
    settles = about.confused_with
    changed = _changed(f, decision, recordings)
    return {"term": term, "equivalent": list(f.equivalent), "confidence": f.confidence,
            "where": {"axes": list(f.axes), "frame": about.fixed_in, "covariate": f.covariate,
                      "flights": changed or list(recordings.names),
                      "regime": "differs between flights" if f.hypothesis.own else "all"},
            "by_flight": {name: {recordings.names[i]: values[name] + float(x) for i, x in
                                 zip(_numbers(recordings), row, strict=True)}
                          for name, row in decision.fit.own.items() if name.startswith(f"{term}.")},
            "parameters": parameters, "residual_share": f.share, "cause": about.cause, "motors": [],
            "settle_with": "; ".join(f"{o}: {settles[o]}" for o in f.equivalent if o in settles) or None}


def _numbers(recordings: Recordings) -> list[int]:
    return sorted({t.flight for t in recordings.tracks})


def _changed(f: Finding, decision: Decision, recordings: Recordings) -> list[str]:
    """Flights in which a term that differs between flights is not as in most of them."""
    rows = np.array([row for name, row in decision.fit.own.items() if name.startswith(f"{f.hypothesis.term}.")])
    if not len(rows):
        return []
    away = np.linalg.norm(rows - np.median(rows, axis=1, keepdims=True), axis=0)
    odd = away > ODD_SHARE * away.max()
    numbers = _numbers(recordings)
    return [recordings.names[numbers[i]] for i in np.flatnonzero(odd)] if odd.sum() <= len(odd) / 2 else []


def data_faults(recordings: Recordings) -> list[dict[str, Any]]:
    """One entry per fault, in the words of the audit."""
    return [{"flight": name, "kind": f.kind, "stream": f.stream, "columns": list(f.columns), "start_s": f.start_s,
             "end_s": f.end_s, "size": None if not np.isfinite(f.size) else f.size, "unit": f.unit,
             "evidence": f.evidence} for name, f in recordings.faults]


def levels(moments: Moments, decision: Decision, recordings: Recordings) -> dict[str, dict[str, Any]]:
    """Per-flight parameters: their scatter, and the value of each flight in addition to the shared one."""
    if moments.levels is None:
        return {}
    units = dict(zip(moments.levels.model.names, moments.levels.model.units, strict=True))
    names = [recordings.names[i] for i in _numbers(recordings)]
    return {name: {"sd": float(np.std(row, ddof=1)), "unit": units[name],
                   "by_flight": dict(zip(names, row.tolist(), strict=True))}
            for name, row in decision.fit.levels.items()}


def power(moments: Moments, decision: Decision) -> dict[str, dict[str, Any]]:
    """Smallest change of each term's best known parameter that nine of ten such recordings would identify. The
    nuisances of a fit are free (``Slopes.nuisances``)."""
    model, known = decision.space.model, Slopes(moments)
    found = {}
    for term in decision.space.terms:
        free = decision.space.free(term)
        needed = float(np.sqrt(LEAST_GAIN + PER_PARAMETER * len(free))) + NINE_OF_TEN
        feigned = np.array([smallest(model.names[i], decision.fit.model, moments) for i in free])
        begun = started(model, term)
        if begun is None:
            least = _least(known, model, free, needed, feigned)
        else:
            least = np.array([_least_of(known, model, begun, i, needed, f) for i, f in zip(free, feigned, strict=True)])
        best = int(np.argmin(least / scales(model)[free]))
        seen = bool(np.isfinite(least[best]))
        found[term] = {"minimum_detectable": float(least[best]) if seen else None,
                       "unit": model.units[free[best if seen else 0]]}
        if seen:
            found[term]["parameter"] = model.names[free[best]]
    return found


def _least(known: Slopes, model: Model, free: np.ndarray, needed: float, feigned: np.ndarray) -> np.ndarray:
    """Changes (F,) of parameters that explain enough and exceed the noise floor by their standard deviation; inf for
    those that these flights do not show."""
    sizes, columns = scales(model)[free], known.columns(model, free)
    normal = columns.T @ known.cleaned(model, columns)
    strength = np.sqrt(np.maximum(np.diag(normal), 0.0))
    sd = np.sqrt(np.diag(np.linalg.inv(normal + np.eye(len(free)) / PRIOR_SD**2))) * sizes
    gained = np.where(strength > UNSEEN, needed / np.maximum(strength, UNSEEN), np.inf) * sizes
    return np.asarray(np.maximum(gained, np.where(feigned > 0.0, feigned + (2.0 + NINE_OF_TEN) * sd, 0.0)))


def _least_of(known: Slopes, model: Model, begun: Model, which: int, needed: float, feigned: float) -> float:
    """The same for one parameter of a term that is far from linear at rest. Sizes from the noise floor to the bound are
    tried, from the start of its fit (``begun``)."""
    rest, most = float(model.values[which]), float(model.upper[which])

    def enough(change: float) -> bool:
        moved = begun.with_parameters({model.names[which]: rest + change})
        left = known.left(model) - known.left(moved)
        return float(left @ known.cleaned(model, left[:, None])[:, 0]) > needed**2

    low, high = max(feigned, (most - rest) / 2.0**SIZES), most - rest
    if not enough(high):
        return float("inf")
    for _ in range(SIZES):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _faults_text(recordings: Recordings) -> str:
    kinds: dict[str, list[str]] = {}
    for name, f in recordings.forbidding:
        kinds.setdefault(f"{f.kind} in {f.stream or 'all streams'}", []).append(name)
    return "Faults of the data: " + "; ".join(
        f"{what} ({len(set(names))} of {len(recordings.flights)} flights)" for what, names in kinds.items()) + "."


def only_translation(body: Mapping[str, Any], recordings: Recordings) -> list[str]:
    """Sentences on effects that cannot be checked because only forces are compared; empty where moments are, too."""
    first = recordings.tracks[0]
    if first.commanded:
        how = "in N, in equal parts: no thrust map is checked" if first.commanded == "N" else \
            "as a share of full, the same on each"
        terms = ", ".join(in_words(e["term"]) for e in body["not_asked"] if e["why"] == WHY)
        return [f"Only translation was checked: the recordings contain a collective thrust command ({how}) and the "
                f"measured attitude. {terms} {WHY}."]
    if first.forces_only:
        unasked = ", ".join(in_words(e["term"]) for e in body["not_asked"] if e["why"] == WHY_STILL)
        return ["Only translation was checked, along the measured attitude: the simulator gives no angular "
                f"acceleration. {unasked} {WHY_STILL}."]
    return []


def improved(body: Mapping[str, Any], held_out: bool, flights: int) -> list[str]:
    """A sentence on how the prediction of left-out flights changes with what was identified; none without that."""
    if not body["findings"]:
        return []
    before, after = body["improvement"]["50"]["before"], body["improvement"]["50"]["after"]
    own = ", with per-flight values of what differs between flights," if body["levels"] else ""
    goes = "falls" if after["position_m"] <= before["position_m"] else "goes"
    turns = ", the measured attitude given" if after["attitude_rad"] is None else \
        f" and from {before['attitude_rad']:.4f} to {after['attitude_rad']:.4f} rad"
    return [f"On flights left out of the fit{own} the error after half a second {goes} from "
            f"{before['position_m']:.4f} to {after['position_m']:.4f} m{turns}." if held_out else
            "One flight only: the fit was not tested on another." if flights == 1 else
            "Flights differ; each was predicted with a per-flight value, so no flight was held out."]


def paragraph(body: Mapping[str, Any], recordings: Recordings, proof: Proof) -> str:
    """Text of the verdict: effect, place, size, certainty, alternatives, and improvement of the prediction."""
    parts = []
    for entry in body["findings"]:
        term = find_term(entry["term"])
        values = ", ".join(f"{name.partition('.')[2]} = {p['value']:.4g}" + f" {p['unit']}" * (p["unit"] != "1") +
                           f" (95 %: {p['ci95'][0]:.4g} to {p['ci95'][1]:.4g}; the simulator has {p['believed']:.4g})"
                           for name, p in entry["parameters"].items())
        alike = " or ".join(map(in_words, entry["equivalent"]))
        other = f" These flights cannot distinguish it from {alike}." if alike else ""
        settle = f" To distinguish them: {entry['settle_with']}." if entry["settle_with"] else ""
        parts.append(f"The simulator is wrong about {in_words(entry['term'])}: {term.sentence} {values}. It shows in "
                     f"{', '.join(entry['where']['axes'])}, with {entry['confidence']:.0%} confidence.{other}{settle}")
    if body["levels"]:
        parts.append("Flights differ among themselves in " + ", ".join(
            f"{name} (sd {entry['sd']:.2g} {entry['unit']})" for name, entry in body["levels"].items())
            + ". These are fitted per flight; a change common to all flights must exceed their scatter.")
    if recordings.arm is not None:
        x, y, z = 1e3 * recordings.arm.r_m
        parts.append(f"The point that was tracked sits {x:.0f}, {y:.0f}, {z:.0f} mm (x, y, z) off the centre of mass; "
                     "the path of the centre is judged.")
    parts += only_translation(body, recordings)
    if body["outcome"] == "none":
        parts.append(f"No mismatch: {recordings.judged_s:.0f} s of {len(recordings.flights)} flights agree with the "
                     "simulator as well as the logging allows.")
    if body["unknown"]:
        bound = body["unknown"]["bound_m_s2"]
        size = f", up to {bound:.2f} m/s^2" if bound else ""
        parts.append(f"No term describes a part of the residual{size}: {body['unknown']['hint']}.")
    if body["outcome"] == "data_fault":
        parts.append(f"The data are at fault, not the physics. {_faults_text(recordings)}")
    parts += improved(body, proof.held_out, len(proof.flights))
    return " ".join(parts)
