"""The reference over a controller's horizon: what is known of the future, else what now says about it."""

from __future__ import annotations

import numpy as np

from nanobench_tools.guard import LARGEST
from nanobench_tools.methods import Reference

WIDTH = 14
"""position, velocity, acceleration, jerk (3 each), yaw, yaw rate."""
LEAP_M = 0.15
"""Between two points of a horizon, beside what its velocity explains: a leap that no vehicle flies, and is answered
when it has come."""
LEAST_TILT_RAD, MOST_TILT_RAD = 0.2, 0.6
CLIMB_M = 0.6
"""A reference that is higher or lower by more is answered as if it were so by this."""
MARGIN = 0.85
"""Share of the thrust which the motors can give at the voltage now that is left when all of them give it."""


class Horizon:
    """References at ``seconds`` (k,) from now, for n vehicles."""

    def __init__(self, seconds: np.ndarray) -> None:
        self.seconds = np.asarray(seconds, float)

    def rows(self, reference: Reference, landing: np.ndarray) -> tuple[np.ndarray, int]:
        """(n, k, WIDTH), and of how many vehicles ``ahead`` was no use, so that it was guessed.

        ``reference`` is finite and whole (``Guard.admit``), its ``ahead`` need not be; vehicles that are ``landing``
        (n,) do not look at it.
        """
        if reference.ahead is None:
            return self._guessed(reference), 0
        told = self._told(reference, len(landing))
        good = (np.abs(told) < LARGEST).all(axis=(1, 2))  # what is no number is not less either
        if good.all() and not landing.any():
            return told, 0
        found = self._guessed(reference)
        found[good & ~landing] = told[good & ~landing]
        return found, int(np.count_nonzero(~good))

    def _told(self, reference: Reference, n: int) -> np.ndarray:
        out = np.full((n, len(self.seconds), WIDTH), np.nan)
        try:
            ahead = reference.ahead(self.seconds)  # type: ignore[misc]
            parts = (ahead.position_m, ahead.velocity_m_s, ahead.acceleration_m_s2, ahead.jerk_m_s3, ahead.yaw_rad,
                     ahead.yaw_rate_rad_s)
            for i, part in enumerate(parts):
                if i < 4:
                    out[:, :, 3 * i:3 * i + 3] = 0.0 if part is None else np.asarray(part).swapaxes(0, 1)
                else:
                    out[:, :, 8 + i] = 0.0 if part is None else np.asarray(part).T
        except Exception:  # the future is anybody's code; the present has been checked
            out[:] = np.nan
        return out

    def _guessed(self, reference: Reference) -> np.ndarray:
        """Constant jerk for as long as that is not far: position by its Taylor series."""
        t = self.seconds[:, None]
        p, v, a, j = (np.asarray(x, float)[:, None] for x in (
            reference.position_m, reference.velocity_m_s, reference.acceleration_m_s2, reference.jerk_m_s3))
        out = np.empty((len(p), len(t), WIDTH))
        out[:, :, 0:3] = p + t * (v + t * (a / 2.0 + t * j / 6.0))
        out[:, :, 3:6] = v + t * (a + t * j / 2.0)
        out[:, :, 6:9] = a + t * j
        out[:, :, 9:12] = j
        turn = np.asarray(reference.yaw_rate_rad_s, float)[:, None]
        out[:, :, 12] = np.asarray(reference.yaw_rad, float)[:, None] + turn * self.seconds
        out[:, :, 13] = turn
        return out


def without_leaps(rows: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """rows (n, k, WIDTH) at ``seconds`` (k,), those behind a leap moved back to where the path would have gone on."""
    explained = 0.5 * np.diff(seconds)[:, None] * (rows[:, 1:, 3:6] + rows[:, :-1, 3:6])
    gaps = np.diff(rows[:, :, :3], axis=1) - explained
    leaps = np.sum(gaps * gaps, axis=2) > LEAP_M**2
    if leaps.any():
        rows = rows.copy()
        rows[:, 1:, :3] -= np.cumsum(gaps * leaps[:, :, None], axis=1)
    return rows


def most_tilt(thrust_ratio: np.ndarray) -> np.ndarray:
    """Tilt [rad] (n,) at which a vehicle still carries its weight, thrust_ratio (n,) being most thrust over weight."""
    return np.clip(np.arccos(np.minimum(1.0 / np.maximum(MARGIN * thrust_ratio, 1.0), 1.0)), LEAST_TILT_RAD,
                   MOST_TILT_RAD)


def within_reach(rows: np.ndarray, x: np.ndarray, gains: tuple[float, float], most_m_s2: np.ndarray) -> np.ndarray:
    """rows (n, k, WIDTH), all of a vehicle's moved so that it does not ask of it more level acceleration than most_m_s2
    (n,). x (n, 17) is where it is, gains [1/s^2, 1/s] what a controller answers a lag of position and velocity by.

    A vehicle that lifts little more than its weight loses height when it tips after a reference that has jumped.
    """
    away, faster = rows[:, 0, :2] - x[:, :2], rows[:, 0, 3:5] - x[:, 3:5]
    asked = rows[:, 0, 6:8] + gains[0] * away + gains[1] * faster
    size = np.sqrt(np.sum(asked * asked, axis=1))
    over = size > most_m_s2
    if over.any():
        rows = rows.copy()
        share = np.where(over, 1.0 - most_m_s2 / np.maximum(size, 1e-9), 0.0)
        rows[:, :, :2] -= (share[:, None] / gains[0] * asked)[:, None]
    high = rows[:, 0, 2] - x[:, 2]
    if (np.abs(high) > CLIMB_M).any():
        rows = rows.copy()
        rows[:, :, 2] -= (high - np.clip(high, -CLIMB_M, CLIMB_M))[:, None]
    return rows
