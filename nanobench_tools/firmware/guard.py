"""Guard of a controller: replaces inputs that are not finite and limits its commands.

A vehicle whose measurement is not finite, or outside the range of small quadrotors, is flown on its last good one for
HOLD_S. After that it is lost: its motors get SINK of its hover command, equally, until a measurement returns. A
non-finite reference is replaced by the last good one at rest, or by the place of the vehicle. Commands are finite and
within 0..1. All replacements are counted.
"""

import math

import numba as nb
import numpy as np

from ..errors import InputError, NanobenchError, UsageError
from ..methods import Controller, Reference, VehicleState

HOLD_S = 0.1
"""Maximum time for which the last measurement is reused, s."""
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
    """PWM ratios (n, 4) in 0..1 from any controller.

    Raises UsageError if it raises or returns another shape, InputError for a non-finite command or one outside 0..1.
    Errors of this package pass through.
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
    return np.asarray(np.clip(command, 0.0, 1.0))


@nb.njit(cache=True)
def _within(values: np.ndarray, i: int, most: float) -> bool:
    """Whether all absolute values of a row are not above; one that is no number is."""
    good = True
    for k in range(values.shape[1]):
        good &= abs(values[i, k]) <= most
    return good


@nb.njit(cache=True)
def _keep(kept: np.ndarray, given: np.ndarray, i: int) -> None:
    for k in range(kept.shape[1]):
        kept[i, k] = given[i, k]


@nb.njit(cache=True)
def _measured(place: np.ndarray, speed: np.ndarray, attitude: np.ndarray, rate: np.ndarray, battery: np.ndarray,
              kept_place: np.ndarray, kept_speed: np.ndarray, kept_attitude: np.ndarray, kept_rate: np.ndarray,
              kept_battery: np.ndarray, good: np.ndarray) -> tuple[int, int]:
    """Takes the good rows (n, k) into what is kept, and whether they are into good (n,); counts of bad measurements
    and of bad batteries."""
    bad = empty = 0
    for i in range(place.shape[0]):
        length = 0.0
        for k in range(4):
            length += attitude[i, k] * attitude[i, k]
        good[i] = (_within(place, i, LARGEST) and _within(speed, i, LARGEST) and _within(rate, i, LARGEST)
                   and SHORTEST**2 <= length <= LONGEST**2)
        if good[i]:
            _keep(kept_place, place, i)
            _keep(kept_speed, speed, i)
            _keep(kept_rate, rate, i)
            for k in range(4):
                kept_attitude[i, k] = attitude[i, k] / np.sqrt(length)
        else:
            bad += 1
        if LEAST_V <= abs(battery[i, 0]) <= MOST_V:
            kept_battery[i, 0] = battery[i, 0]
        else:
            empty += 1
    return bad, empty


@nb.njit(cache=True)
def _asked(goal: np.ndarray, yaw: np.ndarray, turn: np.ndarray, speed: np.ndarray, acceleration: np.ndarray,
           jerk: np.ndarray, place: np.ndarray, known: np.ndarray, kept_goal: np.ndarray, kept_yaw: np.ndarray,
           kept_turn: np.ndarray, kept_speed: np.ndarray, kept_acceleration: np.ndarray, kept_jerk: np.ndarray) -> int:
    """Keep the good rows of a reference. Bad rows rest at the last good one, or at ``place`` without one (``known``
    (n,) False). Counts the bad rows."""
    bad = 0
    for i in range(goal.shape[0]):
        if (_within(goal, i, LARGEST) and _within(yaw, i, LARGEST) and _within(turn, i, LARGEST)
                and _within(speed, i, LARGEST) and _within(acceleration, i, LARGEST)
                and _within(jerk, i, LARGEST_JERK_M_S3)):
            known[i] = True
            _keep(kept_goal, goal, i)
            _keep(kept_yaw, yaw, i)
            _keep(kept_turn, turn, i)
            _keep(kept_speed, speed, i)
            _keep(kept_acceleration, acceleration, i)
            _keep(kept_jerk, jerk, i)
        else:
            bad += 1
            if not known[i]:
                _keep(kept_goal, place, i)
            kept_turn[i, 0] = 0.0
            for k in range(3):
                kept_speed[i, k] = kept_acceleration[i, k] = kept_jerk[i, k] = 0.0
    return bad


@nb.njit(cache=True)
def _released(command: np.ndarray, last: np.ndarray, lost: np.ndarray, mean: np.ndarray, share: float,
              out: np.ndarray) -> int:
    """Writes what may be sent of command (n, 4) into out and learns from it what carries; counts the bad."""
    bad = 0
    for i in range(command.shape[0]):
        good = True
        for k in range(4):
            good &= math.isfinite(command[i, k])
        bad += not good
        total = 0.0
        for k in range(4):
            value = min(max(command[i, k] if good else last[i, k], 0.0), 1.0)
            if lost[i]:  # 0 for one that was never measured
                value = SINK * mean[0, i] / max(mean[1, i], 1e-9)
            out[i, k] = value
            total += value
        if not lost[i]:
            mean[0, i] += share * (total / 4.0 - mean[0, i])
            mean[1, i] += share * (1.0 - mean[1, i])
    return bad


def _table(values: np.ndarray, n: int) -> np.ndarray:
    if type(values) is np.ndarray and values.ndim == 2 and values.dtype == float and values.flags.c_contiguous \
            and len(values) == n:
        return values
    return np.ascontiguousarray(values, float).reshape(n, -1)


class Guard:
    """Guard around a controller of n vehicles. ``counts``: vehicle-steps by kind of replacement. ``measured`` (n,)
    bool: the last measurement was good. ``hold_s``: maximum time to bridge a bad one."""

    def __init__(self, n: int, period_s: float, hold_s: float = HOLD_S) -> None:
        self.n, self.period_s, self.hold_s = n, period_s, hold_s
        self.counts = {"measurement": 0, "lost": 0, "battery": 0, "reference": 0, "command": 0}
        self.lost, self.measured = np.zeros((2, n), bool)
        self._missing_s = np.zeros(n)
        self._place, self._speed, self._rate = np.zeros((3, n, 3))
        self._quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
        self._battery = np.full((n, 1), REST_BATTERY_V)
        self._known = np.zeros(n, bool)
        self._goal, self._wish = np.zeros((n, 3)), np.zeros((3, n, 3))
        self._yaw = np.zeros((2, n, 1))
        self._none = np.zeros((n, 3))
        speed, acceleration, jerk = self._wish  # admitted arrays are views of the stored ones
        self._state = VehicleState(self._place, self._speed, self._quaternion, self._rate, self._battery[:, 0])
        self._reference = Reference(self._goal, self._yaw[0, :, 0], speed, acceleration, jerk, self._yaw[1, :, 0])
        self._mean = np.zeros((2, n))  # of the commands, and the weight that it rests on so far
        self._command = np.zeros((n, 4))

    def admit(self, state: VehicleState, reference: Reference) -> tuple[VehicleState, Reference]:
        """The same, all finite, with quaternions of length one and all derivatives; valid until the next call."""
        self._measure(state)
        self._ask(reference)
        return self._state, self._reference

    def _measure(self, given: VehicleState) -> None:
        n, good = self.n, self.measured
        bad, empty = _measured(
            _table(given.position_m, n), _table(given.velocity_m_s, n), _table(given.quaternion, n),
            _table(given.rate_rad_s, n), _table(given.battery_V, n),
            self._place, self._speed, self._quaternion, self._rate, self._battery, good)
        if bad == 0:
            self._missing_s[:] = 0.0
            self.lost[:] = False
        else:
            self._missing_s = np.where(good, 0.0, self._missing_s + self.period_s)
            np.greater(self._missing_s, self.hold_s, out=self.lost)
            self.counts["lost"] += int(np.count_nonzero(self.lost))
        self.counts["measurement"] += bad
        self.counts["battery"] += empty

    def _ask(self, given: Reference) -> None:
        n = self.n
        jerk = self._none if given.jerk_m_s3 is None else given.jerk_m_s3
        turn = self._none[:, :1] if given.yaw_rate_rad_s is None else given.yaw_rate_rad_s
        yaw, yaw_rate = self._yaw
        speed, acceleration, change = self._wish
        self.counts["reference"] += _asked(
            _table(given.position_m, n), _table(given.yaw_rad, n), _table(turn, n), _table(given.velocity_m_s, n),
            _table(given.acceleration_m_s2, n), _table(jerk, n),
            self._place, self._known, self._goal, yaw, yaw_rate, speed, acceleration, change)

    def release(self, command: np.ndarray) -> np.ndarray:
        """PWM ratios (n, 4): finite, within 0..1, those of lost vehicles replaced."""
        out = np.empty((self.n, 4))
        self.counts["command"] += _released(np.ascontiguousarray(command, float), self._command, self.lost, self._mean,
                                            self.period_s / SMOOTH_S, out)
        self._command = out
        return out
