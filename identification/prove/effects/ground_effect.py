"""More thrust near the ground, z = 0 of the room (Cheeseman and Bennett 1955), as four rotors and a body feel it."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near

LOWEST_RADII = 0.5


class GroundEffect(Effect):
    name = "ground_effect"
    sizes: ClassVar = {"small": "1.5 % more thrust 0.15 m above the ground", "medium": "3.5 %", "large": "7 %"}
    wants = ("low", "vertical")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        gain = near(rng, {"small": 0.015, "medium": 0.035, "large": 0.07}[size])
        rho = near(rng, 2.5)
        radius = 4.0 * 0.15 * float(np.sqrt((1.0 - 1.0 / (1.0 + gain)) / rho))  # of the air cushion, not of a blade
        return {"rho": rho, "R": float(f"{radius:.4g}")}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        return {"rho": p["rho"], "R": p["R"]}

    @staticmethod
    def term(p: Parameters, airframe: Airframe) -> Parameters:
        return {"rho": p["rho"], "R": p["R"]}

    def thrust(self, thrust_N: np.ndarray, air: Air) -> np.ndarray:
        height = np.maximum(air.position[2], LOWEST_RADII * self.a["R"])
        return np.asarray(thrust_N / (1.0 - self.a["rho"] * (self.a["R"] / (4.0 * height)) ** 2))
