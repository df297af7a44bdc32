"""Where shocks are to be expected: near the ground while something moves."""

from __future__ import annotations

import numpy as np

from .airborne import height_of, resting_height_m
from .context import Context
from .truth import widened

NEAR_M = 0.2
"""Above the ground; rebounds and slides happen below."""
MOVES_M_S = 0.05


def contact_likely(context: Context, at_s: np.ndarray) -> np.ndarray:
    """(n,) bool for times ``at_s``: within half a second of moving near the ground; all True if heights are unknown.

    There a true shock of the airframe cannot be told from a wrong sample of an accelerometer or gyro.
    """
    height = context.once(height_of)
    if height is None or len(height[0]) < 10:
        return np.ones(len(at_s), dtype=bool)
    time_s, z = height
    low = z < resting_height_m(z) + NEAR_M
    span = min(10, len(z) // 2)
    moved = np.zeros(len(z))
    moved[span:] = np.abs(z[span:] - z[:-span]) / np.maximum(time_s[span:] - time_s[:-span], 1e-6)
    risky = widened(low & (moved > MOVES_M_S), 50)
    index = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
    return risky[index]
