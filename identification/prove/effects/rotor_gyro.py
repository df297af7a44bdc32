"""Rotors resist the turning of their axes. Only the sum over both senses of rotation counts, small in steady flight."""

from typing import ClassVar

import numpy as np

from ..airframe import SPIN, Airframe
from .effect import Air, Effect, Parameters, near


class RotorGyro(Effect):
    name = "rotor_gyro"
    parameters = ("J_r",)
    sizes: ClassVar = {"small": "2e-8 kg m^2, a real propeller of this size", "medium": "7e-8",
                        "large": "2e-7"}
    wants = ("spinning", "fast", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"J_r": -near(rng, {"small": 2e-8, "medium": 7e-8, "large": 2e-7}[size])}

    def moment(self, air: Air) -> np.ndarray:
        momentum = self.a["J_r"] * sum(s * omega for s, omega in zip(SPIN, air.rotor, strict=True))
        x, y, _ = air.rate
        return np.stack([-y * momentum, x * momentum, np.zeros_like(momentum)])
