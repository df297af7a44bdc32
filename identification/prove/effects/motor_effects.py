"""What the motors, the battery and the way to them do otherwise than the simulator believes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe
from .effect import Effect, Parameters, either, near

CHARGES = {"small": (0.80, 0.95), "medium": (0.55, 0.97), "large": (0.36, 1.0)}
"""Lowest and highest charge at the start of the flights (share)."""
STEP_S = 0.002


class ThrustVoltage(Effect):
    """The battery's voltage left out: the simulator is right at the mean voltage of the flights, and only there.

    The case's flights begin with different charges; the size is how different, and with it how far the voltage strays.
    """

    name = "thrust_voltage"
    sizes: ClassVar = {"small": "batteries within 0.1 V at the start: thrust errs by 2 %, mostly sag within flights",
             "medium": "within 0.3 V: about 3 %", "large": "within 0.45 V: about 5 %"}
    wants = ("charges", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"charges": list(CHARGES[size])}

    @classmethod
    def concealed(cls, model: Model, p: Parameters, mean_V: float) -> Model:
        c = model.values_of("thrust_voltage")["c"]
        terms = {("thrust_pwm" if name == "thrust_voltage" else name): values
                 for name, values in model.as_dict().items()}
        terms["thrust_pwm"] = {"c": tuple(x * mean_V**k for k, x in enumerate(c))}
        return Model(model.vehicle, terms)


class ThrustScale(Effect):
    """All motors weaker or stronger by one factor: worn propellers, thin air."""

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


class MotorLag(Effect):
    """Rotors that follow slower or faster than the simulator believes, or where it believes in no lag at all."""

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


class CommandDelay(Effect):
    """Commands reach the motors late: a slow bus, a busy radio. The log has the time at which they were sent."""

    name = "command_delay"
    parameters = ("delay_s",)
    sizes: ClassVar = {"small": "6 ms, below one row of the recording", "medium": "10 ms",
                        "large": "16 ms; at 28 ms the vehicle no longer flies"}
    wants = ("fast", "lateral", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"delay_s": {"small": 0.006, "medium": 0.010, "large": 0.016}[size] + STEP_S * int(rng.integers(-1, 2))}

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        super().__init__(arrays)
        self._steps = np.round(self.a["delay_s"] / STEP_S).astype(int)
        self._sent = np.zeros((int(self._steps.max()) + 1, 4, len(self._steps)))
        self._count = 0

    def motor(self, motor: np.ndarray) -> np.ndarray:
        depth = len(self._sent)
        self._sent[self._count % depth] = motor
        found = self._sent[(self._count - self._steps) % depth, :, np.arange(len(self._steps))].T
        self._count += 1
        return found


class MotorImbalance(Effect):
    """Motors of unequal strength: a chipped propeller, a worn bearing."""

    name = "motor_imbalance"
    parameters = ("g",)
    sizes: ClassVar = {"small": "the worst motor 2 % off", "medium": "5 %", "large": "10 %"}
    wants = ("lateral", "vertical", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        g = rng.standard_normal(4)
        g -= g.mean()
        g *= {"small": 0.02, "medium": 0.05, "large": 0.10}[size] / np.abs(g).max()
        return {"g": [float(x) for x in np.round(1.0 + g, 5)]}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        return np.asarray(self.a["g"] * thrust_N)


class Saturation(Effect):
    """Motors that can do no more than so much, though asked."""

    name = "saturation"
    parameters = ("T_max_N",)
    sizes: ClassVar = {"small": "most thrust 15 % above hover, met 2 % of the time in climbs", "medium": "13 %",
                        "large": "11 %; at 9 % the vehicle falls"}
    wants = ("full", "vertical", "turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        more = 1.0 + {"small": 0.15, "medium": 0.13, "large": 0.11}[size]
        return {"T_max_N": float(f"{more * airframe.mass_kg * 9.81 / 4.0:.4g}")}

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        return np.asarray(np.minimum(thrust_N, self.a["T_max_N"]))
