"""A model as a predictor of Task 1, class ``state``: start state and inputs only."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..methods import Prediction, Windows
from ..results.fitted_values import Estimate
from . import numeric, rollout
from .model import POSITION, QUATERNION, RATE, VELOCITY, Model
from .simulator import read_simulator


class ModelPredictor:
    """Flies a model from the start of every window with the inputs of the window.

    Rotors and delayed commands begin with the inputs before the start, where the windows hold them. Compiled code where
    CasADi is installed, else NumPy; the numbers are the same.
    """

    information = "state"

    def __init__(self, model: Model, name: str = "physics") -> None:
        if model.vehicle.input != "pwm":
            raise InputError(f"model {name}", f"input is {model.vehicle.input}",
                             "windows hold PWM; give a model with input pwm")
        self.model, self.name = model, name
        self._rollout = rollout.rollout if importlib.util.find_spec("casadi") else numeric.rollout

    @classmethod
    def from_file(cls, path: Path | str) -> ModelPredictor:
        """The model of a simulator.toml, named as the file."""
        return cls(read_simulator(path), Path(path).stem)

    @property
    def parameters(self) -> dict[str, Estimate]:
        """By name, without intervals."""
        return {name: Estimate(value, None, unit) for name, value, unit in zip(
            self.model.names, self.model.values.tolist(), self.model.units, strict=True)}

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        start = np.concatenate([windows.position_m, windows.velocity_m_s, windows.quaternion, windows.rate_rad_s], 1)
        past = None if windows.motor_past is None or windows.battery_past is None else (
            windows.motor_past, windows.battery_past)
        states = self._rollout(self.model, start, windows.motor, windows.battery_V, past, row_hz=windows.rate_hz)[:, 1:]
        return Prediction(*(states[..., part] for part in (POSITION, VELOCITY, QUATERNION, RATE)))
