"""The swing of a load on a string: two states that a model of terms does not have, integrated in addition to it.

Small angles: s is the load's horizontal place against its knot, a the knot's acceleration,

    s'' = -(g / l) s - 2 zeta sqrt(g / l) s' - a,        F = m g s / l  on the knot.

A load on a fixed knot swings at sqrt(g / l). Under a free vehicle of mass M it is sqrt(g / l (1 + m / M)). A
controller puts it between the two (any text on the overhead crane).
"""

import math

import numpy as np
from scipy.linalg import expm

from ..units import GRAVITY_M_S2


def swing(acceleration_m_s2: np.ndarray, row_s: float, length_m: float, mass_kg: float, damping: float = 0.0,
          start: np.ndarray | None = None) -> np.ndarray:
    """Force (n, 2) N on the knot at the start of each row; ``acceleration_m_s2`` (n, 2) of the knot, horizontal, held
    over rows of row_s; ``start`` (2, 2) place m and speed m/s of the load against the knot, by axis in columns; else
    at rest."""
    a = np.asarray(acceleration_m_s2, float)
    w = math.sqrt(GRAVITY_M_S2 / length_m)
    whole = np.zeros((3, 3))
    whole[0, 1], whole[1] = 1.0, [-w * w, -2.0 * damping * w, -1.0]
    step = expm(whole * row_s)  # exact for an acceleration that is held
    state = np.zeros((2, 2)) if start is None else np.array(start, float)
    found = np.empty_like(a)
    for k in range(len(a)):
        found[k] = mass_kg * w * w * state[0]
        state = step[:2, :2] @ state + step[:2, 2:] * a[k]
    return found


def lengths_m(frequency_hz: float, mass_share: float) -> tuple[float, float]:
    """(shortest, longest) string that swings at this frequency, as the knot is held or the vehicle follows."""
    held = GRAVITY_M_S2 / (2.0 * math.pi * frequency_hz) ** 2
    return held, held * (1.0 + mass_share)
