"""The thrust map of a model both ways: what a motor can give at the battery's voltage, and the PWM that gives it."""

from __future__ import annotations

import numba as nb
import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.physics.model import Model
from nanobench_tools.physics.numeric import equations

LEAST_V, MOST_V, VOLTAGES, RATIOS = 2.4, 4.6, 89, 257


@nb.njit(cache=True)
def _row(table, place, motor, out):
    """Thrusts of one motor over the ratios at a voltage (in rows of the table), into out."""
    i = min(int(place), table.shape[0] - 2)
    share = place - i
    for k in range(out.shape[0]):
        out[k] = table[i, motor, k] + share * (table[i + 1, motor, k] - table[i, motor, k])


@nb.njit(cache=True)
def _limits(table, places, out):
    row = np.empty(table.shape[2])
    for n in range(out.shape[1]):
        for motor in range(4):
            _row(table, places[n], motor, row)
            out[0, n, motor], out[1, n, motor] = row[0], row[-1]


@nb.njit(cache=True)
def _ratios(table, places, thrust, out):
    last = table.shape[2] - 1
    row = np.empty(last + 1)
    for n in range(out.shape[0]):
        for motor in range(4):
            _row(table, places[n], motor, row)
            k = min(max(np.searchsorted(row, thrust[n, motor], "right") - 1, 0), last - 1)
            wide = row[k + 1] - row[k]
            share = (thrust[n, motor] - row[k]) / wide if wide > 0.0 else 1.0
            out[n, motor] = (k + min(max(share, 0.0), 1.0)) / last


class ThrustMap:
    """Of a model whose input is PWM: its thrust map, limits and gains, evaluated by the terms themselves on a grid of
    RATIOS by VOLTAGES and linear between. Raises InputError for a model driven by rotor speed."""

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

    def _places(self, battery_V: np.ndarray) -> np.ndarray:
        return (np.minimum(np.maximum(battery_V, LEAST_V), MOST_V) - LEAST_V) * ((VOLTAGES - 1) / (MOST_V - LEAST_V))

    def limits(self, battery_V: np.ndarray) -> np.ndarray:
        """battery (n,) V -> least and most thrust [N] of each motor (2, n, 4)."""
        out = np.empty((2, len(battery_V), 4))
        _limits(self._table, self._places(battery_V), out)
        return out

    def ratios(self, thrust_N: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        """Thrusts (n, 4) N at battery (n,) V -> PWM ratios (n, 4) within 0..1."""
        out = np.empty((len(battery_V), 4))
        _ratios(self._table, self._places(battery_V), np.ascontiguousarray(thrust_N, float), out)
        return out
