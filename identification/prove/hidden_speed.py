"""Logs with rotor speed, which is hidden: does a simulator without motor lag ask for it back, and for the one measured?

Every other flight makes the simulator (``nanobench motors`` with the speed, then drag along the states). It loses its
lag and is diagnosed on the flights between, without the rotor speed. Their verdict on the lag is compared with their
own rotor speed, which is looked at afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence

from identification.mismatch.believe import fit_along
from identification.mismatch.diagnosis import recorded
from identification.motors.lag import DOWN, UP, fit_lag, windows_of
from identification.motors.motor_study import hover, identify, simulator
from identification.motors.rotor_rows import read_logs
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.harness import make_item
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps, loads

from .blind_proof import Run
from .concealed import RealCase
from .truth import TrueEffect, TrueParameter, Truth

SPEED = "rpm"
BESIDE = ("drag_linear",)
"""What logs of rotor speed do not give a simulator."""
LAG = "motor_lag"


def with_speed(flights: Sequence[Flight]) -> list[Flight]:
    """Those that ``nanobench motors`` can read."""
    names = {log.name for log in read_logs(f for f in flights if SPEED in f)[0]}
    return [f for f in flights if f.name in names]


def speed_cases(flights: Sequence[Flight], mass_kg: float, run: Run, seed: int, number: int) -> list[RealCase]:
    """The control, and the simulator without lag, on every other flight; numbered from ``number``. InputError for one
    flight alone, or flights of different vehicles."""
    train, test = list(flights[::2]), list(flights[1::2])
    if not test:
        raise InputError(flights[0].provenance.path, "one flight with rotor speed", "two are needed")
    item = make_item(simulator_item, {"flights": train, "mass_kg": mass_kg, "seed": seed}, "fit rotor speed",
                     file=train[0].provenance.path)
    result = run([item], "fit rotor speed")
    if not result.values:
        raise InputError(train[0].provenance.path, f"no simulator can be fitted: {result.failed[0]['error']}")
    whole = loads(result.values[item.key]["simulator"])
    blind = tuple(f.without_streams(SPEED) for f in test)
    lag = {name: TrueParameter(value, "s", None) for name, value in measured_lag(test, mass_kg).items()}
    note = "rotor speed hidden: " + ", ".join(f.name for f in test)
    effect = TrueEffect(LAG, "real", tuple(f.name for f in test), parameters=lag)
    lacks: tuple[tuple[str, Model, tuple[TrueEffect, ...]], ...] = (
        ("control, rotor speed hidden", whole, ()), ("no motor lag, rotor speed hidden", whole.without(LAG), (effect,)))
    return [RealCase(blind, model, Truth(f"real_{number + k:03d}", kind, effects, note=note))
            for k, (kind, model, effects) in enumerate(lacks)]


def simulator_item(flights: Sequence[Flight], mass_kg: float, seed: int) -> dict[str, str]:
    """{simulator: text of its TOML}."""
    found = simulator(identify(flights, mass_kg=mass_kg, seed=seed))
    return {"simulator": dumps(fit_along(recorded(flights), found, BESIDE))}


def measured_lag(flights: Sequence[Flight], mass_kg: float) -> dict[str, float]:
    """Time constants up and down [s] that measured rotor speed shows."""
    logs, _ = read_logs(flights)
    fitted: Model = hover(logs, Vehicle(mass_kg=mass_kg))
    lag = fit_lag(fitted, windows_of(logs), logs[0].row_s)
    return {UP: lag.tau_up_s, DOWN: lag.tau_down_s}
