"""Motors from measured rotor speed: what ``nanobench motors`` and ``nb.motors`` are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..physics.vehicle import BOUNDS
from .diagnosing import check_installed
from .options import Options

if TYPE_CHECKING:
    from identification.motors import Study
    from identification.motors.motor_parts import MotorResult

    from ..flight import Flight


@dataclass(frozen=True)
class FittedNumber:
    """A number of the motors in SI ``unit`` with its 95 % interval; or None."""

    name: str
    value: float
    ci95: Sequence[float] | None
    unit: str


def check_mass(mass_kg: float | None) -> None:
    """UsageError for a mass that no small vehicle has."""
    low, high = BOUNDS["mass_kg"]
    if mass_kg is not None and not low <= mass_kg <= high:
        raise UsageError(f"--mass {mass_kg:g} kg is outside {low:g} to {high:g} kg; is it in grams?")


def study_motors(options: Options, train: Sequence[Flight], test: Sequence[Flight] | None,
                 mass_kg: float | None) -> tuple[Study, MotorResult]:
    """Fits to ``train``, judged on ``test``; None: whole flights of ``train`` are held out in turn.

    mass_kg: of the vehicle with battery; None: only ratios to the mass are identified. Raises InputError where the
    flights hold too little.
    """
    check_mass(mass_kg)
    check_installed()
    from identification.motors import identify
    from identification.motors.motor_result import motor_result

    with options.progress.task("motors", 1) as step:
        study = identify(train, test, mass_kg=mass_kg, seed=options.seed,
                         progress=lambda done, total: step(done, total=total))
        return study, motor_result(study, options.seed)


def motors_sentence(found: MotorResult) -> str:
    """Time constants, delay, and the map of rotor speed."""
    lag = found.lag.fit
    return (f"motor lag {1e3 * lag.tau_up_s:.1f} ms up, {1e3 * lag.tau_down_s:.1f} ms down, delay "
            f"{1e3 * lag.delay_s:.1f} ms; speed from PWM by {found.speed.best or 'no map'}")


def fitted_numbers(found: MotorResult) -> list[FittedNumber]:
    """Lag, thrust over squared speed, and moments of inertia where the flights show them."""
    lag, force, moments = found.lag.fit, found.force, found.moments
    numbers = [FittedNumber(name, value, lag.ci95.get(key), "s") for name, key, value in (
        ("lag up", "tau_up_s", lag.tau_up_s), ("lag down", "tau_down_s", lag.tau_down_s),
        ("delay", "delay_s", lag.delay_s))]
    value, unit = (force.k_f, "N s²/rad²") if force.k_f is not None else (force.k_f_per_kg, "N s²/rad² per kg")
    numbers.append(FittedNumber("thrust over squared speed", value, force.ci95, unit))
    if moments.explained["x"].median is not None:
        numbers += [FittedNumber(f"J_{axis}", moments.inertia_kg_m2[axis], None, "kg m²") for axis in "xy"]
    return numbers
