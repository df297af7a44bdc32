"""Motor commands against the turning of the gyro: a multirotor turns away from the side whose motors speed up.

The angular acceleration about x and y follows the differences of the motors on both sides. The correlation is 0.69 to
0.94 on real flights. In all 109 recordings that showed an order, it was the true one. A gyro axis that is negated or
exchanged, and motors in another order, fit better with another one. Yaw follows too weakly to show anything.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ..settings import number, setting
from ..time_offsets.mathematics.lags import LagSums, lag_sums
from .axis_unit_matching import CLEARLY, axis_unit_matches
from .context import Context
from .dropouts import alive_until
from .gravity import gravity_axis
from .known_factors import NamedFactor, named_factor
from .own_turning import own_turning
from .pairs import gyro_pair
from .stream_frames import IMU, stream_turns
from .usable_rows import typical_step_s, usable_streams
from .wrong_matches import wrong_matches

STEP_S = number("audit.motor_turning.step_s")
BAND_HZ = setting("audit.motor_turning.band_hz")
REACH_S = number("audit.motor_turning.reach_s")
FOLLOWS = number("audit.motor_turning.follows")
GAINS_APART = number("audit.motor_turning.gains_apart")
CARRIES = number("audit.motor_turning.carries")
MOTORS = ("m1", "m2", "m3", "m4")
SIDES = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0]])
"""Direction in which motors 1..4 (front right, back right, back left, front left) push about x and y."""
ORDERS = tuple(permutations(range(4)))
AXES = {tuple(map(tuple, SIDES[list(order)] * np.array(signs)[:, None])): (order, signs)
        for order in ((0, 1), (1, 0)) for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))}
"""Pushes of motors in another order -> the order and signs of gyro_x and gyro_y that look the same."""


@dataclass(frozen=True)
class MotorTurning:
    """``motors``: which motor each of the four is by the turning of the gyro. ``follows`` (2,): correlations of the
    angular acceleration about x and y with that order; ``gain`` (2,): angular acceleration per push, rad/s^2."""

    motors: tuple[int, ...]
    follows: np.ndarray
    gain: np.ndarray

    @property
    def as_usual(self) -> bool:
        return self.motors == ORDERS[0]

    @property
    def gyro(self) -> tuple[tuple[int, int], tuple[int, int]] | None:
        """Order and signs of gyro_x and gyro_y that explain the same; None where only the motors' order does."""
        return AXES.get(tuple(map(tuple, SIDES[:, self.motors])))

    @property
    def scaled(self) -> NamedFactor | None:
        """Factor between gyro_x and gyro_y where one push turns the vehicle by far more about one axis."""
        ratio = float(self.gain[0] / self.gain[1])
        return None if abs(np.log(ratio)) < np.log(GAINS_APART) else named_factor("rad/s", ratio, GAINS_APART)


def motor_turning(context: Context) -> MotorTurning | None:
    """None without four motors and a gyro, where the gyro is in other axes, and where no order clearly fits."""
    imu, motor = (context.once(usable_streams).get(name) for name in ("imu", "motor"))
    gravity = context.once(gravity_axis)
    if imu is None or motor is None or not all(q in imu for q in IMU[0]) or set(motor.quantities) != set(MOTORS) \
            or (gravity is not None and (gravity.axis, gravity.sign) != (2, 1)) \
            or any(turn.stream == "imu" for turn in context.once(stream_turns)) \
            or any(match.stream == "imu" for match in context.once(wrong_matches)):
        return None
    sums = _sums(context)
    if sums is None:
        return None
    pushed, motors, turned = (v.sum(axis=0) for v in (sums.cross, sums.reference, sums.measured))
    push = np.stack([SIDES[:, order] for order in ORDERS])
    together = np.einsum("lai,nai->nla", pushed[:, :2], push)
    power = np.maximum(np.einsum("nai,lij,naj->nla", push, motors, push), 1e-30)
    k = together / np.sqrt(power * np.maximum(np.diagonal(turned)[:2], 1e-30))
    fits = k.sum(axis=2)
    best, at = np.unravel_index(int(np.argmax(fits)), fits.shape)
    if k[best, at].min() < FOLLOWS or (best and fits[best, at] < fits[0].max() + CLEARLY):
        return None
    return MotorTurning(ORDERS[best], k[best, at], together[best, at] / power[best, at])


def judged_gyro(context: Context) -> bool | None:
    """Whether an attitude, tracked or estimated, turns about x and y as the gyro does; None where none shows it."""
    own, tracked = context.once(own_turning), context.once(axis_unit_matches).get(gyro_pair)
    if tracked is not None and (tracked.swapped or min(tracked.sign[:2]) != 0):
        return min(tracked.sign[:2]) > 0 and not tracked.swapped
    return None if own is None else bool(own.order == (0, 1, 2) and min(own.follows[0, 0], own.follows[1, 1]) > FOLLOWS)


def other_order(context: Context) -> tuple[MotorTurning, bool] | None:
    """The turning by the motors where it shows another order of motors. With True it may be that of the gyro's axes,
    which no attitude judges."""
    found, judged = context.once(motor_turning), judged_gyro(context)
    if found is None or found.as_usual or judged is False:
        return None
    return found, judged is None and found.gyro is not None


def _sums(context: Context) -> LagSums | None:
    """Second moments of angular accelerations (x, y, and two columns of zeros) and commands of the motors."""
    imu, motor = (context.once(usable_streams)[name] for name in ("imu", "motor"))
    end = min(context.once(alive_until)[name] for name in ("imu", "motor"))
    series = []
    for stream, names in ((imu, IMU[0][:2]), (motor, MOTORS)):
        known = np.isfinite(stream[names]).all(axis=1) & (stream.time_s <= end)
        if known.sum() < 100 or typical_step_s(stream.time_s[known]) > 2.0 * STEP_S:
            return None
        series.append((stream.time_s[known], stream[names][known]))
    grid = np.arange(max(t[0] for t, _ in series), min(t[-1] for t, _ in series), STEP_S)
    if len(grid) < 100:
        return None
    gyro, command = (np.stack([np.interp(grid, t, v) for v in values.T], axis=1) for t, values in series)
    sos = butter(2, BAND_HZ, btype="band", fs=1.0 / STEP_S, output="sos")
    turned, pushed = (sosfiltfilt(sos, v, axis=0) for v in (np.gradient(gyro, STEP_S, axis=0), command))
    mean = command.mean(axis=1)
    running = mean > CARRIES * np.median(mean[mean > 0.0]) if (mean > 0.0).any() else mean > 0.0
    return lag_sums(np.hstack([turned, np.zeros((len(grid), 2))]), pushed, running, STEP_S, REACH_S)
