"""Which set-point holds (commander.c): the newest of the highest priority, and how old it is."""

import numpy as np

from ...firmware.records import SETPOINT

DISABLED, HIGH_LEVEL, RADIO = 0, 1, 2
"""Priorities."""


class Commander:
    """Holds the set-point (1,), its priority and its tick. Priority falls only when it is given up."""

    def __init__(self) -> None:
        self.setpoint = np.zeros(1, SETPOINT)
        self.priority, self.tick_ms = DISABLED, 0

    def offer(self, setpoint: np.ndarray, priority: int, now_ms: int) -> bool:
        """Takes a set-point (1,) of at least the present priority; says whether it did."""
        if priority < self.priority:
            return False
        self.setpoint[:] = setpoint
        self.priority, self.tick_ms = priority, now_ms
        return True

    def relax(self) -> None:
        """Any set-point is taken from now on."""
        self.priority = HIGH_LEVEL

    def age_ms(self, now_ms: int) -> int:
        """Of the set-point."""
        return now_ms - self.tick_ms
