"""Rotors resist the turning of their axes. Only the sum over both senses of rotation counts, small in steady flight."""

from typing import ClassVar

import numpy as np

from ..airframe import SPIN, Airframe
from .effect import Air, Effect, Parameters, near


class RotorGyro(Effect):
    name = "rotor_gyro"
    parameters = ("J_r",)
    sizes: ClassVar = {"small": "1e-7 kg m^2, five times a real propeller of this size", "medium": "5e-7",
                        "large": "2e-6"}
    wants = ("spinning", "fast", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"J_r": -near(rng, {"small": 1e-7, "medium": 5e-7, "large": 2e-6}[size])}

    def moment(self, air: Air) -> np.ndarray:
        momentum = self.a["J_r"] * sum(s * omega for s, omega in zip(SPIN, air.rotor, strict=True))
        x, y, _ = air.rate
        return np.stack([-y * momentum, x * momentum, np.zeros_like(momentum)])
