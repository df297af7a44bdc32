"""Factors of known mistakes of units: a quantity that is written in another unit, or in counts of a sensor.

A factor is known within an interval, by noise and by delays. Every known factor within the interval is named; without
one the interval is reported.
"""

import math
from dataclasses import dataclass

from ..units import FOOT_M, GRAVITY_M_S2, INCH_M

DEG = 180.0 / math.pi
COUNTS_PER_DEG_S = (16.4, 32.8, 65.5, 131.0)
"""Sensitivities of 16-bit gyros at +-2000, 1000, 500 and 250 deg/s."""
COUNTS_PER_G = (16384.0, 8192.0, 4096.0, 2048.0, 1024.0)
"""Sensitivities of accelerometers at +-2, 4, 8 and 16 g, and of older ones."""
_THOUSANDS = {"thousandths": 1e3, "thousands": 1e-3}
_ANGLES = {"deg for rad": DEG, "rad for deg": 1.0 / DEG, "millidegrees for rad": 1e3 * DEG,
           "hundredths of deg for rad": 1e2 * DEG, **_THOUSANDS}
_LENGTHS = {**_THOUSANDS, "hundredths": 1e2, "hundreds": 1e-2, "feet for m": 1.0 / FOOT_M, "inches for m": 1.0 / INCH_M,
            "inches read as cm": 1e-2 / INCH_M}
KNOWN: dict[str, dict[str, float]] = {
    "rad": _ANGLES,
    "rad/s": {**_ANGLES, "rpm for rad/s": 30.0 / math.pi,
              **{f"counts of {n:g} per deg/s": n * DEG for n in COUNTS_PER_DEG_S}},
    "m": _LENGTHS,
    "m/s": {**_LENGTHS, "km/h for m/s": 3.6},
    "m/s^2": {"g for m/s^2": 1.0 / GRAVITY_M_S2, "m/s^2 for g": GRAVITY_M_S2, "mg for m/s^2": 1e3 / GRAVITY_M_S2,
              "hundredths": 1e2, **_THOUSANDS, **{f"counts of {n:g} per g": n / GRAVITY_M_S2 for n in COUNTS_PER_G}},
}
"""SI unit of a quantity -> name of a mistake -> value as read over the true value."""


@dataclass(frozen=True)
class NamedFactor:
    """``known``: the known mistakes from ``low`` to ``high``, usual units before counts; ``estimate`` without one."""

    known: dict[str, float]
    estimate: float
    low: float
    high: float

    @property
    def factor(self) -> float:
        """The first known one, else as estimated."""
        return next(iter(self.known.values()), self.estimate)

    @property
    def name(self) -> str:
        """Of ``factor``; equal for two quantities in the same wrong unit."""
        return next(iter(self.known), "unknown unit")

    @property
    def words(self) -> str:
        """``57.3``, ``1000 or 939.6``, or ``42 (36 to 49)``."""
        return " or ".join(f"{f:.4g}" for f in self.known.values()) if self.known else (
            f"{self.estimate:.3g} ({self.low:.3g} to {self.high:.3g})")

    @property
    def reading(self) -> str:
        """`` (deg for rad)``, or all that are possible; a space before it."""
        return f" ({' or '.join(self.known) or 'unknown unit'})"


def named_factor(unit: str, estimate: float, within: float) -> NamedFactor:
    """The known factors of a quantity of SI ``unit`` near an estimate; ``within``: factor of its uncertainty."""
    low, high = estimate / within, estimate * within
    return NamedFactor({name: f for name, f in KNOWN[unit].items() if low <= f <= high}, estimate, low, high)
