"""Maps fitted to what the balanced model predicts: the thrust, scaled to the weight that was carried.

A plain fit has to explain per-flight offsets and bends the curve for that. Here the balance explains them, and the
curve describes only changes within a flight. Nonlinear least squares over shape and coefficients together, from the
plain fit on.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, number
from nanobench_tools.units import GRAVITY_M_S2

from .flight_rows import Flown
from .maps import Map
from .stand_fit import AT_BOUND

DOUBT_S = number("thrust.balanced.doubt_s")

LEAST_BALANCE = number("thrust.balanced.least_balance")

FIT_ROWS = count("thrust.balanced.fit_rows")


def balance(carried_m_s2: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Factor (n,) that makes the thrust remembered over ``seconds`` the weight; nearer to 1 the shorter these are.

    >>> balance(np.array([11.0, 11.0]), np.array([0.0, 1e6])).round(3).tolist()
    [1.0, 0.892]
    """
    share = seconds / (seconds + DOUBT_S)
    return 1.0 / np.maximum(1.0 + share * (carried_m_s2 / GRAVITY_M_S2 - 1.0), LEAST_BALANCE)


def fit_balanced(candidate: Map, mass_kg: float, flights: Sequence[Flown], counts: np.ndarray, shape: np.ndarray,
                 linear: np.ndarray, row_weight: float) -> tuple[np.ndarray, np.ndarray, str]:
    """(shape, coefficients, what is wrong with them), searched from ``shape`` and ``linear``; ``row_weight``: weight
    of a row relative to the priors, 1/(m/s^2)^2."""
    thin = -(-sum(map(len, flights)) // FIT_ROWS)
    few = [f.rows(slice(None, None, thin)) for f in flights]
    rows = array_fields.joined(few)
    root = np.sqrt(thin * row_weight * np.repeat(counts, list(map(len, few))))
    inside = len(shape)

    def missed(x: np.ndarray) -> np.ndarray:
        now, before = (x[inside:] @ candidate.design(x[:inside], u, volts[:, None]).sum(axis=2) / mass_kg
                       for u, volts in ((rows.u, rows.battery_V), (rows.lift[:, :4], rows.lift[:, 4])))
        own = [(v - s.prior[0]) / s.prior[1] for s, v in zip(candidate.shape, x[:inside], strict=True) if s.prior]
        return np.concatenate([(now * balance(before, rows.lift[:, 5]) - rows.force) * root, own])

    low = np.array([s.low for s in candidate.shape] + [-np.inf] * len(linear))
    high = np.array([s.high for s in candidate.shape] + [np.inf] * len(linear))
    first = np.concatenate([shape, linear])
    margin = 1e-3 * np.where(np.isfinite(high - low), high - low, 0.0)
    found = least_squares(missed, np.clip(first, low + margin, high - margin), bounds=(low, high),
                          x_scale=np.maximum(np.abs(first), 1e-3), xtol=1e-6, ftol=1e-6)
    trouble = "" if found.success else "did not converge"
    for s, v in zip(candidate.shape, found.x, strict=False):
        if min(v - s.low, s.high - v) < AT_BOUND * (s.high - s.low):
            trouble = f"{s.name} sits on its bound {v:.4g}" + (f" {s.unit}" if s.unit != "1" else "")
    return found.x[:inside], found.x[inside:], trouble
