"""Drag with the square of the air speed, on top of what the simulator knows."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near


class DragQuadratic(Effect):
    name = "drag_quadratic"
    parameters = ("q",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s", "medium": "0.35 m/s^2 at 1 m/s", "large": "0.8 m/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "slow", "turning")
    twins = ()

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        return {"q": [float(f"{near(rng, rate * share) * airframe.mass_kg:.4g}") for share in (1.0, 1.0, 0.5)]}

    def force(self, air: Air) -> np.ndarray:
        return np.asarray(-self.a["q"] * np.abs(air.air_b) * air.air_b)
