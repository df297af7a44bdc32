"""A vehicle for tests that only ticks: nothing flies, nothing is compiled."""

import numpy as np

from nanobench_tools.firmware.stabilizer import Stabilizer


class StillVehicle:
    """Stands at ``position``; the accelerometer shows ``acc_g``, motors turn while allowed if ``turning``."""

    def __init__(self) -> None:
        self.restart()
        self.position = np.array([0.1, -0.2, 0.3])
        self.turning = False

    def restart(self) -> None:
        self.stabilizer = Stabilizer(1000)
        self.stabilizer.loop["acc_g"][0] = (0.0, 0.0, 1.0)

    def advance(self, milliseconds: int) -> None:
        s = self.stabilizer
        s.run["t_ms"] += milliseconds
        s.loop["step"] += milliseconds
        s.waiting = 0
        if self.turning and s.loop["allowed"][0]:
            s.loop["motor_on_step"] = s.loop["step"]

    def true_pose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.position, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
