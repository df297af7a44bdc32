"""More drag than the simulator believes, in proportion to air speed; or drag where it believes in none."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe
from .effect import Effect, Parameters, near


class DragLinear(Effect):
    name = "drag_linear"
    parameters = ("d",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s",
                        "medium": "0.35 m/s^2 at 1 m/s, what the real vehicle has in all",
                        "large": "0.8 m/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "turning")
    twins = ()

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        absent = bool(rng.uniform() < 0.4)
        before = (0.0, 0.0, 0.0) if absent else airframe.drag_N_s_m
        more = [near(rng, rate * share) * airframe.mass_kg for share in (1.0, 1.0, 0.4)]
        return {"d": [float(f"{b + m:.4g}") for b, m in zip(before, more, strict=True)], "absent": absent}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, drag_N_s_m=tuple(p["d"]))

    @staticmethod
    def concealed(model: Model, p: Parameters, mean_V: float) -> Model:
        return model.without("drag_linear") if p["absent"] else model
