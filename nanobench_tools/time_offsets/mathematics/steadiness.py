"""How steady a time error is over a flight: its slope, its scatter, and when they are called the clock's."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ...settings import number

CHANCE = number("audit.steadiness.chance")
SMALLEST_DRIFT_S = number("audit.steadiness.smallest_drift_s")
SMALLEST_WANDER_S = number("audit.steadiness.smallest_wander_s")
SURELY_SD = number("audit.steadiness.surely_sd")


@dataclass(frozen=True, kw_only=True)
class Steadiness:
    """slope (s/s) with slope_sd; span_s; ``wander_sd_s``: scatter beyond noise and slope; ``noise_sd_s``: scatter of
    one of ``blocks`` nearly independent readings without any clock error; ``p_drift``, ``p_wander``: chance of as
    much without one."""

    slope: float
    slope_sd: float
    span_s: float
    wander_sd_s: float
    noise_sd_s: float
    blocks: int
    p_drift: float
    p_wander: float

    @property
    def drifts(self) -> bool:
        return self.p_drift < CHANCE and abs(self.slope) * self.span_s > SMALLEST_DRIFT_S

    @property
    def wanders(self) -> bool:
        return self.p_wander < CHANCE and self.wander_sd_s > SMALLEST_WANDER_S

    @property
    def detectable_drift_s(self) -> float:
        """Change over the flight that is found with 99.9 % probability. A line through n readings has its slope to
        within noise sqrt(12 / n) over the span."""
        slope_sd = max(self.noise_sd_s, 1e-5) * np.sqrt(12.0 / self.blocks)
        return max(SMALLEST_DRIFT_S, float((student.isf(CHANCE / 2, max(self.blocks - 2, 1)) + SURELY_SD) * slope_sd))
