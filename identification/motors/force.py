"""Thrust from rotor speed: k_f of T = k_f w^2 from the accelerometer's body-z specific force.

In free flight m a_z = k_f sum w_i^2: only k_f / m is seen, and k_f itself follows from a mass that somebody weighed.
Both sides are low-passed by averaging over a tenth of a second, which leaves delays of a few milliseconds no say.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools.metrics.statistics import bootstrap_interval
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.settings import number

from .rotor_rows import Log

AVERAGE_S = number("motors.force.average_s")
ONE_VEHICLE = number("motors.force.one_vehicle")


@dataclass(frozen=True)
class Force:
    """k_f_per_kg [N s^2/rad^2 per kg] pooled, ci95 by drawing sessions and flights (None for one), one value per
    flight."""

    k_f_per_kg: float
    ci95: tuple[float, float] | None
    per_flight: tuple[float, ...]


def averaged(log: Log, values: np.ndarray, seconds: float = AVERAGE_S) -> np.ndarray:
    """(blocks, ...) means over pieces of every stretch; rows after the last whole piece are dropped."""
    size = max(round(seconds / log.row_s), 1)
    found = []
    for a, b in log.stretches:
        count = (b - a) // size
        part = values[a:a + count * size]
        found.append(part.reshape(count, size, *values.shape[1:]).mean(axis=1))
    return np.concatenate(found)


def fit_force(logs: Sequence[Log], seed: int = 0) -> Force:
    """k_f / m of flights, each with the weight of its length."""
    single, sizes = [], []
    for log in logs:
        squares, force = averaged(log, np.sum(log.speed**2, axis=1)), averaged(log, log.force_z)
        single.append(float(squares @ force / (squares @ squares)))
        sizes.append(len(squares))
    return Force(float(np.average(single, weights=sizes)), bootstrap_interval(single, seed, sessions=labels_of(logs)),
                 tuple(single))


def errors(log: Log, specific_thrust: np.ndarray) -> np.ndarray:
    """(blocks,) m/s^2: specific thrust (n,) minus measured body-z specific force."""
    return np.asarray(averaged(log, specific_thrust) - averaged(log, log.force_z))
