"""A fitted model as a predictor of Task 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.physics.predictor import ModelPredictor
from nanobench_tools.physics.rollout import rollout

from .balance import balance
from .observer import Observer
from .solve import Nuisance


@dataclass(frozen=True)
class GreyBoxPredictor:
    """``adapt`` none: the model as it is. ``inputs``: thrust and trim of every window follow from the inputs of the
    half second before it and the start state, class ``state``. ``past``: from all streams before it. gains (N, F):
    nuisances from features; scale (K, 4): usual errors on the training flights."""

    name: str
    terms: dict[str, dict[str, Any]]
    vehicle: Vehicle
    adapt: str = "none"
    gains: np.ndarray | None = None
    scale: np.ndarray | None = None
    parameters: dict[str, dict] = field(default_factory=dict)
    nuisances_: tuple[Nuisance, ...] = ()

    @property
    def information(self) -> str:
        return "past" if self.adapt == "past" else "state"

    @property
    def model(self) -> Model:
        return Model(self.vehicle, self.terms)

    def features(self, windows: Windows) -> np.ndarray:
        """What the gains are applied to, (n, F)."""
        model = self.model
        start = start_of(windows)
        found = balance(model, start, windows.motor, windows.battery_V, past_inputs(windows), windows.rate_hz)
        if self.adapt != "past":
            return found
        if windows.past is None:
            raise InputError(f"predictor {self.name}", "windows without the streams before the start",
                             "cut them with past=True")
        observer = Observer(model, self.nuisances_, cast("np.ndarray", self.scale))
        return np.concatenate([observer.features(windows), found], axis=1)

    def nuisances(self, windows: Windows) -> np.ndarray:
        """Values (n, N) of what differs, per window."""
        return self.features(windows) @ cast("np.ndarray", self.gains).T

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        model = self.model
        if self.gains is None:
            return ModelPredictor(model, self.name).predict(windows)
        patterns = np.array([n.vector(model) for n in self.nuisances_])
        values = model.values + self.nuisances(windows) @ patterns
        states = rollout(model, start_of(windows), windows.motor, windows.battery_V, past_inputs(windows),
                         row_hz=windows.rate_hz, parameters=values)[:, 1:]
        return Prediction(*(states[..., part] for part in (POSITION, VELOCITY, QUATERNION, RATE)))


def start_of(windows: Windows) -> np.ndarray:
    """(n, 13)."""
    return np.concatenate([windows.position_m, windows.velocity_m_s, windows.quaternion, windows.rate_rad_s], axis=1)


def past_inputs(windows: Windows) -> tuple[np.ndarray, np.ndarray]:
    """Inputs before the start; the first row of the window where there are none."""
    if windows.motor_past is None or windows.battery_past is None:
        return windows.motor[:, :1], windows.battery_V[:, :1]
    return windows.motor_past, windows.battery_past
