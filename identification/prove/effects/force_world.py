"""A constant force in the world: a cable's pull, a magnet far away."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned


class ForceWorld(Effect):
    name = "force_world"
    parameters = ("f_N",)
    sizes: ClassVar = {"small": "0.06 m/s^2 on this mass", "medium": "0.15 m/s^2", "large": "0.4 m/s^2"}
    wants = ("turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        strength = near(rng, {"small": 0.06, "medium": 0.15, "large": 0.4}[size]) * airframe.mass_kg
        return {"f_N": [float(f"{x:.4g}") for x in turned(rng, strength)]}

    def push(self, air: Air) -> np.ndarray:
        return np.broadcast_to(self.a["f_N"], air.position.shape)
