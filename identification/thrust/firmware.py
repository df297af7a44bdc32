"""The vehicle firmware's thrust curves and their inverse, and its constants written as it wants them.

Source: crazyflie-firmware 2025.12.1, ``platform_defaults_cf2.h`` (coefficients, limits) and ``motors.c``
(``motorsCompensateBatteryVoltage``: the inverse of the cubic after Cardano).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LOWEST_BATTERY_V = 2.0
"""Below it the firmware stops the motors."""


@dataclass(frozen=True)
class PropellerSet:
    """c (4,) N/V^k of T = sum c_k (u V)^k per motor; thrust_min_N, thrust_max_N: limits of a command per motor."""

    name: str
    words: str
    c: tuple[float, float, float, float]
    thrust_min_N: float
    thrust_max_N: float


PLUS = PropellerSet("2_1_plus", "2.1+ propellers",
                    (-0.02476537915958403, 0.06523793527519485, -0.026792504967750107, 0.006776789303971145),
                    0.012817578393224994, 0.12)
LEGACY = PropellerSet("legacy", "legacy propellers",
                      (-0.014830744918356092, 0.04724465241828281, -0.01847364358025878, 0.005960923942142),
                      0.012817578393224994, 0.12)


def motor_voltage(thrust_N: np.ndarray, c: Sequence[float] | np.ndarray, kind: type = np.float64) -> np.ndarray:
    """Voltage u V [V] at which the cubic ``c`` gives ``thrust_N`` (...), as the firmware solves it.

    Only for cubics that rise everywhere (one real root); others give nan. The vehicle computes with
    ``kind=numpy.float32``, in which a small c_3 cancels next to the others; algebra does not show that.
    """
    c0, c1, c2, c3 = (kind(x) for x in c)
    p, r = -c2 / (kind(3) * c3), c1 / (kind(3) * c3)
    q = p**3 + (c2 * c1 - kind(3) * c3 * (c0 - np.asarray(thrust_N, kind))) / (kind(6) * c3**2)
    inside = q**2 + (r - p**2) ** 3
    root = np.sqrt(np.where(inside >= 0.0, inside, np.nan))
    found: np.ndarray = np.cbrt(q + root) + np.cbrt(q - root) + p
    return found


def constants(c: Sequence[float] | np.ndarray, thrust_min_N: float, thrust_max_N: float, comment: str) -> str:
    """Lines for ``platform_defaults_cf2.h`` [N, V]; ``comment`` says where they are from."""
    names = [f"#define VMOTOR2THRUST{k} {value:.12g}f" for k, value in enumerate(c)]
    return "\n".join([f"// {comment}", *names, f"#define THRUST_MIN {thrust_min_N:.6g}f  // N per motor",
                      f"#define THRUST_MAX {thrust_max_N:.6g}f  // N per motor", ""])
