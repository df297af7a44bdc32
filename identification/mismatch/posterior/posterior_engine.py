"""The whole chain of a diagnosis by posterior: columns, evidence, decision, prediction and report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.harness.threads import one_thread
from nanobench_tools.physics import Model
from nanobench_tools.physics.model import find_term
from nanobench_tools.physics.term_words import in_words

from ..diagnosis import open_case, verdict_of_flights
from ..equivalent import Equivalent
from ..headline import good_for, headline
from ..proof import HORIZONS, floor_of
from ..recordings import Recordings
from ..space import space_around
from ..verdict import Verdict, data_faults, improved, not_asked, only_translation
from ..wrench import Wrench
from .background import rms
from .build import Case, build
from .certainty import MATTERS_M_S2, unexplained, unnamed
from .decision import Decision, Finding, decide
from .left_by_posterior import left_by_posterior
from .left_out_flights import Improvement, Predictions, row_of
from .repeats import Repeat, repeat_of
from .strained import strained

STRAINED, WHOLE = "strained", "force"
HALF_SECOND = HORIZONS.index(50)
LAST = 0.9
"""Confidence where a single flight judged itself."""


def diagnose(recordings: Recordings, simulator: Model, *, seed: int = 0,
             progress: Callable[[str], None] | None = None, given: Equivalent | None = None) -> Verdict:
    """As ``identification.mismatch.diagnosis.diagnose``. Its matrices are small: on two threads it takes longer."""
    with one_thread():
        return _diagnose(recordings, simulator, seed, progress, given)


def _diagnose(recordings: Recordings, simulator: Model, seed: int, progress: Callable[[str], None] | None,
              given: Equivalent | None) -> Verdict:
    start = time.perf_counter()
    say = progress or (lambda text: None)
    opened = open_case(recordings, simulator, start, given)
    if isinstance(opened, Verdict):
        return opened
    simulator, wrench = opened
    say("residual along the measured states, and evidence of all sets of effects")
    case, predictions = weighed(recordings, wrench, simulator, seed)
    say("prediction of flights that were left out")

    def again(corrected: Model) -> list[frozenset[str]]:
        beside, ahead = weighed(recordings, wrench, corrected, seed)
        return [frozenset((f.term, *f.equivalent)) for f in decide(beside, ahead.judge, ahead.worse).findings]

    decision = decide(case, predictions.judge, predictions.worse, again)
    improvement = predictions.improvement(decision.found)
    repeat = repeat_of(case, decision.found)
    body = body_of(case, decision, improvement, repeat, recordings, floor_of(simulator, recordings.tracks, seed))
    body["elapsed_s"] = time.perf_counter() - start
    return Verdict(body, decision.corrected, partial(left_by_posterior, case, decision, improvement))


def diagnose_flights(flights: Sequence[Flight], simulator: Model, *, seed: int = 0,
                     progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """As ``identification.mismatch.diagnosis.diagnose_flights``."""
    return verdict_of_flights(diagnose, flights, simulator, seed=seed, progress=progress)


def weighed(recordings: Recordings, wrench: Wrench, simulator: Model, seed: int) -> tuple[Case, Predictions]:
    """All columns around a simulator with the evidence of all sets of effects, and the predictions of left-out
    flights."""
    case = build(wrench, space_around(simulator, wrench.unasked), simulator)
    case.evidence.learn()
    case.evidence.weigh()
    return case, Predictions(case, recordings.names, seed)


def verdict_body(recordings: Recordings, simulator: Model, seed: int = 0) -> dict[str, Any]:
    """``diagnose`` as a dictionary, for the test bed of wrong simulators."""
    return diagnose(recordings, simulator, seed=seed).to_json()


def body_of(case: Case, decision: Decision, improvement: Improvement, repeat: Repeat, recordings: Recordings,
            floor: np.ndarray) -> dict[str, Any]:
    """verdict.json without what belongs to the file around it."""
    left = unexplained(case, decision.found) | {STRAINED: float(rms(strained(case, decision.found)[0])),
                                                WHOLE: unnamed(case, decision.found)[0]}
    findings = [_entry(f, recordings) for f in decision.findings]
    path_m = row_of(improvement.after, HALF_SECOND)["position_m"]
    unknown = _unknown(decision, left, repeat if path_m and repeat.matters(path_m) else None, recordings)
    outcome = "named" if findings else "unknown" if unknown else "data_fault" if recordings.forbidding else "none"
    body: dict[str, Any] = {
        "outcome": outcome, "findings": findings, "unknown": unknown,
        "data_faults": data_faults(recordings), "power": power(case),
        "improvement": {**{str(h): {"before": row_of(improvement.before, k), "after": row_of(improvement.after, k),
                                    "floor": row_of(floor[None], k),
                                    "relative_ci95": list(improvement.ci95[h]) if h in improvement.ci95 else None}
                           for k, h in enumerate(HORIZONS)},
                        "share_of_achievable": None,
                        "held_out": list(improvement.flights) if improvement.held_out else []},
        "withdrawn": [], "not_named": [{"term": t, "why": w} for t, w in decision.rejected.items()],
        "levels": {}, "not_asked": not_asked(case.wrench),
        "leaning": dict(decision.leaning), "discrepancy_m_s2": left,
        "tracked_point_m": (case.tracked_m + (0.0 if recordings.arm is None else recordings.arm.r_m)).tolist(),
        "tracked_point_sd_m": case.tracked_sd_m.tolist(),
        "repeats": {"group": repeat.group, "share": repeat.share, "size_m_s2": repeat.size_m_s2,
                    "taken_m_s2": repeat.taken_m_s2},
        "corrected_simulator": None, "elapsed_s": 0.0, "engine": "posterior"}
    body["paragraph"] = _paragraph(body, recordings, improvement)
    body["good_for"] = good_for(body["improvement"])
    body["good_for_corrected"] = good_for(body["improvement"], "after") if findings else None
    body["headline"] = headline(body)
    return body


def _unknown(decision: Decision, left: Mapping[str, float], repeat: Repeat | None,
             recordings: Recordings) -> dict[str, Any] | None:
    """Physics that is there and is not identified: effects of too many kinds, else a force that no effect explains. It
    counts if it is large, if it repeats, or if it hides an effect."""
    flights, size = list(recordings.names), float(np.hypot(left[WHOLE], left[STRAINED]))
    if decision.left_open:
        axes = dict.fromkeys(axis for f in decision.left_open for axis in f.axes)
        between = [[f.term, *f.equivalent] for f in decision.left_open]
        return {"where": {"axes": list(axes), "kind": "effects", "flights": flights},
                "bound_m_s2": 2.0 * max(f.size_m_s2 for f in decision.left_open), "between": between,
                "hint": "; ".join(f"{' or '.join(map(in_words, terms))} ({f.size_m_s2:.2f} m/s^2 RMS)"
                                  for terms, f in zip(between, decision.left_open, strict=True))}
    if size <= MATTERS_M_S2 and repeat is None and not decision.hidden:
        return None
    most = repeat.group if repeat else max((g for g in left if g in WORDS), key=lambda g: left[g])
    hint = f"a force that goes with {WORDS[most]}, {size:.2f} m/s^2 RMS"
    hint += "".join(f"; it may hide {in_words(term)}: {why}" for term, why in decision.hidden.items())
    if repeat:
        hint += f"; known from other flights, it explains {100.0 * repeat.share:.0f} % of the slow force"
    return {"where": {"axes": ["force"], "kind": most, "flights": flights}, "bound_m_s2": 2.0 * size, "hint": hint,
            "hides": list(decision.hidden)}


WORDS = {"place": "the place", "air": "the air velocity", "thrust": "the thrust", "lean": "the direction of lean",
         "time": "time alone", "late": "the thrust of the seconds before",
         STRAINED: "errors of logging, or effects, that it only resembles"}


def _entry(finding: Finding, recordings: Recordings) -> dict[str, Any]:
    term = find_term(finding.term)
    single = len({t.flight for t in recordings.tracks}) == 1
    settle = [f"{o}: {term.confused_with[o]}" for o in finding.equivalent if o in term.confused_with]
    return {"term": finding.term, "equivalent": list(finding.equivalent),
            "confidence": min(finding.probability, LAST if single else 1.0),
            "where": {"axes": list(finding.axes), "frame": term.fixed_in, "covariate": None,
                      "flights": list(recordings.names), "regime": "all"},
            "by_flight": {}, "parameters": {n: {"value": s.value, "ci95": list(s.ci95),
                                                "unit": s.unit, "believed": s.believed}
                                            for n, s in finding.sizes.items()},
            "members": {finding.term: finding.probability, **finding.equivalent},
            "force_m_s2": finding.force_m_s2, "torque_rad_s2": finding.torque_rad_s2,
            "residual_share": None, "cause": term.cause, "motors": [], "settle_with": "; ".join(settle) or None}


def power(case: Case) -> dict[str, dict[str, Any]]:
    """Smallest change of each term's best determined parameter that nine of ten such recordings would identify.

    The sum of the change that the term's evidence requires and 1.28 standard deviations.
    """
    evidence = case.evidence
    sd = 1.0 / np.sqrt(np.maximum(np.diag(evidence.rest)[:-1], 1e-12))
    needed = np.sqrt(2.0 * (np.log(9.0) - np.log(0.05))) + 1.28
    found: dict[str, dict[str, Any]] = {}
    for i, effect in enumerate(case.effects):
        for k, column in enumerate(evidence.columns((i,))):
            least = float(needed * sd[column] / evidence.unit[column])
            name = max(effect.moves, key=lambda n: abs(effect.moves[n][k])) if effect.moves else f"{effect.term}.share"
            change = least * (abs(float(effect.moves[name][k])) if effect.moves else 1.0)
            size = least * float(evidence.unit[column])
            if effect.term not in found or size < found[effect.term]["m_s2"]:
                unit = dict(zip(case.space.model.names, case.space.model.units, strict=True)).get(name, "1")
                found[effect.term] = {"minimum_detectable": change, "unit": unit, "parameter": name, "m_s2": size}
    return found


def _after(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _paragraph(body: dict[str, Any], recordings: Recordings, improvement: Improvement) -> str:
    flown = sum(s.duration_s for a in recordings.audits.values() for s in a.airborne)
    parts = [f"{recordings.judged_s:.0f} of {max(flown, recordings.judged_s):.0f} s in the air are judged.",
             *only_translation(body, recordings)]
    for entry in body["findings"]:
        values = ", ".join(f"{n.partition('.')[2]} = {p['value']:.4g}{_after(p['unit'])} (95 %: {p['ci95'][0]:.4g} to "
                           f"{p['ci95'][1]:.4g}; the simulator has {p['believed']:.4g})"
                           for n, p in entry["parameters"].items())
        alike = " or ".join(map(in_words, entry["equivalent"]))
        other = f" Not distinguishable here from {alike}." if alike else ""
        parts.append(f"The simulator is wrong about {in_words(entry['term'])}: {find_term(entry['term']).sentence} "
                     f"{values}. Probability {entry['confidence']:.2f}.{other}")
    if body["leaning"]:
        parts.append("Not sure enough to be identified: " + ", ".join(
            f"{in_words(t)} (probability {p:.2f})" for t, p in body["leaning"].items()) + ".")
    if body["unknown"] and "between" in body["unknown"]:
        parts.append(f"Something is wrong, but these flights do not show which it is: {body['unknown']['hint']}.")
    elif body["unknown"]:
        what = "A part of the residual may be an effect, or physics without a term" if body["unknown"]["hides"] else (
            "No term describes a part of the residual")
        parts.append(f"{what}: {body['unknown']['hint']}.")
    elif not body["findings"]:
        parts.append(f"Nothing is identified. Forces that no effect explains are {body['discrepancy_m_s2'][WHOLE]:.2f} "
                     "m/s^2 RMS.")
    x, y, z = (f"{1e3 * side:.1f} +- {1e3 * sd:.1f}" for side, sd in zip(
        body["tracked_point_m"], body["tracked_point_sd_m"], strict=True))
    parts.append(f"The tracked point lies {x}, {y} and {z} mm (x, y, z; noise alone) from the centre of mass.")
    return " ".join([*parts, *improved(body, improvement.held_out, len(improvement.flights))])


__all__ = ["diagnose", "diagnose_flights", "verdict_body", "weighed"]
