"""Drag of turning blades: in proportion to air speed and to the sum of the rotor speeds."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near


class DragRotor(Effect):
    name = "drag_rotor"
    parameters = ("d",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s in hover", "medium": "0.35 m/s^2", "large": "0.8 m/s^2"}
    wants = ("fast", "lateral", "vertical", "turning")
    twins = ("drag_linear",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        hover = 4.0 * (airframe.mass_kg * 9.81 / 4.0 / airframe.k_f_N_s2) ** 0.5
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        return {"d": [float(f"{near(rng, rate * share) * airframe.mass_kg / hover:.4g}") for share in (1.0, 1.0, 0.2)]}

    def force(self, air: Air) -> np.ndarray:
        return np.asarray(-air.rotor.sum(axis=0) * self.a["d"] * air.air_b)
