"""Foreign: an elastic tether to a point of the floor, or a cable whose weight grows with the height."""

from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned

BEYOND_M = 0.5


class Tether(Effect):
    name = "tether"
    foreign = True
    sizes: ClassVar = {"small": "0.2 m/s^2 half a metre beyond its length (cable: per metre of height)",
                        "medium": "0.5 m/s^2",
             "large": "1.0 m/s^2"}
    wants = ("vertical", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        strength = near(rng, {"small": 0.2, "medium": 0.5, "large": 1.0}[size]) * airframe.mass_kg
        if rng.uniform() < 0.5:
            return {"kind": "cable", "N_per_m": strength}
        x, y, _ = turned(rng, rng.uniform(0.2, 0.6))
        return {"kind": "spring", "N_per_m": strength / BEYOND_M, "anchor_m": [x, y, 0.0],
                "length_m": float(rng.uniform(0.8, 1.0))}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        cable = p["kind"] == "cable"
        return {"anchor": [0.0, 0.0, 0.0] if cable else p["anchor_m"], "length": 0.0 if cable else p["length_m"],
                "k": p["N_per_m"], "cable": float(cable)}

    def push(self, air: Air) -> np.ndarray:
        away = air.position - self.a["anchor"]
        distance = np.maximum(np.sqrt((away * away).sum(axis=0)), 1e-6)
        pull = -self.a["k"] * np.maximum(distance - self.a["length"], 0.0) * away / distance
        down = np.zeros_like(away)
        down[2] = -self.a["k"] * np.maximum(away[2], 0.0)
        return np.asarray(np.where(self.a["cable"] > 0.5, down, pull))
