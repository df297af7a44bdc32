"""Air against the rotors, which lie off the centre of mass, turns the vehicle up or down as it flies sideways."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe
from .effect import Effect, Parameters, near


class DragTorque(Effect):
    name = "drag_torque"
    parameters = ("c",)
    sizes: ClassVar = {"small": "2 rad/s^2 at 1 m/s", "medium": "5 rad/s^2, what the real vehicle has in all",
             "large": "12 rad/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        more = -near(rng, {"small": 3.6e-5, "medium": 9e-5, "large": 2.2e-4}[size])
        absent = bool(rng.uniform() < 0.4)
        return {"c": float(f"{more + (0.0 if absent else airframe.drag_torque_N_s):.4g}"), "absent": absent}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, drag_torque_N_s=p["c"])

    @staticmethod
    def concealed(model: Model, p: Parameters, mean_V: float) -> Model:
        return model.without("drag_torque") if p["absent"] else model
