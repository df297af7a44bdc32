"""The thrust map of a model both ways: what a motor can give at the battery's voltage, and the PWM that gives it."""

import numba as nb
import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.physics.model import Model
from nanobench_tools.physics.numeric import equations

LEAST_V, MOST_V, VOLTAGES, RATIOS = 2.4, 4.6, 89, 257


@nb.njit(cache=True)
def _place(volt: float) -> tuple[int, float]:
    """In rows of the table: the one below, and the share of the next."""
    place = (min(max(volt, LEAST_V), MOST_V) - LEAST_V) * ((VOLTAGES - 1) / (MOST_V - LEAST_V))
    low = min(int(place), VOLTAGES - 2)
    return low, place - low


@nb.njit(cache=True)
def _thrust(table: np.ndarray, low: int, share: float, motor: int, k: int) -> float:
    """Of one motor at the k-th ratio."""
    between: float = table[low, motor, k] + share * (table[low + 1, motor, k] - table[low, motor, k])
    return between


@nb.njit(cache=True)
def _limits(table: np.ndarray, volts: np.ndarray, out: np.ndarray) -> None:
    for n in range(out.shape[1]):
        low, share = _place(volts[n])
        for motor in range(4):
            for end, k in enumerate((0, RATIOS - 1)):
                out[end, n, motor] = _thrust(table, low, share, motor, k)


@nb.njit(cache=True)
def _ratios(table: np.ndarray, volts: np.ndarray, thrust: np.ndarray, out: np.ndarray) -> None:
    last = RATIOS - 1
    for n in range(out.shape[0]):
        low, share = _place(volts[n])
        for motor in range(4):
            k, above = 0, last  # the last ratio whose thrust is not more than the command
            while above - k > 1:
                middle = (k + above) // 2
                if _thrust(table, low, share, motor, middle) <= thrust[n, motor]:
                    k = middle
                else:
                    above = middle
            least = _thrust(table, low, share, motor, k)
            wide = _thrust(table, low, share, motor, k + 1) - least
            part = (thrust[n, motor] - least) / wide if wide > 0.0 else 1.0
            out[n, motor] = (k + min(max(part, 0.0), 1.0)) / last


class ThrustMap:
    """Of a model whose input is PWM: its thrust map, limits and gains. The terms themselves evaluate it on a grid of
    RATIOS by VOLTAGES; it is linear between. Raises InputError for a model driven by rotor speed."""

    def __init__(self, model: Model) -> None:
        if model.vehicle.input != "pwm":
            raise InputError("model", f"input {model.vehicle.input!r}", "predictive controllers command PWM; "
                             "give a simulator with a thrust map of PWM")
        made = equations(model, 0.01)
        volts = np.linspace(LEAST_V, MOST_V, VOLTAGES)[:, None]
        ratio, volt = np.broadcast_arrays(np.linspace(0.0, 1.0, RATIOS), volts)
        found = [np.broadcast_to(t, ratio.shape) for t in made.command([ratio] * 4 + [volt])]
        rising = np.maximum.accumulate(np.maximum(np.stack(found, axis=1), 0.0), axis=2)
        self._table = np.ascontiguousarray(rising)

    def limits(self, battery_V: np.ndarray) -> np.ndarray:
        """battery (n,) V -> least and most thrust [N] of each motor (2, n, 4)."""
        out = np.empty((2, len(battery_V), 4))
        _limits(self._table, battery_V, out)
        return out

    def ratios(self, thrust_N: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        """Thrusts (n, 4) N at battery (n,) V -> PWM ratios (n, 4) within 0..1."""
        out = np.empty((len(battery_V), 4))
        _ratios(self._table, battery_V, thrust_N, out)
        return out
