"""What the simulated Crazyflie flies: any physics that steps the firmware's 1 kHz loop."""

from typing import Protocol

import numpy as np

from ...firmware.stabilizer import Stabilizer


class Vehicle(Protocol):
    """``stabilizer`` holds what the firmware measures, believes and commands; ``advance`` runs its loops and the world
    around them."""

    stabilizer: Stabilizer

    def advance(self, milliseconds: int) -> None: ...

    def restart(self) -> None:
        """Back where it stood, with a new ``stabilizer`` at its first tick."""
        ...

    def true_pose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """position m, velocity m/s (3,) world, quaternion (4,) x, y, z, w body to world of the tracked point."""
        ...
