"""Thousands of prediction windows at once, as fast as the processor allows; the same numbers as ``numeric.rollout``."""

import functools

import numpy as np

from . import symbolic
from .batched import Compiled, scan
from .inputs import parameter_values, rows, settled
from .model import Model
from .numeric import start_states


class _Structure:
    """A model as a key of compiled code: equal if the equations are, for any parameter values."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.model.structure == other.model.structure

    def __hash__(self) -> int:
        return hash(self.model.structure)


@functools.lru_cache(maxsize=64)
def _compiled(structure: _Structure, name: str, row_hz: float, own_parameters: bool) -> Compiled:
    return scan(getattr(symbolic, name)(structure.model, row_hz), ["u"], [] if own_parameters else ["p"])


def compiled_step(model: Model, row_hz: float | None = None, *, own_parameters: bool = False) -> Compiled:
    """``symbolic.step`` (x, u, p) compiled to run over rows; ``own_parameters``: every window has its own p."""
    return _compiled(_Structure(model), "step", row_hz or model.vehicle.rate_hz, own_parameters)


def compiled_lagged(model: Model, row_hz: float | None = None, *, own_parameters: bool = False) -> Compiled:
    """``symbolic.lagged`` (r, u, p), rotor states alone, compiled to run over rows."""
    return _compiled(_Structure(model), "lagged", row_hz or model.vehicle.rate_hz, own_parameters)


def _warmed(model: Model, window: np.ndarray, past: np.ndarray, row_hz: float, parameters: np.ndarray,
            threads: int) -> np.ndarray:
    """The same numbers as ``inputs.warmed``."""
    if "motor_lag" not in model or not len(past):
        return settled(model, past[-1] if len(past) else window[0], row_hz=row_hz, parameters=parameters)
    follow = compiled_lagged(model, row_hz, own_parameters=parameters.ndim == 2).on_threads(threads)
    first = settled(model, past[0], row_hz=row_hz, parameters=parameters)
    return follow(first, past, parameters.T, keep="last")[0]


def rollout(model: Model, start: np.ndarray, motor: np.ndarray, battery_V: np.ndarray,
            past: tuple[np.ndarray, np.ndarray] | None = None, *, row_hz: float | None = None,
            parameters: np.ndarray | None = None, threads: int = 1) -> np.ndarray:
    """States (n, H + 1, 13 + rotors) of n windows of H rows, the start first; see ``Model.state`` for the order.

    ``start`` (n, 13) position, velocity, quaternion, rate, or with the rotor states too, which are otherwise warmed up;
    ``motor`` (n, H, rotors) PWM ratio or rad/s and battery_V (n, H), held over a row; ``past`` (motor, battery) has
    the same of the rows before the start, for the warm-up and for a delay.

    row_hz: rate of the rows, by default the model's rate_hz; ``parameters`` (P,) or (n, P) in place of the model's.
    Raises InputError for shapes that do not fit.
    """
    row_hz = row_hz or model.vehicle.rate_hz
    window, before = rows(model, motor, battery_V, past, row_hz=row_hz, parameters=parameters)
    values = parameter_values(model, parameters)
    states = start_states(model, start, lambda: _warmed(model, window, before, row_hz, values, threads))
    step = compiled_step(model, row_hz, own_parameters=values.ndim == 2).on_threads(threads)
    return step(states, window, values.T)[0].transpose(2, 0, 1)
