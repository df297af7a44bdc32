"""Effects that no term of the vocabulary describes."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from nanobench_tools.practice.estimator import correlated_noise

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned

BEYOND_M = 0.5
MOST = 120
"""So many losses are drawn for a flight; they last beyond any of these recordings."""
TICK_S, TICKS = 0.01, 9000


class Jet(Effect):
    """A jet of air at one place of the room."""

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


class Heating(Effect):
    """Motors lose strength as they get warm, at any voltage."""

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


class Periodic(Effect):
    """A force that swings at a fixed frequency, with another phase in every flight."""

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


class Tether(Effect):
    """An elastic tether to a point of the floor, or a cable whose weight grows with the height."""

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


class Dropout(Effect):
    """One motor loses strength for moments, at random: a loose contact."""

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


class Gusts(Effect):
    """Slow random gusts far above the air of a closed room."""

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
