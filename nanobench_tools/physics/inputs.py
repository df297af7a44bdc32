"""Rows of inputs for a batch of windows: the commands shifted by the delay, and rotors warmed up before the start."""

import math
from typing import Any

import numpy as np

from ..errors import InputError
from .equations import Equations
from .model import Model
from .ops import NUMPY


def parameter_values(model: Model, parameters: np.ndarray | None) -> np.ndarray:
    """The model's values, or those given, (P,) or (n, P); raises InputError for another number of them."""
    values = model.values if parameters is None else np.asarray(parameters, float)
    if values.ndim not in (1, 2) or values.shape[-1] != len(model.names):
        raise InputError("parameters", f"shape {values.shape}", f"give {len(model.names)} values: {model.names}")
    return values


def components(vector: np.ndarray) -> list[Any]:
    """Parameters (P,) or (n, P), one set per window -> P components, floats or arrays (n,)."""
    vector = np.asarray(vector, float)
    return vector.tolist() if vector.ndim == 1 else list(np.ascontiguousarray(vector.T))


def rows(model: Model, motor: np.ndarray, battery_V: np.ndarray, past: tuple[np.ndarray, np.ndarray] | None = None,
         *, row_hz: float, parameters: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(rows (H, I, n) of the window, rows (P, I, n) before it), I as in ``Model.inputs``.

    motor (n, H, rotors) PWM ratio or rad/s, battery_V (n, H); past: the same over the P rows before, P may be 0. A
    delay reaches into the past; before its first row that row is taken. Raises InputError for shapes that do not fit.
    """
    parts = [(motor, battery_V)] if past is None else [past, (motor, battery_V)]
    parts = [(np.asarray(m, float), np.asarray(b, float)) for m, b in parts]
    many = model.rotors
    for m, b in parts:
        if m.ndim != 3 or m.shape[2] != many or b.shape != m.shape[:2] or len(m) != len(parts[0][0]):
            raise InputError("inputs", f"motor has shape {m.shape}, battery {b.shape}",
                             f"give (windows, rows, {many}) and (windows, rows)")
    lengths = [m.shape[1] for m, _ in parts]
    if not lengths[-1]:
        raise InputError("inputs", "a window without rows", "give at least one")
    found = np.empty((sum(lengths), len(model.inputs), len(parts[0][0])))
    for (m, b), end, length in zip(parts, np.cumsum(lengths), lengths, strict=True):
        found[end - length:end, :many] = m.transpose(1, 2, 0)
        found[end - length:end, many] = b.T
    if "command_delay" in model:
        _delay(model, found, row_hz, parameter_values(model, parameters))
    count = sum(lengths[:-1])
    return found[count:], found[:count]


def _delay(model: Model, found: np.ndarray, row_hz: float, values: np.ndarray) -> None:
    """Shift the commands by the whole rows of the delay, and add those of one row earlier."""
    whole = np.maximum(np.floor(values[..., model.index("command_delay.delay_s")] * row_hz), 0.0)
    many = model.rotors
    undelayed, last = found[:, :many].copy(), np.arange(len(found))
    for shift, target in ((0, found[:, :many]), (1, found[:, many + 1:2 * many + 1])):
        if whole.ndim == 0:
            target[:] = undelayed[np.maximum(last - int(whole) - shift, 0)]
        else:
            row = np.maximum(last[:, None] - whole.astype(int) - shift, 0)
            target[:] = np.take_along_axis(undelayed, row[:, None], axis=0)
    found[:, 2 * many + 1] = whole


def settled(model: Model, row: np.ndarray, *, row_hz: float, parameters: np.ndarray | None = None) -> np.ndarray:
    """Thrusts (rotors, n) [N] of rotors that have followed the commands of a row (I, n) for long."""
    vector = components(parameter_values(model, parameters))
    thrust = Equations(model, vector, NUMPY, 1.0 / row_hz).command(list(row))
    return np.array([np.broadcast_to(t, row.shape[1:]) for t in thrust])


def warmed(model: Model, window: np.ndarray, past: np.ndarray, *, row_hz: float,
           parameters: np.ndarray | None = None) -> np.ndarray:
    """Rotor states (rotors, n) [N] at the start of windows, from the inputs before it alone; see ``rows``.

    At the first row before the start (without any: of the window) the rotors have settled to its command.
    """
    vector = components(parameter_values(model, parameters))
    equations = Equations(model, vector, NUMPY, 1.0 / row_hz)
    thrust = list(settled(model, past[0] if len(past) else window[0], row_hz=row_hz, parameters=parameters))
    for row in past:
        thrust = equations.lagged(thrust, list(row))
    return np.array([np.broadcast_to(t, window.shape[2:]) for t in thrust])


def substeps(model: Model, row_hz: float) -> int:
    """Steps of the integration in a row, none longer than 1 / rate_hz."""
    return max(1, math.ceil(model.vehicle.rate_hz / row_hz - 1e-9))
