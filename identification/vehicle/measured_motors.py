"""Motors from measured rotor speed, where flights have it: lag, and the inertia that they turn.

Rows of 10 ms in closed loop cannot show a lag. Rotor speed at the rate of the log shows it without the motion of the
vehicle. The inertia then needs no assumed lag (``identification.motors``).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.motors import lag, torque
from identification.motors.force import fit_force
from identification.motors.motor_study import hover
from identification.motors.rotor_rows import Log, read_logs
from nanobench_tools.physics import Vehicle
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.settings import number

LAG_SD = number("vehicle.measured_motors.lag_sd")
INERTIA_SD = number("vehicle.measured_motors.inertia_sd")
NORMAL_95 = 1.96
"""Half-width of a 95 % interval of the normal distribution in standard deviations."""
KIND = "up and down + delay"


@dataclass(frozen=True)
class Measured:
    """A parameter and its standard deviation."""

    value: float
    sd: float


def measured_motors(cases: Sequence[Case], vehicle: Vehicle, seed: int = 0) -> dict[str, Measured]:
    """By name, of the flights with rotor speed; empty where no flight has it, or no lag fits."""
    logs, _ = read_logs([case.flight for case in cases if "rpm" in case.flight.streams])
    if not logs:
        return {}
    windows = lag.windows_of(logs)
    if not len(windows.u):
        return {}
    base = hover(logs, vehicle)
    fitted = lag.fit_lag(base, windows, logs[0].row_s, KIND)
    if fitted.trouble:
        return {}
    flew = np.unique(windows.flight)
    ends = lag.intervals(fitted, seed=seed, sessions=labels_of([logs[i] for i in flew]))
    found = {f"motor_lag.tau_{way}_s": Measured(value, float(np.hypot(LAG_SD * value, _half(ends.get(way)))))
             for way, value in (("up", fitted.tau_up_s), ("down", fitted.tau_down_s))}
    return found | _inertia(logs, vehicle)


def _half(ends: Sequence[float] | None) -> float:
    """Standard deviation of a 95 % interval; 0 for none."""
    return 0.0 if ends is None else (ends[1] - ends[0]) / (2.0 * NORMAL_95)


def _inertia(logs: Sequence[Log], vehicle: Vehicle) -> dict[str, Measured]:
    """kg m^2 about x and y."""
    k_f = fit_force(logs).k_f_per_kg * vehicle.mass_kg
    found = {}
    for i, axis in enumerate("xy"):
        turns = [turn for log in logs
                 if (turn := torque.regress(log, i, torque.moments(log, vehicle, k_f)[axis])) is not None]
        values = np.array([1.0 / turn.values[0] for turn in turns if turn.values[0] > 0.0])
        if len(values):
            value = float(np.median(values))
            noise = float(np.std(values) / np.sqrt(len(values)))
            found[f"inertia.inertia_kg_m2[{i}]"] = Measured(value, float(np.hypot(INERTIA_SD * value, noise)))
    return found
