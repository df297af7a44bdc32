"""Directions through the state at the start of a window: what a start may be corrected by.

A gyro row is one noisy reading, and the rotors at the start are known only as well as the model of their lag. Names
are ``start.rate_x`` and so on; rotors are moved from where the inputs before the window have left them.
"""

import numpy as np

from nanobench_tools.physics.model import RATE, ROTOR, STATE

PREFIX = "start."
NAMES = tuple(PREFIX + name for name in STATE[RATE] + STATE[ROTOR])


def moved(start: np.ndarray, rotors: np.ndarray, change: np.ndarray) -> np.ndarray:
    """start (n, 13), rotors (n, 4) N, change (n, 7) in the order of NAMES -> start (n, 17)."""
    state = np.concatenate([start, rotors], axis=1)
    state[:, RATE] += change[:, :3]
    state[:, ROTOR] += change[:, 3:]
    return state


def tangents(directions: np.ndarray) -> np.ndarray:
    """directions (7, F) -> derivatives (F, 17) of the start along them."""
    found = np.zeros((directions.shape[1], len(STATE)))
    found[:, RATE], found[:, ROTOR] = directions[:3].T, directions[3:].T
    return found
