"""The path of the high-level commander: polynomials of seventh order in time, one for x, y, z and yaw (pptraj.c)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...firmware.flatness import body_rates

ORDER = 8
SHORTEST_S = 1e-3


@dataclass(frozen=True)
class Point:
    """position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3 (3,) world, yaw_rad and its rate."""

    position_m: np.ndarray
    yaw_rad: float
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray
    jerk_m_s3: np.ndarray
    yaw_rate_rad_s: float

    def rates_rad_s(self) -> np.ndarray:
        """(3,) body rates that the path asks for."""
        if not self.jerk_m_s3.any() and not self.yaw_rate_rad_s:
            return np.zeros(3)
        return np.asarray(body_rates(self.acceleration_m_s2[None], self.jerk_m_s3[None], np.array([self.yaw_rad]),
                                     np.array([self.yaw_rate_rad_s]))[0])


def at_rest(position_m: np.ndarray, yaw_rad: float) -> Point:
    """A point that stands still."""
    still = np.zeros(3)
    return Point(np.asarray(position_m, float), yaw_rad, still, still, still, 0.0)


def turn_to(start_rad: float, end_rad: float) -> tuple[float, float]:
    """(start, end) of the shortest turn between two angles, start within half a turn of zero."""
    start = math.remainder(start_rad, 2.0 * math.pi)
    return start, start + math.remainder(end_rad - start, 2.0 * math.pi)


def seventh_order(start: np.ndarray, end: np.ndarray, duration_s: float) -> np.ndarray:
    """Coefficients (8,), lowest first, from position, velocity, acceleration (3,) at 0 to those at ``duration_s``; the
    jerk is zero at both ends."""
    t = max(duration_s, SHORTEST_S)
    (x0, v0, a0), (xf, vf, af) = start, end
    d = x0 - xf
    return np.array([x0, v0, a0 / 2.0, 0.0,
                     -5.0 * (14.0 * d + 8.0 * t * v0 + 6.0 * t * vf + 2.0 * t**2 * a0 - t**2 * af) / (2.0 * t**4),
                     (84.0 * d + 45.0 * t * v0 + 39.0 * t * vf + 10.0 * t**2 * a0 - 7.0 * t**2 * af) / t**5,
                     -(140.0 * d + 72.0 * t * v0 + 68.0 * t * vf + 15.0 * t**2 * a0 - 13.0 * t**2 * af) / (2.0 * t**6),
                     2.0 * (10.0 * d + 5.0 * t * v0 + 5.0 * t * vf + t**2 * a0 - t**2 * af) / t**7])


_POWERS, _ORDERS = np.arange(ORDER, dtype=float), np.arange(4.0)[:, None]


def _derivatives(piece: np.ndarray) -> np.ndarray:
    """Coefficients (4, 8) of a piece -> (4, 4, 8) of it and its first three derivatives."""
    found = np.zeros((4, 4, ORDER))
    found[0] = piece
    for k in range(3):
        found[k + 1, :, :-1] = found[k, :, 1:] * np.arange(1, ORDER)
    return found


class Path:
    """Pieces of polynomials (4, 8) for x, y, z, yaw, one after the other; after the last it stays at its end.

    timescale stretches the time, ``reversed``: from the end to the start; shift (4,) is added.
    """

    def __init__(self, pieces: list[np.ndarray], durations_s: list[float], timescale: float = 1.0,
                 backwards: bool = False) -> None:
        self.pieces, self.durations_s = pieces, [max(d, SHORTEST_S) for d in durations_s]
        self.timescale, self.backwards, self.shift = timescale, backwards, np.zeros(4)
        self._derivatives = [_derivatives(piece) for piece in pieces]
        self.duration_s = sum(self.durations_s) * timescale

    @classmethod
    def between(cls, start: Point, end: Point, duration_s: float) -> Path:
        """From one point to another, yaw the short way."""
        yaw = turn_to(start.yaw_rad, end.yaw_rad)
        rows = [(seventh_order(np.array([start.position_m[k], start.velocity_m_s[k], start.acceleration_m_s2[k]]),
                               np.array([end.position_m[k], end.velocity_m_s[k], end.acceleration_m_s2[k]]),
                               duration_s)) for k in range(3)]
        rows.append(seventh_order(np.array([yaw[0], start.yaw_rate_rad_s, 0.0]),
                                  np.array([yaw[1], end.yaw_rate_rad_s, 0.0]), duration_s))
        return cls([np.array(rows)], [duration_s])

    def at(self, time_s: float) -> Point:
        """Where it is so long after its beginning."""
        over = time_s >= self.duration_s
        local = min(max(time_s / self.timescale, 0.0), sum(self.durations_s))
        sign = 1.0
        if self.backwards:
            local, sign = sum(self.durations_s) - local, -1.0
        index = 0
        while index < len(self.pieces) - 1 and local > self.durations_s[index]:
            local -= self.durations_s[index]
            index += 1
        values = self._derivatives[index] @ local ** _POWERS * (sign / self.timescale) ** _ORDERS
        values[0] += self.shift
        place, speed, acceleration, jerk = values
        if over:
            return at_rest(place[:3], float(place[3]))
        return Point(place[:3], float(place[3]), speed[:3], acceleration[:3], jerk[:3], float(speed[3]))
