"""Real flights with one piece of knowledge removed from the simulator: does the diagnosis find it?

The simulator is the vehicle that ``nb.fit`` and ``nanobench sysid`` fit to the training flights. Then one of these is
removed: the battery's voltage (the map at one voltage), the vehicle's weight, drag, or motor lag. It is diagnosed on
other flights, together with the complete fit (``control``). No fit is the truth: other identified effects, also in the
control, may really be missing. They are counted as false all the same, since this is unknown.

One more case (``dead log``): flights whose radio log died while the vehicle flew on. Their estimate seems to diverge
by metres. That is a fault of the data, not physics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.mismatch.space import with_other_map
from identification.vehicle.vehicle_fit import fit_vehicle
from nanobench_tools.auditing.faults.kinds import log_ended
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.harness import make_item
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps, loads
from nanobench_tools.protocols.task1 import Case, Split
from nanobench_tools.results.result import Result

from .blind_proof import Diagnose, Run
from .score import CaseScore, Verdict, score_case
from .summary import Summary, TermPower
from .truth import TrueEffect, TrueFault, TrueParameter, Truth

STOCK_KG = 0.0270
"""A bare vehicle of the type, without marker set and deck."""
FLIGHTS = 6
"""Of one case."""


@dataclass(frozen=True)
class Ignorance:
    """kind: its name in tables. term: the missing one (None: complete). twins: as of its truth. simulator (fitted,
    fitted without voltage) -> the diagnosed simulator."""

    kind: str
    term: str | None
    simulator: Callable[[Model, Model], Model]
    twins: tuple[str, ...] = ()


def _heavier(model: Model, mass_kg: float) -> Model:
    """A simulator that believes in another mass; its thrust in N and its inertia stay."""
    return Model(replace(model.vehicle, mass_kg=mass_kg), model.as_dict())


IGNORANCE = (
    Ignorance("control", None, lambda fitted, blind: fitted),
    Ignorance("no voltage", "thrust_voltage", lambda fitted, blind: blind),
    Ignorance("stock mass", "mass", lambda fitted, blind: _heavier(fitted, STOCK_KG), ("thrust_scale",)),
    Ignorance("mass x 0.9", "mass", lambda fitted, blind: _heavier(fitted, 0.9 * fitted.vehicle.mass_kg),
              ("thrust_scale",)),
    Ignorance("no drag", "drag_linear", lambda fitted, blind: fitted.without("drag_linear")),
    Ignorance("no motor lag", "motor_lag", lambda fitted, blind: fitted.without("motor_lag")))


@dataclass(frozen=True)
class RealCase:
    """flights and simulator are what a diagnosis is given."""

    flights: tuple[Flight, ...]
    simulator: Model
    truth: Truth


@dataclass(frozen=True, repr=False)
class RealScore(CaseScore):
    """right: the removed effect is identified; in the control none. ``beside``: additional false
    effects, which the control of the same flights lacks."""

    beside: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class RealProof(Result):
    """prove.json of ``--concealed``; train: names of the flights that made the simulators."""

    cases: tuple[RealScore, ...]
    summary: Summary
    power: Mapping[str, TermPower]
    train: tuple[str, ...]


@dataclass(frozen=True)
class Learnt:
    """A fitted vehicle as TOML, and the median voltage of the flights that it was fitted to."""

    simulator: str
    battery_V: float


def fit_simulators(split: Split, run: Run, seed: int, mass_kg: float) -> tuple[Model, Model]:
    """(fitted to the training flights, the same with thrust from PWM at their median battery voltage)."""
    item = make_item(vehicle_item, {"cases": list(split.train), "seed": seed, "mass_kg": mass_kg}, "fit the vehicle",
                     file=split.train[0].flight.provenance.path)
    found = run([item], "fit the vehicle")
    if not found.values:
        raise InputError(str(found.failed[0]["file"]), f"no simulator can be fitted: {found.failed[0]['error']}")
    learnt = found.values[item.key]
    fitted = loads(learnt.simulator)
    blind = with_other_map(fitted, learnt.battery_V)
    assert blind is not None  # its thrust depends on the voltage
    return fitted, blind


def vehicle_item(cases: Sequence[Case], seed: int, mass_kg: float) -> Learnt:
    """The vehicle of the training flights."""
    volts = np.concatenate([case.flight["battery"]["vbat"] for case in cases])
    return Learnt(dumps(fit_vehicle(cases, Vehicle(mass_kg=mass_kg), seed).model), float(np.nanmedian(volts)))


def real_cases(split: Split, simulators: tuple[Model, Model], n: int, seed: int, first: int = 0) -> list[RealCase]:
    """``n`` cases, numbered from ``first``: every ignorance on one group of FLIGHTS test flights, then on the next."""
    fitted = simulators[0]
    groups = _groups([case.flight for case in split.test], np.random.default_rng([seed, 103]))
    if not groups:
        raise InputError("--concealed", f"{len(split.test)} test flights",
                         f"{FLIGHTS} are needed in addition to those that train")
    found: list[RealCase] = []
    for number, group in enumerate(groups):
        for lack in IGNORANCE:
            names = tuple(f.name for f in group)
            effects = () if lack.term is None else (
                TrueEffect(lack.term, "real", names, twins=lack.twins, parameters=_taken(fitted, lack.term)),)
            truth = Truth(f"real_{first + len(found):03d}", lack.kind, effects,
                          note=f"group {number + 1}: {', '.join(names)}")
            found.append(RealCase(tuple(group), lack.simulator(*simulators), truth))
    return found[:n]


def dead_logs(split: Split, audits: Mapping[str, Audit], simulators: tuple[Model, Model],
              number: int) -> list[RealCase]:
    """The case of the test flights whose log died in the air; none where no log did."""
    found = {case.flight.name: (case.flight, dead) for case in split.test
             if (dead := [f for f in audits[case.flight.name].faults if f.kind in log_ended()])}
    if not found:
        return []
    names = list(found)[:FLIGHTS]
    faults = tuple(TrueFault(name, fault.kind, fault.stream, size=fault.size)
                   for name in names for fault in found[name][1])
    truth = Truth(f"real_{number:03d}", "dead log", faults=faults, note=", ".join(names))
    return [RealCase(tuple(found[name][0] for name in names), simulators[0], truth)]


def _groups(flights: Sequence[Flight], rng: np.random.Generator) -> list[list[Flight]]:
    """Groups of FLIGHTS, drawn, with the families spread over them."""
    many = len(flights) // FLIGHTS
    drawn = [flights[i] for i in rng.permutation(len(flights))]
    dealt = sorted(drawn, key=lambda f: str(f.metadata.get("family")))
    return [dealt[k::many][:FLIGHTS] for k in range(many)]


def _taken(fitted: Model, term: str) -> dict[str, TrueParameter]:
    """What the fit had and the simulator lacks."""
    if term == "mass":
        return {"mass.m": TrueParameter(fitted.vehicle.mass_kg, "kg", None)}
    units = dict(zip(fitted.names, fitted.units, strict=True))
    return {name: TrueParameter(value, units[name], None)
            for name, value in fitted.parameters.items() if name.startswith(f"{term}.")}


def real_item(flights: Sequence[Flight], simulator: Model, seed: int, diagnose: Diagnose) -> Verdict:
    """The verdict on one case."""
    return diagnose(list(flights), simulator, seed=seed)


def diagnose_real(cases: Sequence[RealCase], run: Run, diagnose: Diagnose, seed: int = 0) -> list[RealScore]:
    """Every case diagnosed, and its truth compared with the verdict."""
    items = [make_item(real_item, {"flights": list(c.flights), "simulator": c.simulator, "seed": seed,
                                   "diagnose": diagnose}, f"diagnose {c.truth.case}",
                       file=c.flights[0].provenance.path) for c in cases]
    values = run(items, "diagnose").values
    scored = []
    control: dict[str, list[str]] = {}
    for case, item in zip(cases, items, strict=True):
        if item.key not in values:
            continue
        entry = score_case(case.truth, values[item.key])
        right = entry.right
        if case.truth.faults:
            right = bool(entry.fault_right) and not entry.findings
        elif entry.effects:
            right = all(e.named for e in entry.effects)
        else:
            control[entry.note] = entry.false
        beside = tuple(term for term in entry.false if term not in control.get(entry.note, []))
        scored.append(RealScore(**{**vars(entry), "right": right}, beside=beside))
    return scored
