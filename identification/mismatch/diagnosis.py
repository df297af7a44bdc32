"""The whole chain: data, residual, location, identification, model, proof."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.harness.audits import audit_and_clocks_item
from nanobench_tools.harness.clocks import on_clock
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.adapters.given import Simulator
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.settings import setting

from .believe import start_of
from .commanded import believed
from .decide import UNPROVED, UNSURE, Decision, decide, unproved, without
from .equivalent import Equivalent, equivalent, turning_by_motor, turns_nothing
from .fitting import Slopes, fit, slopes
from .leftover import Structure
from .levels import with_levels
from .moments import Moments, moments_of
from .naming import Named, free_of, name_effects
from .proof import Proof, prove, turned_better
from .recordings import LEAST_S, Recordings, look_over
from .space import Space, space_around, space_of_other_map
from .verdict import Verdict, data_faults
from .wiring import gains_against_flights
from .wrench import CHANNELS, Wrench

ANOTHER = setting("mismatch.diagnosis.another")
GAINS = terms_that(lambda term: any(p.implausible is not None for p in term.parameters))
MUCH = setting("mismatch.diagnosis.much")
PASSES = 2
"""Number of times the memory of the residual is learnt: without, then with the identified terms."""
AXIS_SHARE = setting("mismatch.diagnosis.axis_share")


def diagnose(recordings: Recordings, simulator: Model, *, seed: int = 0,
             progress: Callable[[str], None] | None = None, given: Equivalent | None = None) -> Verdict:
    """Errors of ``simulator``, given prepared recordings. ``given``: the callable that it is equivalent to, whose
    residual is then judged."""
    start = time.perf_counter()
    opened = open_case(recordings, simulator, start, given)
    if isinstance(opened, Verdict):
        return opened
    simulator, wrench = opened
    moments, decision, proof = judge(recordings, wrench, simulator, seed, progress or (lambda text: None))
    return Verdict.of(recordings, simulator, moments, decision, proof, time.perf_counter() - start)


def open_case(recordings: Recordings, simulator: Model, start: float,
              given: Equivalent | None = None) -> tuple[Model, Wrench] | Verdict:
    """The simulator as these recordings command it and the wrench along them, or a verdict if no diagnosis is possible.
    ``start``: when the diagnosis began (``time.perf_counter``)."""
    if recordings.judged_s < LEAST_S:
        return Verdict.insufficient(recordings, simulator, time.perf_counter() - start)
    rotors = recordings.tracks[0].motor.shape[1]
    if rotors != simulator.rotors:
        raise InputError(recordings.tracks[0].name, f"has {rotors} motors, and the simulator {simulator.rotors} rotors",
                         "give the simulator.toml of this vehicle")
    simulator = believed(simulator, recordings.tracks[0].commanded)
    wrench = Wrench(recordings.tracks)
    if given is not None:  # its difference from its equivalent is no residual
        wrench.measured = wrench.measured[0] - given.gap[0], wrench.measured[1] - given.gap[1]
    ratio = lift_ratio(wrench, simulator)
    if not 1.0 / ANOTHER < ratio < ANOTHER:
        return Verdict.another_vehicle(recordings, ratio, time.perf_counter() - start)
    return simulator, wrench


def judge(recordings: Recordings, wrench: Wrench, simulator: Model, seed: int = 0,
          say: Callable[[str], None] = lambda text: None) -> tuple[Moments, Decision, Proof]:
    """Identify effects from the residual of ``wrench`` (of these recordings), and prove them on flights left out."""
    space = space_around(simulator, wrench.unasked)
    say("residual along the measured states")
    moments, named = _named(wrench, space, simulator, say)
    say("what is left")
    decision = decide(recordings, moments, space, named)
    if len({t.flight for t in recordings.tracks}) == 1:  # nothing can be held out
        decision = replace(decision, findings=tuple(replace(f, confidence=min(f.confidence, UNSURE))
                                                    for f in decision.findings))
    strange = _no_vehicle(decision)
    if strange is not None and decision.outcome == "none":
        decision = replace(decision, outcome="unknown", unknown=(strange,))
    say("prediction on flights that were left out")
    return (moments, *_proved(moments, decision, simulator, space, seed))


def _proved(moments: Moments, decision: Decision, simulator: Model, space: Space, seed: int) -> tuple[Decision, Proof]:
    """The part of a decision that predicts unseen flights better.

    Tried in this order: all its effects, those that act as a force, one of these, no effect.
    """
    names = [f.hypothesis.term for f in decision.findings]
    turning = [f.hypothesis.term for f in decision.findings if all(axis.startswith("torque") for axis in f.axes)]
    pushing = sorted((f for f in decision.findings if f.hypothesis.term not in turning), key=lambda f: -f.share)
    less = [turning, *([n for n in names if n != f.hypothesis.term] for f in pushing)]
    for k, gone in enumerate([[], *less]):
        if k and (not gone or len(gone) == len(names) or gone in less[:k - 1]):
            continue
        tried = without(moments, decision, gone, UNPROVED) if gone else decision
        try:
            proof = prove(moments, tried, simulator, seed)
            tried, proof = _without_idle(moments, tried, proof, simulator, seed)
        except InputError:  # the identified effects together are no possible vehicle
            continue
        pushes = all(axis.startswith("force") for f in tried.findings for axis in f.axes)
        if proof.better or (pushes and proof.better_pushed(seed)) or (not proof.held_out and not tried.own) or \
                not tried.findings or (tried.own and proof.no_worse):
            return tried, proof
    decision = unproved(moments, decision, space)
    return decision, prove(moments, decision, simulator, seed)


def _without_idle(moments: Moments, decision: Decision, proof: Proof, simulator: Model,
                  seed: int) -> tuple[Decision, Proof]:
    """Among several effects, one that only turns the vehicle stays only if it improves the prediction of rotation.
    Commands from a noisy gyro resemble gains and damping, and improved forces do not support those."""
    turning = [f.hypothesis.term for f in decision.findings if f.axes and all(a.startswith("torque") for a in f.axes)]
    for term in turning if proof.held_out else ():
        if len(decision.findings) < 2:
            break
        lean = without(moments, decision, [term], "turning is predicted no better with it on flights left out")
        bare = prove(moments, lean, simulator, seed)
        if not turned_better(bare.after, proof.after):
            decision, proof = lean, bare
    return decision, proof


def _no_vehicle(decision: Decision) -> Structure | None:
    """Rotation that only another vehicle would explain. It identifies no effect, but the simulator does not agree
    either."""
    why = next((w for t, w in decision.rejected.items() if t in GAINS and w.endswith("no vehicle")), None)
    there = decision.before[3:]
    if why is None or float(there.sum()) < MUCH:
        return None
    axes = tuple(name for name, size in zip(CHANNELS[3:], there, strict=True) if size > AXIS_SHARE * there.sum())
    return Structure("motion", 0.0, float(there.sum()), axes,
                     f"its turning does not fit: {why}; look at inertia_kg_m2, motor_positions_m and their units, and "
                     "whether recordings and simulator are of one vehicle")


def diagnose_callable(recordings: Recordings, simulator: Simulator, place: str, *, vehicle: Vehicle | None = None,
                      seed: int = 0, progress: Callable[[str], None] | None = None,
                      engine: Callable[..., Verdict] = diagnose) -> Verdict:
    """Errors of a simulator that is only a callable (``nanobench_tools.physics.adapters.given``).

    ``place``: its name. ``vehicle``: known properties that it does not state. ``engine``: ``diagnose`` or one like it.
    Raises InputError if it fails, or answers in other units or axes.
    """
    start = time.perf_counter()
    if recordings.judged_s < LEAST_S:
        vehicle = vehicle or Vehicle()
        return Verdict.insufficient(recordings, Model(vehicle, start_of(vehicle)), time.perf_counter() - start)
    if recordings.tracks[0].commanded:
        raise InputError(recordings.tracks[0].name, "holds a collective command and no motor commands",
                         f"{place} is given motors; a simulator.toml can be diagnosed")
    if turns_nothing(simulator, recordings.tracks[0], place):
        recordings = replace(recordings, tracks=tuple(replace(t, turns=False) for t in recordings.tracks))
    given = equivalent(recordings, simulator, place, vehicle, progress)
    wrong = gains_against_flights(Wrench(recordings.tracks), turning_by_motor(simulator, recordings.tracks[0], place))
    if wrong is not None:
        raise InputError(f"{place}: order and signs of its motors", wrong.found, wrong.advice)
    if given.alike:
        verdict = engine(recordings, given.model, seed=seed, progress=progress, given=given)
    else:
        verdict = _unlike(recordings, given)
    verdict.body["paragraph"] = f"{given.sentence} {verdict.paragraph}"
    verdict.body["simulator"] = given.to_json()
    verdict.body["elapsed_s"] = time.perf_counter() - start
    return replace(verdict, believed=given.model)


def _unlike(recordings: Recordings, given: Equivalent) -> Verdict:
    """Verdict on a simulator that no terms reproduce: its residual has a size, but no effect is identified."""
    wrench = Wrench(recordings.tracks)
    force = wrench.measured[0] - wrench.model(given.model)[0] - given.gap[0]
    size = float(np.sqrt(np.mean(np.sum(force**2, axis=1))))
    worst = CHANNELS[int(np.argmax(given.by_channel))]
    hint = f"no model of terms reproduces the simulator's {worst}"
    text = (f"Unknown: the simulator's force differs from these flights by {size:.2f} m/s^2 RMS, noise included. Which "
            "effect that is cannot be checked.")
    return Verdict({"outcome": "unknown", "paragraph": text, "findings": [],
                    "unknown": {"where": {"axes": [worst], "kind": "simulator", "flights": list(recordings.names)},
                                "bound_m_s2": 2.0 * size, "hint": hint},
                    "data_faults": data_faults(recordings), "power": {}, "improvement": None,
                    "corrected_simulator": None, "elapsed_s": 0.0}, None)


def lift_ratio(wrench: Wrench, simulator: Model) -> float:
    """Mean thrust over mass of the simulator, over that of the flights."""
    up = so3.rotate_inverse(wrench.quaternion[wrench.force_at], np.array([0.0, 0.0, simulator.vehicle.gravity_m_s2]))
    return float(np.mean(wrench.model(simulator)[0][:, 2] + up[:, 2]) / np.mean(wrench.measured[0][:, 2] + up[:, 2]))


def _named(wrench: Wrench, space: Space, simulator: Model, say: Callable[[str], None]) -> tuple[Moments, Named]:
    asked = np.concatenate([space.free(t) for t in space.terms])
    names = [space.model.names[i] for i in asked]
    at: Model = space.model
    named: Named | None = None
    other = space_of_other_map(simulator, wrench.battery_V, space.unasked)
    for number in range(PASSES):
        force, _torque = slopes(wrench, space.model, asked)
        moments = with_levels(moments_of(wrench, wrench.residual(at), force, names), space, other)
        found = name_effects(moments, space, simulator, say)
        same = named is not None and [h.term for h in found.accepted] == [h.term for h in named.accepted]
        named, at = found, found.fit.model
        if same or (not found.accepted and number == 0):
            break
    assert named is not None  # PASSES is positive
    return moments, named


def recorded(flights: Sequence[Flight], with_battery: bool = True, vehicle: Vehicle | None = None) -> Recordings:
    """Flights as they were read: audited, and put on the motion capture's clock; see ``look_over``."""
    clock = ("joint", ())  # no logged estimate is judged here
    found = {flight.name: audit_and_clocks_item(flight, [clock]) for flight in flights}
    audits = {name: both.audit for name, both in found.items()}
    moved = on_clock(flights, audits, *clock,
                     known={(name, clock): both.time_offsets[0] for name, both in found.items()})
    return look_over(flights, audits, moved.flights, moved.audits, with_battery, vehicle)


def diagnose_flights(flights: Sequence[Flight], simulator: Model, *, seed: int = 0,
                     progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """``diagnose`` from recordings as they were read: verdict.json without what belongs to the file around it."""
    return verdict_of_flights(diagnose, flights, simulator, seed=seed, progress=progress)


def verdict_of_flights(engine: Callable[..., Verdict], flights: Sequence[Flight], simulator: Model, *, seed: int,
                       progress: Callable[[str], None] | None) -> dict[str, Any]:
    """``diagnose_flights`` by an engine."""
    start = time.perf_counter()
    recordings = recorded(flights, "thrust_voltage" in simulator, simulator.vehicle)
    body = engine(recordings, simulator, seed=seed, progress=progress).to_json()
    return {**body, "elapsed_s": time.perf_counter() - start}


__all__ = ["Decision", "Proof", "Slopes", "diagnose", "diagnose_callable", "diagnose_flights", "fit", "free_of",
           "judge", "open_case", "recorded", "verdict_of_flights"]
