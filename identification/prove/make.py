"""From specs to recordings: flies all flights of many cases at once, logs them, writes what a diagnosis may see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.physics.model import Model
from nanobench_tools.physics.simulator import dumps
from nanobench_tools.practice.flights import EPOCH_S, SECONDS_APART, SEED_SECONDS
from nanobench_tools.practice.flying import Flown, flight_rngs, fly
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.practice.logging_chain import LoggingChain, record
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.timeline import Timeline
from nanobench_tools.practice.vehicle_parameters import Vehicles

from .airframe import Airframe
from .case_kinds import OUTCOMES, CaseSpec, Hidden, forbids
from .effects import EFFECTS
from .effects.body_effects import FrameTilt
from .effects.effect import Parameters
from .engine import Acting, Engine, vehicles_of
from .truth import TrueEffect, TrueFault, TrueParameter, Truth

PLACES = 16
"""Flight j of case i has the random numbers of number 16 i + j of the seed."""
DRAWN_S = 60.0
"""Disturbances are drawn for so long [s]; no flight here lasts 45 s."""
TUMBLED = 0.5
"""Cosine of the tilt [1] below which a flight is called tumbled: nothing that flies here leans by 60 deg."""
AT_ONCE = 120
"""Flights flown in one batch: three times as long as five flights take, for 24 times as many."""


@dataclass(frozen=True)
class Case:
    """``flights`` and ``simulator``: input of a diagnosis. ``corrected``: the simulator with everything that terms can
    describe (of the flights an effect acts in). ``truth``: the reference for the verdict."""

    name: str
    spec: CaseSpec
    flights: list[Flight]
    simulator: Model
    corrected: Model
    truth: Truth


def make_case(spec: CaseSpec) -> Case:
    """One case; the same as out of ``make_cases``, which is faster for many."""
    return make_cases([spec])[0]


def make_cases(specs: Sequence[CaseSpec]) -> list[Case]:
    """Cases in the order of their specs. Flights of one seed and engine fly together, at most AT_ONCE of them."""
    found: dict[int, Case] = {}
    flying = [as_flown(spec) for spec in specs]
    for group in _groups(flying):
        flown = _fly_cases([flying[i] for i in group])
        row = 0
        for i in group:
            made = _case(flying[i], flown, row)
            found[i] = replace(made, spec=specs[i], truth=replace(made.truth, engine_wanted=specs[i].engine))
            row += len(flying[i].flights)
    return [found[i] for i in range(len(specs))]


def _groups(specs: Sequence[CaseSpec]) -> list[list[int]]:
    """Numbers of specs that fly together."""
    groups: list[list[int]] = []
    key, flights = None, 0
    for i in sorted(range(len(specs)), key=lambda i: (specs[i].engine, specs[i].seed, i)):
        spec = specs[i]
        if (spec.engine, spec.seed) != key or flights + len(spec.flights) > AT_ONCE:
            key, flights = (spec.engine, spec.seed), 0
            groups.append([])
        groups[-1].append(i)
        flights += len(spec.flights)
    return groups


def _acts_in(hidden: Hidden, flight: int) -> bool:
    return hidden.flights is None or flight in hidden.flights


def true_airframes(spec: CaseSpec) -> list[Airframe]:
    """The airframe of every flight, with the effects that change it."""
    found = []
    for j in range(len(spec.flights)):
        airframe = spec.airframe
        for hidden in (*spec.known, *spec.concealed):
            if _acts_in(hidden, j):
                airframe = EFFECTS[hidden.effect].change(airframe, hidden.parameters)
        found.append(airframe)
    return found


def effects_of(specs: Sequence[CaseSpec]) -> list[Acting]:
    """All effects with hooks of cases whose flights follow each other in a batch, those of a kind joined."""
    parts: dict[str, list[tuple[int, Parameters]]] = {}
    row = 0
    for spec in specs:
        for j in range(len(spec.flights)):
            for hidden in (*spec.known, *spec.concealed):
                arrays = EFFECTS[hidden.effect].arrays({**hidden.parameters, "flight": j}, spec.airframe)
                if arrays is not None and _acts_in(hidden, j):
                    parts.setdefault(hidden.effect, []).append((row, arrays))
            row += 1
    return [(np.array([row for row, _ in found]), EFFECTS[name].acting([(a, 1) for _, a in found]))
            for name in EFFECTS if (found := parts.get(name))]


def as_flown(spec: CaseSpec) -> CaseSpec:
    """The case as its engine can fly it. Without RotorPy, or if RotorPy cannot fly it, ``practice`` flies it. The
    truth records this (``engine`` and ``engine_wanted``). Raises UsageError for an unknown engine."""
    if spec.engine == "practice":
        return spec
    if spec.engine != "rotorpy":
        raise UsageError(f"unknown engine {spec.engine!r}; known: practice, rotorpy")
    from .engine_rotorpy import on_rotorpy

    converted = on_rotorpy(spec) if find_spec("rotorpy") else None
    return converted or replace(spec, engine="practice")


def _fly_cases(specs: Sequence[CaseSpec]) -> Flown:
    """All flights of the cases, one after the other, with the engine of the first."""
    places = [(spec, j) for spec in specs for j in range(len(spec.flights))]
    airframes = [a for spec in specs for a in true_airframes(spec)]
    numbers = [PLACES * spec.index + j for spec, j in places]
    seed = specs[0].seed
    vehicles = vehicles_of(airframes, [np.random.default_rng([seed, n, 5]) for n in numbers],
                           charge_at_start=[spec.flights[j].charge for spec, j in places],
                           disturbance_m_s2=[spec.nuisance.disturbance_m_s2 for spec, _ in places],
                           thrust_noise=[spec.nuisance.thrust_noise for spec, _ in places])
    effects = effects_of(specs)
    believed = [spec.airframe for spec, _ in places]

    def physics(vehicles: Vehicles, position_m: np.ndarray, yaw_rad: np.ndarray) -> Engine:
        if specs[0].engine == "rotorpy":
            from .engine_rotorpy import RotorPyEngine

            return RotorPyEngine(vehicles, position_m, yaw_rad, airframes, effects, believed)
        return Engine(vehicles, position_m, yaw_rad, airframes, effects)

    return fly(OnboardFleet([spec.flights[j].controller for spec, j in places]),
               [spec.flights[j].path for spec, j in places], vehicles, seed, indices=numbers,
               physics=physics, drawn_s=DRAWN_S, fresh=True)


def _chain(spec: CaseSpec) -> LoggingChain:
    n = spec.nuisance
    tracked = [FrameTilt.tracked(h.parameters) for h in (*spec.known, *spec.concealed) if h.effect == FrameTilt.name]
    return LoggingChain(loss=n.loss, wander_sd_s=n.clock_wander_s, offset_s=n.clock_offset_s,
                        lost_frames=n.lost_frames, battery_period_s=n.battery_period_s,
                        tilt_deg=(0.0, 0.0), tilt_rad=tracked[0] if tracked else None)


def _case(spec: CaseSpec, flown: Flown, row: int) -> Case:
    """The case whose flights are in ``flown`` from ``row`` on."""
    flights: list[Flight] = []
    volts, tumbled = [], []
    chain = _chain(spec)
    turn = so3.conjugate(so3.exp(np.array(spec.nuisance.imu_tilt_rad)))
    for j in range(len(spec.flights)):
        imu = flown.messages["imu"][:, row + j].copy()
        imu[:, :3], imu[:, 3:] = so3.rotate(turn, imu[:, :3]), so3.rotate(turn, imu[:, 3:])
        messages = {name: m[:, row + j:row + j + 1] for name, m in flown.messages.items()} | {"imu": imu[:, None]}
        alone = replace(flown, truth={k: v[:, row + j:row + j + 1] for k, v in flown.truth.items()}, messages=messages,
                        timeline=Timeline([spec.flights[j].path], [flown.timeline.events[row + j]]))
        number = PLACES * spec.index + j
        recorded = record(alone, 0, chain, flight_rngs(spec.seed, number, 9)[6:])
        path = spec.flights[j].path
        metadata = {"trajectory_type": path.family, "trajectory_id": path.trajectory_id, "category": "prove",
                    "repetition": 1, "crazyflie_id": "simulated", "firmware_version": "simulated",
                    "params": dict(path.params), "synthetic": True, "family": path.family, "speed": path.speed,
                    "reference_speed_m_s": float(path.params["speed_mps"]), "duration_s": path.duration_s}
        epoch = EPOCH_S + SEED_SECONDS * (spec.seed % 100) + SECONDS_APART * number + 0.5
        flights.append(Flight(f"flight_{j + 1}", recorded.streams, metadata,
                              Provenance(f"flight_{j + 1}.csv", "", "prove", synthetic=True), epoch_s=epoch))
        airborne = flown.truth["position_m"][:, row + j, 2] > 0.15
        volts.append(flown.truth["battery_V"][airborne, row + j, 0])
        x, y = flown.truth["quaternion"][:, row + j, :2].T
        if (1.0 - 2.0 * (x * x + y * y)).min() < TUMBLED:
            tumbled.append(flights[-1].name)
    simulator, corrected = simulators(spec, float(np.mean(np.concatenate(volts))))
    flights, faults = _with_faults(spec, flights)
    truth = replace(truth_of(spec, simulator, corrected, faults), tumbled=tuple(tumbled))
    return Case(spec.name, spec, flights, simulator, corrected, truth)


def simulators(spec: CaseSpec, mean_V: float) -> tuple[Model, Model]:
    """(what is given, what knows everything that terms can say); mean_V battery voltage in the air."""
    simulator = spec.airframe.model()
    for hidden in spec.known:
        simulator = EFFECTS[hidden.effect].informed(simulator, hidden.parameters, spec.airframe)
    corrected = simulator
    for hidden in spec.concealed:
        corrected = EFFECTS[hidden.effect].informed(corrected, hidden.parameters, spec.airframe)
    for hidden in spec.concealed:
        simulator = EFFECTS[hidden.effect].concealed(simulator, hidden.parameters, mean_V)
    return simulator, corrected


def _with_faults(spec: CaseSpec, flights: list[Flight]) -> tuple[list[Flight], list[TrueFault]]:
    """Flights with the faults of the data in them, and what was done."""
    done = []
    for number, fault in enumerate(spec.faults):
        injection = INJECTIONS[fault.kind]
        for j in fault.flights:
            rng = np.random.default_rng([spec.seed, PLACES * spec.index + j, 11, number])
            given = {} if fault.size is None else {"size": fault.size}
            flights[j], found = injection.function(flights[j], rng, **given, **fault.options)
            done.append(TrueFault(flights[j].name, found.kind, found.stream, found.columns, found.start_s, found.end_s,
                                  found.size, found.unit))
    return flights, done


def truth_of(spec: CaseSpec, simulator: Model, corrected: Model, faults: Sequence[TrueFault]) -> Truth:
    """What the verdict is compared with, as far as the plan and the simulators say it."""
    believed, units = simulator.parameters, dict(zip(corrected.names, corrected.units, strict=True))
    names = tuple(f"flight_{j + 1}" for j in range(len(spec.flights)))
    effects = []
    for hidden in spec.concealed:
        effect = EFFECTS[hidden.effect]
        parameters = {} if effect.foreign else {
            name: TrueParameter(value, units[name], _believed(spec.airframe, believed, name))
            for name, value in corrected.parameters.items() if name.startswith(f"{hidden.effect}.")}
        flights = names if hidden.flights is None else tuple(names[j] for j in hidden.flights)
        effects.append(TrueEffect(hidden.effect, hidden.size, flights, effect.foreign, effect.twins, parameters,
                                  effect.sizes[hidden.size],
                                  {k: v for k, v in hidden.parameters.items() if k != "seed"}))
    n = spec.nuisance
    outcome = OUTCOMES[spec.kind] if spec.kind != "fault" or forbids(faults, names) else "none"
    return Truth(spec.name, spec.kind, tuple(effects), tuple(faults), outcome, spec.engine, spec.note,
                 known=tuple(hidden.effect for hidden in spec.known), corrected=dumps(corrected),
                 nuisance={"disturbance_m_s2": n.disturbance_m_s2, "thrust_noise": n.thrust_noise,
                           "clock_wander_s": n.clock_wander_s, "clock_offset_s": n.clock_offset_s,
                           "battery_period_s": n.battery_period_s, "imu_tilt_rad": list(n.imu_tilt_rad)})


def _believed(airframe: Airframe, believed: dict[str, float], name: str) -> float | None:
    """What the simulator says of a parameter: its term, or for mass and inertia the vehicle's table."""
    if name in believed:
        return believed[name]
    if name == "mass.m":
        return airframe.mass_kg
    if name.startswith("inertia."):
        return airframe.inertia_kg_m2[int(name[-2])]
    return None
