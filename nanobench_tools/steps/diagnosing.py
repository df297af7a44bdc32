"""Where is a simulator wrong: what ``nanobench diagnose`` and ``nb.diagnose`` are made of."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, MissingExtraError, UsageError
from .options import Options

if TYPE_CHECKING:
    from identification.mismatch.recordings import Recordings
    from identification.mismatch.verdict import Verdict

    from ..flight import Flight
    from ..physics import Model, Vehicle
    from ..physics.adapters.given import Simulator

ENGINES = ("posterior", "rules")
"""Engines of a verdict; the first is the default, and is one of the others, by the recordings."""


@dataclass(frozen=True)
class Judged:
    """The recordings as the diagnosis saw them, the model it believed (None: of a callable), and its verdict."""

    recordings: Recordings
    believed: Model | None
    verdict: Verdict


class Looked:
    """Flights audited and re-timed once; ``at`` looks them over as flights of a vehicle."""

    def __init__(self, options: Options, flights: Sequence[Flight]) -> None:
        self._audits, _ = options.audit(flights)
        self._moved = replace(options, clock="joint").see_on_clock(flights, self._audits)
        self._flights = [flight for flight in flights if flight.name in self._audits]

    def at(self, vehicle: Vehicle, with_battery: bool) -> Recordings:
        """with_battery: whether the simulator needs the battery's voltage."""
        from identification.mismatch.recordings import look_over

        return look_over(self._flights, self._audits, self._moved.flights, self._moved.audits, with_battery, vehicle)


def check_installed() -> None:
    """MissingExtraError where CasADi, which fits of models need, is not installed."""
    if importlib.util.find_spec("casadi") is None:
        raise MissingExtraError("casadi", "identification")


def names_a_file(simulator: str) -> bool:
    """Whether a simulator given as text is a simulator.toml rather than an adapter or ``module:callable``."""
    return Path(simulator).is_file() or (":" not in simulator and (
        Path(simulator).suffix != "" or os.path.sep in simulator))


def check_wiring(recordings: Recordings, model: Model, place: str) -> None:
    """InputError at ``place`` where motor order and spins of the simulator cannot fly, or are not those of the
    flights. Any later step would take that for a wrong inertia or a weak motor."""
    from identification.mismatch.wiring import against_flights
    from identification.mismatch.wrench import Wrench

    check_possible(model, place)
    wrong = None
    if recordings.tracks and recordings.tracks[0].motor.shape[1] == model.rotors:
        wrong = against_flights(Wrench(recordings.tracks), model)
    if wrong is not None:
        raise InputError(f"{place}: vehicle.{wrong.key}", wrong.found, wrong.advice)


def check_possible(model: Model, place: str) -> None:
    """InputError at ``place`` where no vehicle can fly with the simulator's motor order and spins."""
    from identification.mismatch.wiring import impossible

    if (wrong := impossible(model)) is not None:
        raise InputError(f"{place}: vehicle.{wrong.key}", wrong.found, wrong.advice)


def engine_of(name: str) -> Callable[..., Verdict]:
    """What diagnoses, by name: one of ``ENGINES``."""
    from identification.mismatch.diagnosis import diagnose as by_rules
    from identification.mismatch.posterior.posterior_engine import diagnose as by_posterior

    return {"rules": by_rules, "posterior": by_posterior}[name]


def engine_of_flights(name: str) -> Callable[..., dict[str, Any]]:
    """What diagnoses recordings as they were read, by name: one of ``ENGINES``; its verdict as of verdict.json."""
    from identification.mismatch.diagnosis import diagnose_flights as by_rules
    from identification.mismatch.posterior.posterior_engine import diagnose_flights as by_posterior

    return {"rules": by_rules, "posterior": by_posterior}[name]


def against_model(options: Options, recordings: Recordings, model: Model, place: str = "simulator",
                  engine: str = ENGINES[0]) -> Judged:
    """A verdict on a model of terms; recordings: looked at as flights of its vehicle; ``place`` names it in messages.
    InputError where its motors are in another order than those of the flights."""
    check_wiring(recordings, model, place)
    return Judged(recordings, model, engine_of(engine)(recordings, model, seed=options.seed, progress=options.say))


def against_callable(options: Options, flights: Sequence[Flight], simulator: Simulator, name: str,
                     mass_kg: float, engine: str = ENGINES[0]) -> Judged:
    """A verdict on a simulator that is only a callable. Recordings without a battery are judged where it does not look
    at one."""
    from identification.mismatch.diagnosis import diagnose_callable
    from identification.mismatch.equivalent import needs_battery
    from identification.mismatch.track import missing

    from ..physics.vehicle import sized

    vehicle = sized(mass_kg)
    flown = getattr(simulator, "vehicle", None) or vehicle
    looked = Looked(options, flights)
    recordings = looked.at(flown, False)
    unlogged = any("battery" in missing(flight) for flight in flights)
    if unlogged and recordings.tracks and needs_battery(simulator, recordings.tracks[0], name):
        recordings = looked.at(flown, True)
    return Judged(recordings, None, diagnose_callable(recordings, simulator, name, vehicle=vehicle, seed=options.seed,
                                                      progress=options.say, engine=engine_of(engine)))


def beliefs_of(options: Options, flights: Sequence[Flight], simulated: Sequence[Flight], mass_kg: float) -> Model:
    """What the simulator that made the recordings ``simulated`` believes. UsageError where these are real and
    ``flights`` are not."""
    from identification.mismatch.believe import beliefs

    from ..physics.vehicle import sized

    if any(f.provenance.synthetic for f in flights) and not any(f.provenance.synthetic for f in simulated):
        raise UsageError("--simulated holds recordings that are REAL and --data SYNTHETIC ones: are they swapped?")
    vehicle = sized(mass_kg)
    model = beliefs(Looked(options, simulated).at(vehicle, True), vehicle, options.say)
    options.say(f"the simulator believes {', '.join(t.name for t in model.terms)}")
    return model
