"""Foreign: slow random gusts far above the air of a closed room."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from nanobench_tools.practice.estimator import correlated_noise

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near

TICK_S, TICKS = 0.01, 9000


class Gusts(Effect):
    name = "gusts"
    foreign = True
    sizes: ClassVar = {"small": "0.25 m/s^2 standard deviation", "medium": "0.5 m/s^2", "large": "0.8 m/s^2"}
    wants = ("lateral",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"sd_m_s2": near(rng, {"small": 0.25, "medium": 0.5, "large": 0.8}[size]),
                "time_s": near(rng, 1.2), "seed": int(rng.integers(2**31)), "mass_kg": airframe.mass_kg}

    @staticmethod
    def arrays(p: Parameters, airframe: Airframe) -> Parameters:
        rng = np.random.default_rng([p["seed"], p["flight"]])
        series = correlated_noise(rng, TICKS, 3, p["time_s"]) * np.array([1.0, 1.0, 0.6])
        return {"series": p["sd_m_s2"] * p["mass_kg"] * series}

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        super().__init__(arrays)
        self._time_s = 0.0

    def push(self, air: Air) -> np.ndarray:
        return np.asarray(self.a["series"][min(int(self._time_s / TICK_S + 1e-6), TICKS - 1)])

    def advance(self, dt_s: float, motor: np.ndarray) -> None:
        self._time_s += dt_s
