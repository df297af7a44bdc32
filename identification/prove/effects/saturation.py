"""Motors that can do no more than so much, though asked."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters


class Saturation(Effect):
    name = "saturation"
    parameters = ("T_max_N",)
    sizes: ClassVar = {"small": "most thrust 15 % above hover, met 2 % of the time in climbs", "medium": "13 %",
                        "large": "11 %; at 9 % the vehicle falls"}
    wants = ("full", "vertical", "turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        more = 1.0 + {"small": 0.15, "medium": 0.13, "large": 0.11}[size]
        return {"T_max_N": float(f"{more * airframe.mass_kg * 9.81 / 4.0:.4g}")}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        return np.asarray(np.minimum(thrust_N, self.a["T_max_N"]))
