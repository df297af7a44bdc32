"""A fitted model as a predictor of Task 1."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.inputs import rows, warmed
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.physics.predictor import ModelPredictor
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.results.fitted_values import Estimate

from .balance_features import balance, newest
from .observer import Observer, gyro_before
from .solve import Nuisance
from .starts import moved
from .symmetry import Features


@dataclass(frozen=True)
class GreyBoxPredictor:
    """``adapt`` none: the model as it is. ``inputs``: thrust, trim, tilt and the corrections of the start. They follow
    from the inputs of the half second before a window and the start state. Class ``state``. ``past``: from all streams
    before it. ``gains`` (N, F + 1): nuisances from features and a constant; ``scale`` (K, 4): usual errors on the
    training flights."""

    name: str
    terms: Mapping[str, Mapping[str, Any]]
    vehicle: Vehicle
    adapt: str = "none"
    gains: np.ndarray | None = None
    scale: np.ndarray | None = None
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    nuisances_: tuple[Nuisance, ...] = ()

    @property
    def information(self) -> str:
        return "past" if self.adapt == "past" else "state"

    @property
    def model(self) -> Model:
        return Model(self.vehicle, self.terms)

    def features(self, windows: Windows) -> Features:
        """What the gains are applied to."""
        model, found = self.model, Features()
        past = past_inputs(windows)
        if self.adapt == "past":
            if windows.past is None:
                raise InputError(f"predictor {self.name}", "windows without the streams before the start",
                                 "cut them with past=True")
            observed = tuple(n for n in self.nuisances_ if not n.of_start)
            Observer(model, observed, cast("np.ndarray", self.scale)).features(windows, found)
            gyro_before(windows, found)
        else:
            newest(past, found)
        balance(model, start_of(windows), windows.motor, windows.battery_V, past, windows.rate_hz, found)
        return found

    def nuisances(self, windows: Windows) -> np.ndarray:
        """Values (n, N) of what differs, per window."""
        features = self.features(windows).matrix()
        gains = cast("np.ndarray", self.gains)
        return np.asarray(features @ gains[:, :-1].T + gains[:, -1])

    def adapted(self, windows: Windows) -> tuple[np.ndarray, np.ndarray]:
        """Starts (n, 17) with rotors, and parameters (n, P)."""
        model, own = self.model, self.nuisances(windows)
        values = model.values + own @ np.array([n.vector(model) for n in self.nuisances_])
        window, before = rows(model, windows.motor[:, :1], windows.battery_V[:, :1], past_inputs(windows),
                              row_hz=windows.rate_hz, parameters=values)
        rotors = warmed(model, window, before, row_hz=windows.rate_hz, parameters=values).T
        return moved(start_of(windows), rotors, own @ np.array([n.start() for n in self.nuisances_])), values

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        if self.gains is None:
            return ModelPredictor(self.model, self.name).predict(windows)
        start, values = self.adapted(windows)
        states = rollout(self.model, start, windows.motor, windows.battery_V, past_inputs(windows),
                         row_hz=windows.rate_hz, parameters=values)[:, 1:]
        return Prediction(*(states[..., part] for part in (POSITION, VELOCITY, QUATERNION, RATE)))


def start_of(windows: Windows) -> np.ndarray:
    """(n, 13)."""
    return np.concatenate([windows.position_m, windows.velocity_m_s, windows.quaternion, windows.rate_rad_s], axis=1)


def past_inputs(windows: Windows) -> tuple[np.ndarray, np.ndarray]:
    """Inputs before the start; the first row of the window if they are missing."""
    if windows.motor_past is None or windows.battery_past is None:
        return windows.motor[:, :1], windows.battery_V[:, :1]
    return windows.motor_past, windows.battery_past
