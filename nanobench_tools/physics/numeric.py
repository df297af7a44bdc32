"""A model evaluated with NumPy over a batch: the readable reference the faster ways are measured against."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError
from .equations import Equations
from .inputs import components, parameter_values, rows, substeps, warmed
from .model import QUATERNION, RIGID, ROTOR, Model
from .ops import NUMPY


def equations(model: Model, row_s: float, parameters: np.ndarray | None = None) -> Equations:
    """The model's equations over arrays; parameters (P,) or (n, P), by default the model's own."""
    return Equations(model, components(parameter_values(model, parameters)), NUMPY, row_s)


def _stacked(found: list[Any], n: int) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(x, float), (n,)) for x in found], axis=-1)


def derivative(model: Model, states: np.ndarray, inputs: np.ndarray, parameters: np.ndarray | None = None, *,
               row_hz: float | None = None) -> np.ndarray:
    """states (n, 13 + rotors), inputs (n, I) -> their time derivatives."""
    made = equations(model, 1.0 / (row_hz or model.vehicle.rate_hz), parameters)
    return _stacked(made.derivative(list(np.asarray(states, float).T), list(np.asarray(inputs, float).T)), len(states))


def step(model: Model, states: np.ndarray, inputs: np.ndarray, parameters: np.ndarray | None = None, *,
         row_hz: float | None = None) -> np.ndarray:
    """states (n, 13 + rotors), inputs (n, I) -> states one row later."""
    return stepper(model, parameters, row_hz=row_hz)(states, inputs)


def stepper(model: Model, parameters: np.ndarray | None = None, *,
            row_hz: float | None = None) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """``step`` of states and inputs, for many rows."""
    row_hz = row_hz or model.vehicle.rate_hz
    made, count = equations(model, 1.0 / row_hz, parameters), substeps(model, row_hz)

    def one(states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        found = made.step(list(np.asarray(states, float).T), list(np.asarray(inputs, float).T), count)
        return _stacked(found, len(states))

    return one


def start_states(model: Model, start: np.ndarray, warm: Callable[[], np.ndarray]) -> np.ndarray:
    """start (n, 13) or (n, S), S = 13 + rotors -> (S, n) with unit quaternions. Missing rotor states are ``warm()``."""
    start = np.asarray(start, float)
    size = RIGID + model.rotors
    if start.ndim != 2 or start.shape[1] not in (RIGID, size):
        raise InputError("start", f"shape {start.shape}", f"give (windows, {RIGID}) or (windows, {size})")
    states = np.empty((size, len(start)))
    states[:RIGID] = start[:, :RIGID].T
    states[QUATERNION] /= np.sqrt(np.sum(states[QUATERNION] ** 2, axis=0))
    states[ROTOR] = start[:, ROTOR].T if start.shape[1] == size else warm()
    return states


def rollout(model: Model, start: np.ndarray, motor: np.ndarray, battery_V: np.ndarray,
            past: tuple[np.ndarray, np.ndarray] | None = None, *, row_hz: float | None = None,
            parameters: np.ndarray | None = None) -> np.ndarray:
    """The same as ``rollout.rollout``, in plain NumPy: states (n, H + 1, 13 + rotors)."""
    row_hz = row_hz or model.vehicle.rate_hz
    window, before = rows(model, motor, battery_V, past, row_hz=row_hz, parameters=parameters)
    states = np.empty((len(window) + 1, RIGID + model.rotors, len(start)))
    states[0] = start_states(model, start, lambda: warmed(model, window, before, row_hz=row_hz, parameters=parameters))
    made, count = equations(model, 1.0 / row_hz, parameters), substeps(model, row_hz)
    for j, row in enumerate(window):
        for i, component in enumerate(made.step(list(states[j]), list(row), count)):
            states[j + 1, i] = component
    return states.transpose(2, 0, 1)
