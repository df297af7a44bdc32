"""From a thrust back to the PWM at a battery voltage, with the limit that the battery sets."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

GRID = 257
STEPS = 50
"""Halvings of the interval: to 1e-15 of the range."""


@dataclass(frozen=True)
class Inverse:
    """Commands for given thrusts.

    - pwm (...): ratio 0..1.
    - thrust_N (...): resulting thrust; limit_N (...): the greatest thrust at that voltage.
    - saturated (...): the request exceeds it.
    - below (...): the request is less than the map's least; the motor is then off (pwm 0)."""

    pwm: np.ndarray
    thrust_N: np.ndarray
    limit_N: np.ndarray
    saturated: np.ndarray
    below: np.ndarray


def invert(thrust_of: Callable[[np.ndarray, np.ndarray], np.ndarray], thrust_N: np.ndarray,
           voltage: np.ndarray) -> Inverse:
    """The PWM ratio at which ``thrust_of(u, V)`` gives ``thrust_N`` [N] per motor at ``voltage`` [V], broadcast.

    On the rising branch that ends at full PWM, so that a map which falls somewhere at low PWM still has one answer.
    """
    wanted, volts = np.broadcast_arrays(np.asarray(thrust_N, float), np.asarray(voltage, float))
    grid = np.linspace(0.0, 1.0, GRID)
    flat = volts.ravel()
    curve = np.asarray(thrust_of(grid[:, None], flat[None, :]))
    falls = np.diff(curve, axis=0) <= 0.0
    last = np.where(falls.any(axis=0), GRID - 1 - np.argmax(falls[::-1], axis=0), 0)
    low, high = grid[last].copy(), np.ones(len(flat))
    least = curve[last, np.arange(len(flat))]
    limit = curve[-1]
    goal = np.clip(wanted.ravel(), least, limit)
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        short = np.asarray(thrust_of(middle, flat)) < goal
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    saturated, below = wanted.ravel() > limit, wanted.ravel() < least
    pwm = np.where(below, 0.0, np.where(saturated, 1.0, high))
    given = np.where(below, 0.0, np.asarray(thrust_of(pwm, flat)))
    shape = wanted.shape
    return Inverse(*(x.reshape(shape) for x in (pwm, given, limit, saturated, below)))
