"""Foreign: one motor loses strength for moments, at random: a loose contact."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, near

MOST = 120
"""So many losses are drawn for a flight; they last beyond any of these recordings."""


class Dropout(Effect):
    name = "dropout"
    foreign = True
    sizes: ClassVar = {"small": "15 % lost for about 0.12 s, every 1.5 s", "medium": "30 %", "large": "45 %"}
    wants = ("lateral",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"loss": near(rng, {"small": 0.15, "medium": 0.30, "large": 0.45}[size]), "every_s": near(rng, 1.5),
                "motor": int(rng.integers(4)), "seed": int(rng.integers(2**31))}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        rng = np.random.default_rng([p["seed"], p["flight"]])
        begin = np.cumsum(0.2 + rng.exponential(p["every_s"], MOST))
        return {"begin": begin, "end": begin + rng.uniform(0.06, 0.18, MOST), "t": 0.0,
                "loss": [p["loss"] * (i == p["motor"]) for i in range(4)]}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        away = ((self.a["t"] >= self.a["begin"]) & (self.a["t"] < self.a["end"])).any(axis=0)
        return np.asarray((1.0 - self.a["loss"] * away) * thrust_N)

    def advance(self, dt_s: float, motor: np.ndarray) -> None:
        self.a["t"] = self.a["t"] + dt_s
