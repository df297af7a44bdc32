"""Signs and units of estimated Euler angles that contradict the gyro, in recordings without motion capture."""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..settings import number
from .axis_unit_matching import FACTOR, FACTOR_WITHIN
from .context import Context
from .dropouts import alive_until
from .estimated_turning import REACH_S, SHORTEST_S, STEP_S, TURN_S
from .held_poses import ROTATION
from .known_factors import NamedFactor, named_factor
from .own_turning import own_turning
from .pairs import gyro_pair, sums_of
from .quaternions import UNIT_WITHIN, quaternion_orders
from .stream_frames import EULER, IMU, stream_turns
from .usable_rows import advancing, even_grid, usable_streams

UNRELATED = number("audit.attitude_signs.unrelated")
OF_ONE_CLOCK = number("audit.attitude_signs.of_one_clock")
CLOSELY = number("audit.attitude_signs.closely")
TURNS_RAD_S = number("audit.attitude_signs.turns_rad_s")
AGAINST = 0.7
"""Least size of a correlation that shows a sign."""
SLOWLY, ALL_DELAYS = 0.5, 0.3
"""The same where a slow turn correlates negatively at every delay, at least by the second number."""


@dataclass(frozen=True)
class AngleMatch:
    """``follows``: correlations of the turning by ``angle`` with that by ``gyro``, at every delay; ``ratio``: of their
    sizes."""

    angle: str
    gyro: str
    follows: np.ndarray
    ratio: float

    @property
    def against(self) -> bool:
        """Whether they turn against each other."""
        low, high = self.follows.min(), self.follows.max()
        return bool((low < -AGAINST and -low > high) or (low < -SLOWLY and high < -ALL_DELAYS))

    @property
    def scaled(self) -> NamedFactor | None:
        """The factor of an angle in another unit, where they turn alike."""
        if np.abs(self.follows).max() < AGAINST or abs(np.log(self.ratio)) < np.log(FACTOR):
            return None
        return named_factor("rad", self.ratio, FACTOR_WITHIN / float(np.abs(self.follows).max()))


def contradicted_angles(context: Context) -> list[tuple[str, str, float]]:
    """(angle, column of the gyro, correlation) of every axis about which the two turn against each other."""
    own = context.once(own_turning)
    turning = np.zeros(3) if own is None or own.order != (0, 1, 2) else np.diag(own.follows)
    return [(m.angle, m.gyro, float(min(m.follows.min(), turning[EULER.index(m.angle)])))
            for m in context.once(angle_matches) if m.against or turning[EULER.index(m.angle)] < -AGAINST]


def unrelated_turning(context: Context) -> list[tuple[str, str, float]]:
    """(angle, column of the gyro, correlation) of every axis about which the two turn otherwise, though the gyro turns.

    Clocks that wander make all axes follow less; one that follows closely shows that the clocks agree."""
    own, matches = context.once(own_turning), context.once(angle_matches)
    if own is None or own.order != (0, 1, 2):
        return []
    follows = {m.angle: max(float(np.abs(m.follows).max()), float(abs(own.follows[k, k])))
               for m in matches for k in [EULER.index(m.angle)]}
    least = OF_ONE_CLOCK if max(follows.values(), default=0.0) > CLOSELY else UNRELATED
    return [(m.angle, m.gyro, follows[m.angle]) for m in matches
            if follows[m.angle] < least and own.turns[EULER.index(m.angle)] > TURNS_RAD_S]


def angle_matches(context: Context) -> list[AngleMatch]:
    """Every estimated angle with its axis of the gyro; empty where motion capture judges them, and without both."""
    streams, angles = context.once(usable_streams), _angles(context)
    imu, alive = streams.get("imu"), context.once(alive_until)
    if angles is None or imu is None or not all(q in imu for q in IMU[0]):
        return []
    if sums_of(context, gyro_pair) is not None or any(t.stream == "imu" for t in context.once(stream_turns)):
        return []
    end = min(alive[name] for name in ("imu", "attitude", "attitude_qw") if name in streams)
    return [AngleMatch(angle, gyro, *found) for angle, gyro in zip(EULER, IMU[0], strict=True)
            for found in [_correlations(_rising(angles[0], angles[1][angle], end),
                                        _rising(imu.time_s, imu[gyro], end))] if found is not None]


def _angles(context: Context) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Times and angles by name of the estimated attitude, from whichever form was logged."""
    streams = context.once(usable_streams)
    angles, turn = streams.get("attitude"), streams.get("attitude_qw")
    if angles is not None and all(q in angles for q in EULER):
        return angles.time_s, {angle: angles[angle] for angle in EULER}
    found = context.once(quaternion_orders).get("attitude_qw")
    if turn is None or found is None:
        return None
    q = found.reading.of(turn[ROTATION])
    fine = np.isfinite(q).all(axis=1) & (np.abs(np.linalg.norm(q, axis=1) - 1.0) < UNIT_WITHIN)
    return turn.time_s[fine], dict(zip(EULER, so3.euler_zyx(q[fine]).T, strict=True))


def _rising(time_s: np.ndarray, values: np.ndarray, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows with a number whose time grows, until a stream dies."""
    known = np.isfinite(values) & advancing(time_s) & (time_s <= end_s)
    return time_s[known], values[known]


def _correlations(angle: tuple[np.ndarray, np.ndarray], rate: tuple[np.ndarray, np.ndarray]
                  ) -> tuple[np.ndarray, float] | None:
    """Of the turning by an angle with that by a rate at every delay, and the ratio of their sizes. None where they do
    not overlap or move."""
    (at, angles), (t, rates) = angle, rate
    if len(at) < 2 or len(t) < 2:
        return None
    grid = even_grid(max(at[0], t[0]) + REACH_S, min(at[-1], t[-1]) - REACH_S - TURN_S, STEP_S, len(t))
    if len(grid) * STEP_S < SHORTEST_S:
        return None
    turned = np.interp(grid + TURN_S, at, np.unwrap(angles)) - np.interp(grid, at, np.unwrap(angles))
    path = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(t))])
    by_rate = np.stack([np.interp(grid + delay + TURN_S, t, path) - np.interp(grid + delay, t, path)
                        for delay in np.arange(-REACH_S, REACH_S + 0.5 * STEP_S, STEP_S)])
    sizes = turned.std(), by_rate.std(axis=1)
    if not sizes[0] > 0.0 or not sizes[1].min() > 0.0:
        return None
    follows = (by_rate - by_rate.mean(axis=1, keepdims=True)) @ (turned - turned.mean()) / (
        len(grid) * sizes[0] * sizes[1])
    return follows, float(sizes[0] / np.median(sizes[1]))
