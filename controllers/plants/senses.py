"""How a vehicle of the plant senses: poses that come late, seldom or not, and the noise of its IMU.

``kalman_senses.Onboard`` runs the firmware's Kalman filter on them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools.practice.estimator import POSITION_LAG_S
from nanobench_tools.settings import number

from .plant import STEP_S

TICK_S = 0.01
SUBSTEPS = round(TICK_S / STEP_S)


@dataclass(frozen=True)
class Sensing:
    """Properties of the sensing of a plant.

    - delay_s: from the truth to the estimated position, including the pose's way (recordings: 20 ms).
    - noise: of gyro and accelerometer over the recordings'.
    - outages: (start_s, end_s) without poses.
    - pose_hz and pose_noise_m: inputs of the firmware's filter.
    - shut (ticks, n) bool: the radio is silent in this tick of 10 ms, and poses wait."""

    delay_s: np.ndarray | float = POSITION_LAG_S
    noise: np.ndarray | float = 1.0
    outages: tuple[tuple[float, float], ...] = ()
    pose_hz: float = 100.0
    pose_noise_m: float = number("control.senses.sensing_pose_noise_m")
    shut: np.ndarray | None = None


class Noise:
    """Unit normal numbers (n, width) times ``scale``, new at every step; drawn STEPS at once from one generator
    each."""

    STEPS = 500

    def __init__(self, rngs: Sequence[np.random.Generator], scale: np.ndarray | float, n: int, width: int) -> None:
        self._rngs, self._width, self._at = rngs, width, 0
        self._scale = np.broadcast_to(np.asarray(scale, np.float32), (n,))[:, None]
        self._block = np.zeros((0, n, width), np.float32)

    def next(self) -> np.ndarray:
        """Of the next step; valid until the one after."""
        at = self._at % self.STEPS
        if at == 0:
            shape = (self.STEPS, self._width)
            self._block = np.stack([r.standard_normal(shape, dtype=np.float32) for r in self._rngs], axis=1)
            self._block *= self._scale
        self._at += 1
        return np.asarray(self._block[at])
