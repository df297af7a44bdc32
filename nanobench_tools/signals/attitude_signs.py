"""Signs of estimated Euler angles that contradict the gyro, in recordings without motion capture to judge either."""

from __future__ import annotations

import numpy as np

from .. import so3
from .context import Context
from .held_poses import ROTATION
from .pairs import gyro_pair, sums_of
from .quaternions import UNIT_WITHIN, quaternion_orders
from .stream_frames import EULER, IMU, stream_turns
from .usable_rows import usable_streams

STEP_S = 0.02
TURN_S = 0.1
"""Turning over this time contains little noise of angles and gyro."""
REACH_S = 0.1
"""Largest delay between the two streams that is tried."""
SHORTEST_S = 2.0
AGAINST = 0.7
"""Least size of a correlation that shows a sign."""
SLOWLY, ALL_DELAYS = 0.5, 0.3
"""The same where a slow turn correlates negatively at every delay, at least by the second number."""


def contradicted_angles(context: Context) -> list[tuple[str, str, float]]:
    """(angle, column of the gyro, correlation) of every axis about which the two turn against each other."""
    streams = context.once(usable_streams)
    imu, angles = streams.get("imu"), _angles(context)
    if angles is None or imu is None or not all(q in imu for q in IMU[0]):
        return []
    if sums_of(context, gyro_pair) is not None or any(t.stream == "imu" for t in context.once(stream_turns)):
        return []
    found = []
    for angle, gyro in zip(EULER, IMU[0], strict=True):
        k = _correlations(_rising(angles[0], angles[1][angle]), _rising(imu.time_s, imu[gyro]))
        clear = k.min(initial=0.0) < -AGAINST and -k.min() > k.max()
        if clear or (k.min(initial=0.0) < -SLOWLY and k.max() < -ALL_DELAYS):
            found.append((angle, gyro, float(k.min())))
    return found


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


def _rising(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows with a number whose time grows."""
    known = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[known], values[known]
    first = np.concatenate([[True], time_s[1:] > np.maximum.accumulate(time_s)[:-1]]) if len(time_s) else known[:0]
    return time_s[first], values[first]


def _correlations(angle: tuple[np.ndarray, np.ndarray], rate: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Of the turning by an angle with that by a rate, at every delay; empty where they do not overlap or move."""
    (at, angles), (t, rates) = angle, rate
    if len(at) < 2 or len(t) < 2:
        return np.zeros(0)
    grid = np.arange(max(at[0], t[0]) + REACH_S, min(at[-1], t[-1]) - REACH_S - TURN_S, STEP_S)
    if len(grid) * STEP_S < SHORTEST_S:
        return np.zeros(0)
    turned = np.interp(grid + TURN_S, at, np.unwrap(angles)) - np.interp(grid, at, np.unwrap(angles))
    path = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(t))])
    found = []
    for delay in np.arange(-REACH_S, REACH_S + 0.5 * STEP_S, STEP_S):
        by_rate = np.interp(grid + delay + TURN_S, t, path) - np.interp(grid + delay, t, path)
        found.append((turned - turned.mean()) @ (by_rate - by_rate.mean())
                     / max(float(len(grid) * turned.std() * by_rate.std()), 1e-12))
    return np.array(found)
