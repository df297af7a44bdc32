"""The centre of mass is offset from the point between the motors: forces turn the vehicle about it."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near


class ComOffset(Effect):
    name = "com_offset"
    parameters = ("r_m",)
    sizes: ClassVar = {"small": "0.5 mm, a battery not quite in its place", "medium": "1.5 mm", "large": "4 mm"}
    wants = ("lateral", "vertical", "turning")
    twins = ()

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        length, way = near(rng, {"small": 5e-4, "medium": 1.5e-3, "large": 4e-3}[size]), rng.uniform(0.0, 2 * np.pi)
        return {"r_m": [float(f"{length * np.cos(way):.4g}"), float(f"{length * np.sin(way):.4g}"), 0.0]}

    def moment(self, air: Air) -> np.ndarray:
        (x, y, z), (fx, fy, fz) = self.a["r_m"], air.force_b
        return -np.stack([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])
