"""Commands reach the motors late: a slow bus, a busy radio. The log has the time at which they were sent."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Effect, Parameters

STEP_S = 0.002


class CommandDelay(Effect):
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
