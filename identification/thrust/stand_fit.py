"""Fits of thrust maps to stand series: separable least squares, every file with the same weight.

For given shape parameters the coefficients follow linearly (variable projection, Golub and Pereyra 1973); the at most
two shape parameters are searched from several starts. A fit is never chosen if it did not converge, ended on a bound,
or gives a map that cannot be a motor. ``trouble`` has the reason.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from nanobench_tools.settings import number

from .maps import FROM_ELSEWHERE, Map, Numbers
from .stand_series import STEADY_V, Stand

AT_BOUND = number("thrust.stand_fit.at_bound")

STARTS = (0.0, -0.25, 0.25)
"""Where a search starts, as shares of the allowed range away from the map's own start."""

EFFECTIVE_ROWS = number("thrust.stand_fit.effective_rows")

TINY = 1e-16
"""N^2; keeps the logarithm of an exact fit finite."""

WORST_CONDITION = 1e9
"""Condition of the scaled columns beyond which a coefficient is not told from the others."""


@dataclass(frozen=True)
class Fit:
    """values by name of parameter; trouble: why the result is none, empty where it is one; shape: its values."""

    map: Map
    values: Mapping[str, float]
    trouble: str = ""
    shape: tuple[float, ...] = field(default=())

    def predict(self, u: ArrayLike, voltage: ArrayLike) -> np.ndarray:
        """Thrust [N] of a motor at PWM ratio ``u`` and battery ``voltage`` [V], broadcast against each other."""
        u, voltage = np.asarray(u, float), np.asarray(voltage, float)
        found = self.map.thrust(self.values, u, voltage)
        return np.array(np.broadcast_to(found, np.broadcast_shapes(u.shape, voltage.shape)))


def solve(columns: np.ndarray, target: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, float, float]:
    """(coefficients, weighted sum of squares, condition of the scaled columns): columns (k, n) against target (n,)."""
    root = np.sqrt(weights)
    scaled = (columns * root).T
    size = np.linalg.norm(scaled, axis=0)
    size[size == 0.0] = 1.0
    found, _, _, singular = np.linalg.lstsq(scaled / size, target * root, rcond=1e-12)
    found = found / size
    condition = np.inf if singular[-1] <= 0.0 else float(singular[0] / singular[-1])
    return found, float(np.sum((scaled @ found - target * root) ** 2)), condition


def fit_stands(candidate: Map, stands: Sequence[Stand], weights: Numbers | None = None,
               start: Sequence[float] | None = None) -> Fit:
    """The map fitted to all spinning rows of ``stands``; ``weights`` one per file (default all 1; a bootstrap counts a
    file as often as it was drawn). ``start``: shape values to search from, once."""
    if candidate.fixed is not None:
        return Fit(candidate, {name: c for (name, _), c in zip(candidate.linear, candidate.fixed, strict=True)},
                   _no_voltage(candidate, stands))
    blocked = _no_voltage(candidate, stands)
    if blocked:
        return Fit(candidate, {}, blocked)
    if weights is not None:
        stands, weights = zip(*((s, w) for s, w in zip(stands, weights, strict=True) if w > 0.0), strict=True)
    u = np.concatenate([s.u for s in stands])
    voltage = np.concatenate([s.voltage for s in stands])
    target = np.concatenate([s.thrust_N for s in stands])
    per_file = np.ones(len(stands)) if weights is None else np.asarray(weights, float)
    row_weights = np.concatenate([np.full(len(s), w / len(s)) for s, w in zip(stands, per_file, strict=True)])

    total, counted = float(row_weights.sum()), EFFECTIVE_ROWS * float(per_file.sum())

    def cost(shape: np.ndarray) -> float:
        mean_square = solve(candidate.design(shape, u, voltage), target, row_weights)[1] / total
        return counted * float(np.log(mean_square + TINY)) + prior_cost(candidate, shape)

    shape, trouble = search(candidate, cost, start)
    found, _, condition = solve(candidate.design(shape, u, voltage), target, row_weights)
    values = {name: float(c) for (name, _), c in zip(candidate.linear, found, strict=True)}
    values |= {s.name: float(x) for s, x in zip(candidate.shape, shape, strict=True)}
    fit = Fit(candidate, values, "", tuple(map(float, shape)))
    trouble = trouble or (f"not identified by these rows (condition {condition:.1e})"
                          if condition > WORST_CONDITION else "")
    lowest, highest = voltage.min(), voltage.max()
    return Fit(candidate, values, trouble or no_motor(fit, u, (lowest, highest)), fit.shape)


def prior_cost(candidate: Map, shape: Numbers) -> float:
    """Minus twice the log of the priors of the shape, up to a constant."""
    found: float = sum(((x - s.prior[0]) / s.prior[1]) ** 2
                       for s, x in zip(candidate.shape, shape, strict=True) if s.prior)
    return found


def search(candidate: Map, cost: Callable[[np.ndarray], float],
           start: Sequence[float] | None = None) -> tuple[np.ndarray, str]:
    """(shape values of the smallest cost, what is wrong with them)."""
    if not candidate.shape:
        return np.empty(0), ""
    low, high = (np.array([getattr(s, side) for s in candidate.shape]) for side in ("low", "high"))
    first = np.array([s.start for s in candidate.shape])
    starts = [np.asarray(start, float)] if start is not None else [
        np.clip(first + share * (high - low), low + 0.05 * (high - low), high - 0.05 * (high - low))
        if share else first for share in STARTS]
    found = [minimize(cost, x0, method="Nelder-Mead", bounds=list(zip(low, high, strict=True)),
                      options={"xatol": 1e-4, "fatol": 1e-6, "maxfev": 600}) for x0 in starts]
    best = min(found, key=lambda result: result.fun)
    for s, x, width in zip(candidate.shape, best.x, high - low, strict=True):
        if min(x - s.low, s.high - x) < AT_BOUND * width:
            return best.x, f"{s.name} sits on its bound {x:.4g}" + (f" {s.unit}" if s.unit != "1" else "")
    return best.x, "" if best.success else "did not converge"


def no_motor(fit: Fit, u: np.ndarray, voltages: tuple[float, float]) -> str:
    """Why a fitted map cannot be a motor over the PWM and voltages of its rows; empty if it can."""
    if not all(np.isfinite(list(fit.values.values()))):
        return "not finite"
    if fit.map.positive and fit.values[fit.map.linear[0][0]] <= 0.0:
        return f"{fit.map.linear[0][0]} is not positive"
    grid = np.linspace(u.min(), u.max(), 65)
    for voltage in np.unique(voltages) if np.isfinite(voltages[0]) else (0.0,):
        if not fit.predict(grid, np.full(65, voltage))[-1] > fit.predict(grid, np.full(65, voltage))[0]:
            return "thrust does not rise with PWM"
        if np.any(np.diff(fit.predict(grid, np.full(65, voltage))) < -1e-3 * fit.predict(1.0, voltage)):
            return "thrust falls with rising PWM somewhere in the range of the rows"
    return ""


def _no_voltage(candidate: Map, stands: Sequence[Stand]) -> str:
    if not candidate.uses_voltage:
        return ""
    if any(s.battery_V is None for s in stands):
        return "no battery voltage in " + ", ".join(s.name for s in stands if s.battery_V is None)
    seen = np.concatenate([s.voltage for s in stands])
    if candidate.fixed is None and candidate.rank < FROM_ELSEWHERE and np.ptp(seen) < STEADY_V:
        return f"the battery voltage never changes ({seen[0]:.3f} V): no law of the voltage can be fitted"
    return ""
