"""Units at the edges: everything inside is SI, and these factors are the only way in and out.

``to_si(values, unit)`` multiplies by the factor of the unit as found. PWM is carried as the ratio
u = PWM / 65535 in 0..1, rotor speed as rad/s, specific force as m/s^2.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from .errors import UsageError

GRAVITY_M_S2 = 9.81
"""Standard of the vehicle's firmware (physicalConstants.h), used wherever g becomes m/s^2."""

PWM_FULL_SCALE = 65535.0
"""Counts of a motor command at full duty (uint16)."""

INCH_M, FOOT_M, MILE_M = 0.0254, 0.3048, 1609.344
"""Exact by definition."""

POUND_FORCE_N = 4.4482216152605
"""Exact by definition (0.45359237 kg times 9.80665 m/s^2)."""

SI_FACTOR: dict[str, float] = {
    "1": 1.0, "m": 1.0, "m/s": 1.0, "m/s^2": 1.0, "rad": 1.0, "rad/s": 1.0, "V": 1.0, "N": 1.0, "s": 1.0, "kg": 1.0,
    "N m": 1.0, "A": 1.0,
    "mm": 1e-3, "cm": 1e-2, "mm/s": 1e-3, "cm/s": 1e-2, "mm/s^2": 1e-3,
    "in": INCH_M, "ft": FOOT_M, "in/s": INCH_M, "ft/s": FOOT_M, "km/h": 1.0 / 3.6, "mph": MILE_M / 3600.0,
    "g": GRAVITY_M_S2, "mg": 1e-3 * GRAVITY_M_S2,
    "deg": math.pi / 180.0, "deg/s": math.pi / 180.0, "mdeg/s": math.pi / 180e3, "mrad/s": 1e-3, "mrad": 1e-3,
    "mV": 1e-3, "mA": 1e-3, "gram": 1e-3, "gram_force": 1e-3 * GRAVITY_M_S2, "kgf": GRAVITY_M_S2, "lbf": POUND_FORCE_N,
    "mN": 1e-3,
    "%": 1e-2, "pulse_us": 1e-3, "dshot": 1.0 / 1999.0,
    "pwm16": 1.0 / PWM_FULL_SCALE, "rpm": 2.0 * math.pi / 60.0,
    "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
}
"""SI value of one unit. ``g`` is the acceleration; mass in grams is ``gram``; ``pulse_us`` is the command of a motor as
the length of a pulse, 1000 us to 2000 us. ``dshot`` is its DShot frame, 48 to 2047."""

ZERO: dict[str, float] = {"pulse_us": 1000.0, "dshot": 48.0}
"""Readings that mean zero, where zero does not."""


def factor(unit: str) -> float:
    """SI value of one ``unit``; raises UsageError for a unit that is not known."""
    try:
        return SI_FACTOR[unit]
    except KeyError:
        raise UsageError(f"unknown unit {unit!r}; known: {', '.join(sorted(SI_FACTOR))}") from None


def to_si(values: ArrayLike, unit: str) -> np.ndarray:
    """``values`` in ``unit`` -> SI. Any shape."""
    values = np.asarray(values, dtype=float)
    return np.maximum(values - ZERO[unit], 0.0) * factor(unit) if unit in ZERO else values * factor(unit)
