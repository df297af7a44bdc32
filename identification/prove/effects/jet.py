"""Foreign: a jet of air at one place of the room."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned


class Jet(Effect):
    name = "jet"
    foreign = True
    sizes: ClassVar = {"small": "0.5 m/s^2 at its middle, 0.35 m wide", "medium": "1.0 m/s^2", "large": "1.8 m/s^2"}
    wants = ("lateral", "fast")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        peak = near(rng, {"small": 0.5, "medium": 1.0, "large": 1.8}[size])
        x, y, _ = turned(rng, rng.uniform(0.5, 0.9))
        return {"peak_m_s2": peak, "place_m": [x, y, 1.0], "width_m": near(rng, 0.35), "push": turned(rng, 1.0, 0.3),
                "mass_kg": airframe.mass_kg}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        return {"f": [p["peak_m_s2"] * p["mass_kg"] * x for x in p["push"]], "at": p["place_m"], "width": p["width_m"]}

    def push(self, air: Air) -> np.ndarray:
        away = air.position - self.a["at"]
        return np.asarray(self.a["f"] * np.exp(-0.5 * (away * away).sum(axis=0) / self.a["width"] ** 2))
