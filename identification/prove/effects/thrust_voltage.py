"""The battery's voltage left out: the simulator is right at the mean voltage of the flights, and only there.

The case's flights begin with different charges; the size is how different, and with it how far the voltage strays.
"""

from typing import ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe
from .effect import Effect, Parameters

CHARGES = {"small": (0.80, 0.95), "medium": (0.55, 0.97), "large": (0.36, 1.0)}
"""Lowest and highest charge at the start of the flights (share)."""


class ThrustVoltage(Effect):
    name = "thrust_voltage"
    sizes: ClassVar = {"small": "batteries within 0.1 V at the start: thrust errs by 2 %, mostly sag within flights",
             "medium": "within 0.3 V: about 3 %", "large": "within 0.45 V: about 5 %"}
    wants = ("charges", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"charges": list(CHARGES[size])}

    @staticmethod
    def concealed(model: Model, p: Parameters, mean_V: float) -> Model:
        c = model.values_of("thrust_voltage")["c"]
        terms = {("thrust_pwm" if name == "thrust_voltage" else name): values
                 for name, values in model.as_dict().items()}
        terms["thrust_pwm"] = {"c": tuple(x * mean_V**k for k, x in enumerate(c))}
        return Model(model.vehicle, terms)
