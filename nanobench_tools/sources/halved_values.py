"""Values of 16 bits that the firmware halved, and their doubling.

Before release 2026.08 the Crazyflie's rounding to half precision lost a carry. Values less than half a digit below
0.125, 0.5, 2, 8 ... were written as half of that: a lone 1.0 between values of 2.0.
"""

from __future__ import annotations

import numpy as np

LOWEST, HIGHEST = -7, 7
"""Powers of four that a half-precision number can be."""
NEAR = (1.6, 2.5)
"""Neighbours of a halved value, as multiples of it: 2, and what a signal moves between two samples."""


def halved(values: np.ndarray) -> np.ndarray:
    """(n,) bool: values of one variable, a power of four in size, whose neighbours of both sides are near its double.

    A run of equal values is judged by the values before and after it.
    """
    size = np.abs(values)
    suspects = np.isin(size, 4.0 ** np.arange(LOWEST, HIGHEST + 1))
    found = np.zeros(len(values), dtype=bool)
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    for start, end in zip(starts, [*starts[1:], len(values)], strict=True):
        if suspects[start] and start > 0 and end < len(values):
            around = np.array([values[start - 1], values[end]]) / values[start]
            found[start:end] = bool(np.all((around > NEAR[0]) & (around < NEAR[1])))
    return found
