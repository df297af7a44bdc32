"""The air of the room moves."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, near, turned


class Wind(Effect):
    name = "wind"
    parameters = ("w_m_s",)
    sizes: ClassVar = {"small": "0.15 m/s, a draught", "medium": "0.4 m/s", "large": "1.0 m/s, a fan"}
    wants = ("turning", "fast", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        speed = near(rng, {"small": 0.15, "medium": 0.4, "large": 1.0}[size])
        return {"w_m_s": [float(f"{x:.4g}") for x in turned(rng, speed, 0.2)]}

    def wind(self) -> np.ndarray:
        return self.a["w_m_s"]
