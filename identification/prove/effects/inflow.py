"""Climbing takes thrust, flying sideways gives some."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near


class Inflow(Effect):
    name = "inflow"
    parameters = ("k_z", "k_h")
    sizes: ClassVar = {"small": "2 % of thrust per m/s of climb, 0.5 % at 1 m/s sideways", "medium": "5 % and 1.5 %",
             "large": "12 % and 4 %"}
    wants = ("vertical", "fast", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        k_z, k_h = {"small": (0.02, 0.005), "medium": (0.05, 0.015), "large": (0.12, 0.04)}[size]
        return {"k_z": near(rng, k_z), "k_h": near(rng, k_h)}

    def thrust(self, thrust_N: np.ndarray, air: Air) -> np.ndarray:
        x, y, z = air.velocity_b
        return np.asarray((1.0 - self.a["k_z"] * z + self.a["k_h"] * (x * x + y * y)) * thrust_N)
