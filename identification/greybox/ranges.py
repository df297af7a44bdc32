"""Physical signs and ranges of fitted parameters, where they are narrower than the terms' own, and soft priors.

A fit that is free in sign and lag learns the inverted flight controller: the logged PWM of the next half second was
computed from the gyro of that half second. Such a fit scores best and is no vehicle. Hence: motors never run ahead of
their command, thrust rises with voltage, lateral air tips the nose up, rotation dies away, turning inertia is that of
a vehicle of this mass and size.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.model import find_term
from nanobench_tools.settings import number, setting

from .solve import Prior

RANGES: dict[str, tuple[float, float, str]] = setting("greybox.ranges.ranges")
"""Name -> (lower, upper, why)."""

LEAST_INERTIA = number("greybox.ranges.least_inertia")
"""Of the inertia that the vehicle would have with all its mass at the motors, which is the most it can have."""

FIRMWARE_MASS_KG, FIRMWARE_INERTIA = 0.027, (1.66e-5, 1.67e-5, 2.93e-5)
"""Crazyflie 2.1 without load: crazyflie-firmware, controller_lee.c. A load near the centre adds inertia about in
proportion to mass."""
LAG_UP_S: tuple[float, float] = setting("greybox.ranges.lag_up_s")
"""Mean and standard deviation of what is believed of the lag up before any flight."""
LAG_DOWN_S: tuple[float, float] = setting("greybox.ranges.lag_down_s")
"""The same of the lag down."""
INERTIA_SD = number("greybox.ranges.inertia_sd")
"""Of the firmware's inertia, scaled with the mass: standard deviation of what is believed."""
MEAN_SD = number("greybox.ranges.mean_sd")
"""Sum of the motors' gains, which only counts that their mean is 1."""


def bounds(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """(lower, upper) (P,): the terms' own bounds, narrowed."""
    lower, upper = model.lower.copy(), model.upper.copy()
    for i, name in enumerate(model.names):
        low, high, _ = RANGES.get(name, (-np.inf, np.inf, ""))
        if name.startswith("inertia."):
            high = most_inertia(model)[int(name[-2])]
            low = LEAST_INERTIA * high
        lower[i], upper[i] = max(lower[i], low), min(upper[i], high)
    return lower, upper


def most_inertia(model: Model) -> np.ndarray:
    """(3,) kg m^2 about x, y, z with all mass at the motors."""
    x2, y2 = np.mean(np.square(model.vehicle.motor_positions_m), axis=0)
    return model.vehicle.mass_kg * np.array([y2, x2, x2 + y2])


def priors(model: Model) -> tuple[Prior, ...]:
    """Soft terms of a fit of ``model``; what it does not have is left out."""
    found = [Prior(tuple(f"motor_imbalance.g[{i}]" for i in range(4)), 4.0, MEAN_SD, "gains have mean 1", (1.0,) * 4),
             Prior(("motor_lag.tau_up_s",), *LAG_UP_S, "motor_lag: " + _source("motor_lag", "tau_up_s")),
             Prior(("motor_lag.tau_down_s",), *LAG_DOWN_S, "motor_lag: " + _source("motor_lag", "tau_down_s"))]
    for axis in (0, 1):
        mean = FIRMWARE_INERTIA[axis] * model.vehicle.mass_kg / FIRMWARE_MASS_KG
        found.append(Prior((f"inertia.inertia_kg_m2[{axis}]",), mean, INERTIA_SD * mean,
                           "firmware controller_lee.c, scaled with the mass"))
    return tuple(p for p in found if all(name in model.names for name in p.names))


def _source(term: str, parameter: str) -> str:
    return find_term(term).parameter(parameter).source


def held(model: Model) -> tuple[str, ...]:
    """Names that no flight tells: only k_m / J_z is seen in yaw, and only thrust over mass in translation."""
    wanted = ("inertia.inertia_kg_m2[2]", "thrust_scale.s", "mass.m", "frame_tilt.roll_rad", "frame_tilt.pitch_rad")
    return tuple(name for name in wanted if name in model.names)


def falling_thrust(model: Model, low_V: float, high_V: float) -> str:
    """What is wrong with the thrust map over the motor voltages (or ratios) that were flown, or nothing."""
    for term in ("thrust_voltage", "thrust_pwm"):
        if term in model:
            c = np.asarray(model.values_of(term)["c"])
            at = np.linspace(low_V, high_V, 21)
            if np.any(np.polyval((c[1:] * np.arange(1, len(c)))[::-1], at) <= 0.0):
                return f"{term} falls with the command between {low_V:.3g} and {high_V:.3g}"
    return ""
