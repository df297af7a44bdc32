"""Battery of one flight: voltages, sag, loss for the command of the motors, and internal resistance.

The resistance follows from changes of voltage and current within seconds, without the slow discharge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..flight import Flight, Span, mask_of, motors_of
from ..results.result import Result
from ..sources.cells import GIGANTIC
from .recording_audit import Audit

SLOW_S = 4.0
"""Slower changes of the voltage are discharge."""
BLOCK_S = 2.0
FEWEST_BLOCKS = 5
EXPLAINED = 0.5
"""Correlation of voltage and load from which on their ratio is given."""
SAG_S = 2.0
IDLE = 0.5
"""Of the command in flight: motors below it do not load the battery."""


@dataclass(frozen=True, repr=False)
class Slope(Result):
    """A ratio with its 95 % interval, from stretches of ``BLOCK_S`` left out in turn."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, repr=False)
class Battery(Result):
    """Voltage in the air [V]; ``sag_V`` from standing to flying; ``resistance_ohm`` where the current was logged;
    ``volt_per_command``: loss for full command of all motors."""

    start_V: float
    end_V: float
    lowest_V: float
    sag_V: float | None
    resistance_ohm: Slope | None
    volt_per_command: Slope | None


def battery_of(flight: Flight, audit: Audit, air: Sequence[Span]) -> Battery | None:
    """Of the rows in ``air``; None without a voltage there."""
    if "battery" not in flight or "vbat" not in flight["battery"]:
        return None
    stream = flight["battery"]
    good = (stream["vbat"] > 0.0) & (stream["vbat"] < GIGANTIC)
    good &= mask_of(audit.clean_for(["battery"]), stream.time_s)
    flying = good & mask_of(air, stream.time_s)
    if flying.sum() < 2:
        return None
    time_s, volt = stream.time_s[flying], stream["vbat"][flying]
    standing = good & (stream.time_s < air[0].start_s) & _idle(flight, stream.time_s, air)
    first = time_s < time_s[0] + SAG_S
    sag = float(np.median(stream["vbat"][standing]) - np.median(volt[first])) if (
        audit.airborne and standing.sum() >= 3) else 0.0
    resistance = per_command = None
    if "current" in stream:
        resistance = _slope(time_s, volt, stream["current"][flying])
    if "motor" in flight and (motors := motors_of(flight["motor"])) and len(flight["motor"]) > 1:
        motor = flight["motor"]
        per_command = _slope(time_s, volt, np.interp(time_s, motor.time_s, motor[list(motors)].mean(axis=1)))
    return Battery(float(np.median(volt[first])), float(np.median(volt[time_s > time_s[-1] - SAG_S])),
                   float(volt.min()), sag if sag > 0.0 else None, resistance, per_command)


def _idle(flight: Flight, time_s: np.ndarray, air: Sequence[Span]) -> np.ndarray:
    """(n,) bool: rows without the load of flight; all where no motor was logged."""
    if "motor" not in flight or not (motors := motors_of(flight["motor"])) or len(flight["motor"]) < 2:
        return np.ones(len(time_s), dtype=bool)
    motor = flight["motor"]
    mean = motor[list(motors)].mean(axis=1)
    flying = mean[mask_of(air, motor.time_s)]
    return np.asarray(np.interp(time_s, motor.time_s, mean) < IDLE * (np.nanmedian(flying) if len(flying) else 0.0))


def _slope(time_s: np.ndarray, volt: np.ndarray, load: np.ndarray) -> Slope | None:
    """Volts lost per unit of load, by changes within ``SLOW_S``; None where they do not belong to each other."""
    known = (np.abs(load) < GIGANTIC) & np.isfinite(volt)
    time_s, volt, load = time_s[known], volt[known], load[known]
    if len(time_s) < 4 * FEWEST_BLOCKS or np.any(np.diff(time_s) < 0.0):
        return None
    fast_v, fast_l = (x - _slow(time_s, x) for x in (volt, load))
    block = ((time_s - time_s[0]) // BLOCK_S).astype(int)
    shared, power, other = (np.bincount(block, weights=w) for w in (fast_v * fast_l, fast_l**2, fast_v**2))
    there = np.bincount(block) > 0
    shared, power = shared[there], power[there]
    if len(shared) < FEWEST_BLOCKS or not power.sum() > 0.0 or not other.sum() > 0.0:
        return None
    if -shared.sum() < EXPLAINED * np.sqrt(power.sum() * other.sum()):
        return None
    value = -float(shared.sum() / power.sum())
    without = -(shared.sum() - shared) / np.maximum(power.sum() - power, 1e-300)
    n = len(shared)
    half = 1.96 * float(np.sqrt((n - 1) / n * ((without - without.mean())**2).sum()))
    return Slope(value, value - half, value + half)


def _slow(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means over SLOW_S around each row."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    a = np.searchsorted(time_s, time_s - 0.5 * SLOW_S, side="left")
    b = np.searchsorted(time_s, time_s + 0.5 * SLOW_S, side="right")
    return np.asarray((total[b] - total[a]) / (b - a))
