"""The firmware's thrust curve of one motor: newton <-> volt at the motor, and its battery compensation.

Source: crazyflie-firmware 2025.12.1, motors.c and platform_defaults_cf2.h, set "2.1+ propellers" (the default).
"""

import numpy as np

COEFFICIENTS = (-0.02476537915958403, 0.06523793527519485, -0.026792504967750107, 0.006776789303971145)
"""Thrust [N] of one motor as a polynomial of its voltage [V]: c0 + c1 V + c2 V^2 + c3 V^3."""
THRUST_MAX_N = 0.12
"""Thrust of one motor that the firmware calls 65535 counts [N]."""
THRUST_MIN_N = 0.012817578393224994
"""Below this the firmware asks for none at all [N]."""
VOLTAGE_MIN_V = 2.0
"""Below this filtered battery voltage the compensation gives zero [V]."""


def thrust_of_voltage(voltage_V: np.ndarray) -> np.ndarray:
    """Motor voltage [V], any shape -> thrust [N]; never negative (the cubic is below zero under 0.5 V)."""
    c0, c1, c2, c3 = COEFFICIENTS
    v = np.asarray(voltage_V, float)
    return np.maximum(c0 + v * (c1 + v * (c2 + v * c3)), 0.0)


def voltage_of_thrust(thrust_N: np.ndarray) -> np.ndarray:
    """Thrust [N], a float or an array -> motor voltage [V]; the cubic is strictly rising: its one real root by Cardano.

    ``motor_output.py`` compiles this same function.
    """
    c0, c1, c2, c3 = COEFFICIENTS
    p = -c2 / (3.0 * c3)
    q = p**3 + (c2 * c1 - 3.0 * c3 * (c0 - thrust_N)) / (6.0 * c3**2)
    r = c1 / (3.0 * c3)
    s = np.sqrt(q * q + (r - p * p) ** 3)
    return np.cbrt(q + s) + np.cbrt(q - s) + p
