"""What predictive control decided: thrusts over a horizon, and what they say later."""

import numba as nb
import numpy as np


class Plan:
    """Thrusts asked (n, N, 4) N from the time at which the command acts, every ``dt_s``."""

    def __init__(self, n: int, horizon: int, dt_s: float, thrust_N: float) -> None:
        self.dt_s = dt_s
        self.thrust_N = np.full((n, horizon, 4), thrust_N)
        self.age_s = np.zeros(n)

    def shifted(self, i: int, seconds: float) -> np.ndarray:
        """Thrusts (N, 4) of vehicle i, ``seconds`` later, linear between; the last is held."""
        return _shifted(self.thrust_N[i], seconds / self.dt_s)

    def now(self, limits: np.ndarray) -> np.ndarray:
        """Thrusts (n, 4) N now, within limits (2, n, 4)."""
        out = np.empty((len(self.age_s), 4))
        _now(self.thrust_N, self.age_s / self.dt_s, limits, out)
        return out


@nb.njit(cache=True)
def _shifted(thrusts: np.ndarray, stages: float) -> np.ndarray:
    """Thrusts (N, 4) so many stages later, linear between; the last is held."""
    last, out = thrusts.shape[0] - 1, np.empty_like(thrusts)
    for k in range(last + 1):
        at = min(k + stages, float(last))
        low = int(at)
        share = at - low
        for i in range(4):
            out[k, i] = (1.0 - share) * thrusts[low, i] + share * thrusts[min(low + 1, last), i]
    return out


@nb.njit(cache=True)
def _now(thrusts: np.ndarray, stages: np.ndarray, limits: np.ndarray, out: np.ndarray) -> None:
    for n in range(out.shape[0]):
        first = thrusts[n, 0] if stages[n] == 0.0 else _shifted(thrusts[n], stages[n])[0]
        for i in range(4):
            out[n, i] = min(max(first[i], limits[0, n, i]), limits[1, n, i])


@nb.njit(cache=True)
def bounded(thrusts: np.ndarray, least: np.ndarray, most: np.ndarray, out: np.ndarray) -> bool:
    """Writes thrusts (N, 4), within least and most (4,), into out; nothing and False if one of them is no number."""
    for k in range(thrusts.shape[0]):
        for i in range(4):
            if not np.isfinite(thrusts[k, i]):
                return False
    for k in range(thrusts.shape[0]):
        for i in range(4):
            out[k, i] = min(max(thrusts[k, i], least[i]), most[i])
    return True
