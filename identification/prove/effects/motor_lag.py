"""Rotors that follow slower or faster than the simulator believes, or where it believes in no lag at all."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe
from .effect import Effect, Parameters, near


class MotorLag(Effect):
    name = "motor_lag"
    parameters = ("tau_up_s", "tau_down_s")
    sizes: ClassVar = {"small": "12 ms off (or 15 ms where there should be none)", "medium": "25 ms (30 ms)",
             "large": "40 ms (50 ms)"}
    wants = ("fast", "lateral", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        if rng.uniform() < 0.4:
            tau = near(rng, {"small": 0.015, "medium": 0.030, "large": 0.050}[size])
            return {"tau_up_s": tau, "tau_down_s": near(rng, 1.1 * tau), "absent": True}
        off = near(rng, {"small": 0.012, "medium": 0.025, "large": 0.040}[size])
        up, down = airframe.tau_up_s, airframe.tau_down_s
        way = int(rng.integers(3))  # both slower, only down slower, both faster as far as there is room
        if way == 2 and off < 0.7 * up:
            return {"tau_up_s": up - off, "tau_down_s": down - off, "absent": False}
        return {"tau_up_s": up if way == 1 else up + off, "tau_down_s": down + off, "absent": False}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, tau_up_s=p["tau_up_s"], tau_down_s=p["tau_down_s"])

    @staticmethod
    def concealed(model: Model, p: Parameters, mean_V: float) -> Model:
        return model.without("motor_lag") if p["absent"] else model
