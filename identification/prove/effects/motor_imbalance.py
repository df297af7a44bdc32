"""Motors of unequal strength: a chipped propeller, a worn bearing."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters


class MotorImbalance(Effect):
    name = "motor_imbalance"
    parameters = ("g",)
    sizes: ClassVar = {"small": "the worst motor 2 % off", "medium": "5 %", "large": "10 %"}
    wants = ("lateral", "vertical", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        g = rng.standard_normal(4)
        g -= g.mean()
        g *= {"small": 0.02, "medium": 0.05, "large": 0.10}[size] / np.abs(g).max()
        return {"g": [float(x) for x in np.round(1.0 + g, 5)]}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        return np.asarray(self.a["g"] * thrust_N)
