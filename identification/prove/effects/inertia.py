"""Another inertia about roll and pitch than the simulator's table; yaw stays, where only k_m / J_z could be seen."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, either, near


class Inertia(Effect):
    name = "inertia"
    parameters = ("inertia_kg_m2",)
    sizes: ClassVar = {"small": "15 % about one axis or both", "medium": "30 %", "large": "60 % (or 40 % less)"}
    wants = ("lateral", "fast")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        way = either(rng)
        share = near(rng, {"small": 0.15, "medium": 0.30, "large": 0.60 if way > 0.0 else 0.40}[size])
        axes = ((True, True), (True, False), (False, True))[int(rng.integers(3))]
        j = airframe.inertia_kg_m2
        new = [float(f"{x * (1.0 + way * share * on):.5g}") for x, on in zip(j, (*axes, False), strict=True)]
        return {"inertia_kg_m2": new}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, inertia_kg_m2=tuple(p["inertia_kg_m2"]))
