"""Air brakes turning."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near


class AngularDamping(Effect):
    name = "angular_damping"
    parameters = ("d_r",)
    sizes: ClassVar = {"small": "a rate left alone would fall to 1/e in 1 s", "medium": "in 0.3 s", "large": "in 0.1 s"}
    wants = ("fast", "turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = near(rng, {"small": 1.0, "medium": 3.3, "large": 10.0}[size])
        return {"d_r": [float(f"{rate * j:.4g}") for j in airframe.inertia_kg_m2]}

    def moment(self, air: Air) -> np.ndarray:
        return np.asarray(-self.a["d_r"] * air.rate)
