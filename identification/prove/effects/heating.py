"""Foreign: motors lose strength as they get warm, at any voltage."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, near


class Heating(Effect):
    name = "heating"
    foreign = True
    sizes: ClassVar = {"small": "4 % of the thrust in the long run", "medium": "6 %", "large": "8 %"}
    wants = ("charges", "lateral", "vertical")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"loss": near(rng, {"small": 0.04, "medium": 0.06, "large": 0.08}[size]), "time_s": near(rng, 12.0)}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        return {"loss": p["loss"], "time_s": p["time_s"], "warm": 0.0}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        return np.asarray((1.0 - self.a["loss"] * self.a["warm"]) * thrust_N)

    def advance(self, dt_s: float, motor: np.ndarray) -> None:
        running = (motor > 0.1).all(axis=0)
        self.a["warm"] = self.a["warm"] + dt_s / self.a["time_s"] * (running - self.a["warm"])
        self.a["warm"] = np.clip(self.a["warm"], 0.0, 1.0)
