"""Units at the edges: everything inside is SI, and these factors are the only way in and out.

``to_si(values, unit)`` multiplies by the factor of the unit as found. PWM is carried as the ratio
u = PWM / 65535 in 0..1, rotor speed as rad/s, specific force as m/s^2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .errors import UsageError

GRAVITY_M_S2 = 9.81
"""Standard of the vehicle's firmware (physicalConstants.h), used wherever g becomes m/s^2."""

PWM_FULL_SCALE = 65535.0
"""Counts of a motor command at full duty (uint16)."""

SI_FACTOR: dict[str, float] = {
    "1": 1.0, "m": 1.0, "m/s": 1.0, "m/s^2": 1.0, "rad": 1.0, "rad/s": 1.0, "V": 1.0, "N": 1.0, "s": 1.0, "kg": 1.0,
    "N m": 1.0, "A": 1.0,
    "mm": 1e-3, "cm": 1e-2, "mm/s": 1e-3, "cm/s": 1e-2, "mm/s^2": 1e-3,
    "g": GRAVITY_M_S2, "mg": 1e-3 * GRAVITY_M_S2,
    "deg": math.pi / 180.0, "deg/s": math.pi / 180.0, "mrad/s": 1e-3, "mrad": 1e-3,
    "mV": 1e-3, "gram": 1e-3, "gram_force": 1e-3 * GRAVITY_M_S2,
    "pwm16": 1.0 / PWM_FULL_SCALE, "rpm": 2.0 * math.pi / 60.0,
    "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
}
"""SI value of one unit. ``g`` is the acceleration; mass in grams is ``gram``."""


def factor(unit: str) -> float:
    """SI value of one ``unit``; raises UsageError for a unit that is not known."""
    try:
        return SI_FACTOR[unit]
    except KeyError:
        raise UsageError(f"unknown unit {unit!r}; known: {', '.join(sorted(SI_FACTOR))}") from None


def to_si(values: ArrayLike, unit: str) -> np.ndarray:
    """``values`` in ``unit`` -> SI. Any shape."""
    return np.asarray(values, dtype=float) * factor(unit)
