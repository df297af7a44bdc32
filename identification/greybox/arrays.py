"""Windows of many flights end to end, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class FitWindows:
    """n windows of H rows of F flights. ``start`` (n, 13) position, velocity, quaternion, rate; ``motor`` (n, H, 4),
    battery_V (n, H), past (motor (n, P, 4), battery (n, P)); ``truth`` (n, H, 13) states 1..H rows later; ``flight``
    (n,) index into ``names``."""

    start: np.ndarray
    motor: np.ndarray
    battery_V: np.ndarray
    past: tuple[np.ndarray, np.ndarray]
    truth: np.ndarray
    flight: np.ndarray
    names: tuple[str, ...]
    row_hz: float = 100.0

    def __len__(self) -> int:
        return len(self.start)

    def rows(self, keep: np.ndarray | slice) -> FitWindows:
        """Some windows."""
        return replace(self, start=self.start[keep], motor=self.motor[keep], battery_V=self.battery_V[keep],
                       past=(self.past[0][keep], self.past[1][keep]), truth=self.truth[keep], flight=self.flight[keep])
