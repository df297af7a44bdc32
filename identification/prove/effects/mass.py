"""Another mass than the simulator's, at the place of the centre of mass: inertia stays."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, either, near


class Mass(Effect):
    name = "mass"
    parameters = ("m",)
    sizes: ClassVar = {"small": "2 % of the weight: 0.8 g, a marker set", "medium": "5 %: 2 g, a deck",
                        "large": "12 %: 4.7 g"}
    wants = ("lateral", "vertical")
    twins = ("thrust_scale",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        share = near(rng, {"small": 0.02, "medium": 0.05, "large": 0.12}[size]) * either(rng)
        return {"m": float(f"{airframe.mass_kg * (1.0 + share):.5g}")}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, mass_kg=p["m"])
