"""Foreign: a force that swings at a fixed frequency, with another phase in every flight."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned


class Periodic(Effect):
    name = "periodic"
    foreign = True
    sizes: ClassVar = {"small": "0.2 m/s^2 amplitude", "medium": "0.45 m/s^2", "large": "0.9 m/s^2"}
    wants = ("lateral",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"amplitude_m_s2": near(rng, {"small": 0.2, "medium": 0.45, "large": 0.9}[size]),
                "frequency_hz": float(f"{np.exp(rng.uniform(np.log(0.5), np.log(3.0))):.3g}"),
                "push": turned(rng, 1.0, np.pi / 2), "mass_kg": airframe.mass_kg}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        phase = 2.399963 * (p["flight"] + 1)  # the golden angle: no two flights alike
        return {"f": [p["amplitude_m_s2"] * p["mass_kg"] * x for x in p["push"]], "phase": phase,
                "w": 2.0 * np.pi * p["frequency_hz"]}

    def push(self, air: Air) -> np.ndarray:
        return np.asarray(self.a["f"] * np.sin(self.a["phase"]))

    def advance(self, dt_s: float, motor: np.ndarray) -> None:
        self.a["phase"] = self.a["phase"] + dt_s * self.a["w"]
