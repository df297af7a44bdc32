"""What a controller is given when a measurement or a reference is no number, and what it may command.

A vehicle whose measurement is not finite, or beyond anything a small quadrotor does, is flown on its last good one for
HOLD_S; after that it is lost: its motors get SINK of the command that carried it, equally, until a measurement
returns. A reference that is no number is replaced by the last good one at rest, or by where the vehicle is. Commands
are finite and within 0..1. Everything replaced is counted.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from .errors import InputError, NanobenchError, UsageError
from .methods import Controller, Reference, VehicleState

HOLD_S = 0.1
"""A last measurement may stand in for so long."""
SINK = 0.9
"""Share of the mean command of the last second that a lost vehicle gets: it comes down at a few metres per second."""
SMOOTH_S = 1.0
LARGEST = 1e3
"""m, m/s, rad/s, m/s^2: beyond this nothing was measured."""
LARGEST_JERK_M_S3 = 1e5
LEAST_V, MOST_V = 2.0, 6.0
REST_BATTERY_V = 3.7
"""Until a battery has been measured."""
SHORTEST, LONGEST = 0.1, 10.0
"""Lengths between which a quaternion is made one."""
SLACK = 1e-6
"""A command may leave 0..1 by so much: rounding of the controller's own sums."""


def commanded(controller: Controller, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
    """PWM ratios (n, 4) in 0..1 from anybody's controller.

    Raises UsageError when it raises or returns another shape, InputError for a command that is no number or outside
    0..1; errors of this package go through.
    """
    n = len(state.position_m)
    try:
        command = np.asarray(controller.command(time_s, state, reference), float)
    except NanobenchError:
        raise
    except Exception as error:  # the controller is anybody's code
        text = f"controller {controller.name!r} raised {type(error).__name__} at {time_s:.3f} s: {error}"
        raise UsageError(text) from error
    if command.shape != (n, 4):
        raise UsageError(f"controller {controller.name!r} returned shape {command.shape} for {n} vehicles; "
                         f"it must be ({n}, 4)")
    # written so that a value that is no number is bad too
    bad = ~((command >= -SLACK) & (command <= 1.0 + SLACK)).all(axis=1)
    if bad.any():
        vehicle = int(np.argmax(bad))
        raise InputError(f"controller {controller.name!r}",
                         f"commanded {', '.join(f'{c:.4g}' for c in command[vehicle])} at {time_s:.3f} s for vehicle "
                         f"{vehicle}", "motor commands are finite PWM ratios from 0 to 1")
    return np.clip(command, 0.0, 1.0)


@nb.njit(cache=True)
def _judge(values, least, most, good):
    """Takes ``good`` (n,) from rows of values (n, k) with an absolute value out of bounds, or none at all."""
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if not least <= abs(values[i, k]) <= most:
                good[i] = False


@nb.njit(cache=True)
def _judge_length(values, good):
    """The same for the length of the rows."""
    for i in range(values.shape[0]):
        if not SHORTEST**2 <= np.sum(values[i] * values[i]) <= LONGEST**2:
            good[i] = False


@nb.njit(cache=True)
def _take(values, good, kept):
    """Copies the good rows of values (n, k) into ``kept``."""
    for i in range(values.shape[0]):
        if good[i]:
            for k in range(values.shape[1]):
                kept[i, k] = values[i, k]


def _table(values: np.ndarray, n: int) -> np.ndarray:
    return np.ascontiguousarray(values, float).reshape(n, -1)


class Guard:
    """Stands before and behind a controller of n vehicles. ``counts``: vehicle-steps by what was replaced;
    ``measured`` (n,) bool: those whose last measurement was a good one; ``hold_s``: for how long one that is not may be
    bridged."""

    def __init__(self, n: int, period_s: float, hold_s: float = HOLD_S) -> None:
        self.n, self.period_s, self.hold_s = n, period_s, hold_s
        self.counts = {"measurement": 0, "lost": 0, "battery": 0, "reference": 0, "command": 0}
        self.lost, self.measured = np.zeros((2, n), bool)
        self._missing_s = np.zeros(n)
        self._place, self._speed, self._rate = np.zeros((3, n, 3))
        self._quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
        self._battery = np.full((n, 1), REST_BATTERY_V)
        self._asked = np.zeros(n, bool)
        self._goal, self._wish = np.zeros((n, 3)), np.zeros((3, n, 3))
        self._yaw = np.zeros((2, n, 1))
        self._mean = np.zeros((2, n))  # of the commands, and the weight that it rests on so far
        self._command = np.zeros((n, 4))

    def admit(self, state: VehicleState, reference: Reference) -> tuple[VehicleState, Reference]:
        """The same, all finite, with quaternions of length one and all derivatives; valid until the next call."""
        self._measure(state)
        self._ask(reference)
        speed, acceleration, jerk = self._wish
        return (VehicleState(self._place, self._speed, self._quaternion, self._rate, self._battery[:, 0]),
                Reference(self._goal, self._yaw[0, :, 0], speed, acceleration, jerk, self._yaw[1, :, 0]))

    def _measure(self, given: VehicleState) -> None:
        n = self.n
        good, charged = np.ones(n, bool), np.ones(n, bool)
        moving = ((_table(given.position_m, n), self._place), (_table(given.velocity_m_s, n), self._speed),
                  (_table(given.rate_rad_s, n), self._rate))
        attitude, battery = _table(given.quaternion, n), _table(given.battery_V, n)
        for values, _ in moving:
            _judge(values, 0.0, LARGEST, good)
        _judge_length(attitude, good)
        _judge(battery, LEAST_V, MOST_V, charged)
        for values, kept in (*moving, (attitude, self._quaternion)):
            _take(values, good, kept)
        _take(battery, charged, self._battery)
        self._quaternion /= np.sqrt(np.sum(self._quaternion**2, axis=1, keepdims=True))
        self._missing_s = np.where(good, 0.0, self._missing_s + self.period_s)
        self.lost, self.measured = self._missing_s > self.hold_s, good
        for name, bad in (("measurement", ~good), ("lost", self.lost), ("battery", ~charged)):
            self.counts[name] += int(np.count_nonzero(bad))

    def _ask(self, given: Reference) -> None:
        n = self.n
        zero = np.zeros((n, 3))
        jerk = zero if given.jerk_m_s3 is None else given.jerk_m_s3
        turn = zero[:, :1] if given.yaw_rate_rad_s is None else given.yaw_rate_rad_s
        asked = [_table(x, n) for x in (given.position_m, given.yaw_rad, turn, given.velocity_m_s,
                                        given.acceleration_m_s2, jerk)]
        good = np.ones(n, bool)
        for values, most in zip(asked, (LARGEST,) * 5 + (LARGEST_JERK_M_S3,), strict=True):
            _judge(values, 0.0, most, good)
        self._asked |= good
        if not good.all():
            self.counts["reference"] += int(np.count_nonzero(~good))
            self._goal[~self._asked] = self._place[~self._asked]
            self._wish[:, ~good], self._yaw[1, ~good] = 0.0, 0.0
        for values, kept in zip(asked, (self._goal, *self._yaw, *self._wish), strict=True):
            _take(values, good, kept)

    def release(self, command: np.ndarray) -> np.ndarray:
        """PWM ratios (n, 4): finite, within 0..1, those of lost vehicles replaced."""
        good = np.isfinite(command).all(axis=1)
        if not good.all():
            self.counts["command"] += int(np.count_nonzero(~good))
            command = np.where(good[:, None], command, self._command)
        command = np.clip(command, 0.0, 1.0)
        if self.lost.any():
            carried = self._mean[0] / np.maximum(self._mean[1], 1e-9)  # 0 for one that was never measured
            command = np.where(self.lost[:, None], SINK * carried[:, None], command)
        share = np.where(self.lost, 0.0, self.period_s / SMOOTH_S)
        self._mean = self._mean + share * (np.stack([command.mean(axis=1), np.ones(self.n)]) - self._mean)
        self._command = command
        return command
