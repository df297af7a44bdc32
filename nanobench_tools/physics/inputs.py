"""Rows of inputs for a batch of windows: the commands shifted by the delay, and rotors warmed up before the start."""

from __future__ import annotations

import math

import numpy as np

from ..errors import InputError
from .equations import Equations
from .model import Model
from .ops import NUMPY


def components(vector: np.ndarray) -> list:
    """Parameters (P,) or (n, P), one set per window -> P components, floats or arrays (n,)."""
    vector = np.asarray(vector, float)
    return vector.tolist() if vector.ndim == 1 else list(np.ascontiguousarray(vector.T))


def rows(model: Model, motor: np.ndarray, battery_V: np.ndarray, past: tuple[np.ndarray, np.ndarray] | None = None,
         *, row_hz: float, parameters: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(rows (H, I, n) of the window, rows (P, I, n) before it), I as in ``Model.inputs``.

    motor (n, H, 4) PWM ratio or rad/s, battery_V (n, H); past: the same over the P rows before, P may be 0. A delay
    reaches into the past; before its first row that row is taken. Raises InputError for shapes that do not fit.
    """
    motor, battery = np.asarray(motor, float), np.asarray(battery_V, float)
    if motor.ndim != 3 or motor.shape[2] != 4 or battery.shape != motor.shape[:2]:
        raise InputError("inputs", f"motor has shape {motor.shape}, battery {battery.shape}",
                         "give (windows, rows, 4) and (windows, rows)")
    count = 0
    if past is not None:
        before_motor, before_battery = (np.asarray(a, float) for a in past)
        count = before_motor.shape[1]
        motor = np.concatenate([before_motor, motor], axis=1)
        battery = np.concatenate([before_battery, battery], axis=1)
    whole = np.empty((len(model.inputs), motor.shape[1], len(motor)))
    whole[:4], whole[4] = np.moveaxis(motor, (2, 1, 0), (0, 1, 2)), battery.T
    if "command_delay" in model:
        values = model.values if parameters is None else np.asarray(parameters, float)
        delay = values[..., model.index("command_delay.delay_s")] * row_hz
        whole_rows = np.maximum(np.floor(delay), 0.0)
        row = np.arange(motor.shape[1])[:, None] - np.broadcast_to(whole_rows, (len(motor),)).astype(int)
        undelayed = whole[:4].copy()
        for shift, target in ((0, whole[:4]), (1, whole[5:9])):
            target[:] = np.take_along_axis(undelayed, np.maximum(row - shift, 0)[None], axis=1)
        whole[9] = whole_rows
    by_row = np.ascontiguousarray(whole.transpose(1, 0, 2))
    return by_row[count:], by_row[:count]


def warmed(model: Model, window: np.ndarray, past: np.ndarray, *, row_hz: float,
           parameters: np.ndarray | None = None) -> np.ndarray:
    """Rotor states (4, n) [N] at the start of windows, from the inputs before it alone; see ``rows`` for the arrays.

    At the first row before the start (without any: of the window) the rotors have settled to its command.
    """
    vector = components(model.values if parameters is None else parameters)
    equations = Equations(model, vector, NUMPY, 1.0 / row_hz)
    first = past[0] if len(past) else window[0]
    thrust = equations.command(list(first))
    for row in past:
        thrust = equations.lagged(thrust, list(row))
    return np.array([np.broadcast_to(t, first.shape[1:]) for t in thrust])


def substeps(model: Model, row_hz: float) -> int:
    """Steps of the integration in a row, none longer than 1 / rate_hz."""
    return max(1, math.ceil(model.vehicle.rate_hz / row_hz - 1e-9))
