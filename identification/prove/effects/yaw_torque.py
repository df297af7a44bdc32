"""The rotors' drag turns the vehicle more or less than the simulator believes."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters, either, near


class YawTorque(Effect):
    name = "yaw_torque"
    parameters = ("k_m",)
    sizes: ClassVar = {"small": "20 % of k_m", "medium": "35 %", "large": "60 %"}
    wants = ("turning", "lateral")
    twins = ("inertia",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        share = near(rng, {"small": 0.20, "medium": 0.35, "large": 0.60}[size]) * either(rng)
        return {"k_m": float(f"{airframe.yaw_arm_m * (1.0 + share):.5g}")}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, yaw_arm_m=p["k_m"])
