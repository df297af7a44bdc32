"""All motors weaker or stronger by one factor: worn propellers, thin air."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, either, near


class ThrustScale(Effect):
    name = "thrust_scale"
    parameters = ("s",)
    sizes: ClassVar = {"small": "2 % of the thrust, as between propeller sets", "medium": "5 %", "large": "12 %"}
    wants = ("lateral", "vertical")
    twins = ("mass",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"s": near(rng, {"small": 0.02, "medium": 0.05, "large": 0.12}[size]) * either(rng) + 1.0}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, curve_N_V=tuple(p["s"] * c for c in airframe.curve_N_V))
