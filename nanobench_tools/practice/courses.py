"""Reference paths for headroom, which no recording has: a figure of eight in the least time, and a course of waypoints
with the least snap."""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.ndimage import gaussian_filter1d

from ..settings import number
from .curves import PathPoint

POINTS = 8000
"""Of a lap on which its speed is found."""
RISE_S = number("practice.courses.rise_s")


def _lemniscate(angle: np.ndarray) -> np.ndarray:
    """(4, n, 2): x = sin, y = sin cos of the angle and three derivatives by it."""
    s, c, s2, c2 = np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)
    return np.stack([np.stack(pair, axis=1) for pair in ((s, s2 / 2), (c, c2), (-s, -2 * s2), (-c, -4 * c2))])


@functools.lru_cache(maxsize=32)
def _quickest(size_m: float, most_m_s2: float) -> CubicSpline:
    """Angle [rad] over time [s] of a lap of the lemniscate with an acceleration of at most ``most_m_s2``, periodic.

    With the speed's square b over the way s, db/ds = 2 sqrt(most^2 - (curvature b)^2) at most, and b <= most /
    curvature. One sweep each way from the point where the second bound is lowest finds the largest b. Source: Bobrow,
    Dubowsky, Gibson 1985, doi:10.1177/027836498500400301, here for a bound on the length of the acceleration.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS, endpoint=False)
    _, first, second, _ = _lemniscate(angle) * size_m
    stretch = np.linalg.norm(first, axis=1)
    curvature = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / stretch**3
    bound = most_m_s2 / np.maximum(curvature, 1e-9)
    lowest = int(np.argmin(bound))
    order = (lowest + np.arange(POINTS)) % POINTS
    way = stretch[order] * (2.0 * np.pi / POINTS)
    for step in (1, -1):
        square, k, b = bound[order][::step].copy(), curvature[order][::step], way[::step]
        for i in range(1, POINTS):
            left = max(most_m_s2**2 - (k[i - 1] * square[i - 1]) ** 2, 0.0)
            square[i] = min(square[i], square[i - 1] + 2.0 * b[i - 1] * np.sqrt(left))
        bound[order] = square[::step]
    rate = np.sqrt(bound) / stretch  # of the angle
    middle = 0.5 * (rate + np.roll(rate, -1))
    time = np.concatenate([[0.0], np.cumsum(2.0 * np.pi / POINTS / middle)])
    even = np.linspace(0.0, time[-1], POINTS + 1)
    smooth = gaussian_filter1d(np.interp(even, time, np.append(rate, rate[0]))[:-1], RISE_S / even[1], mode="wrap")
    speed = CubicSpline(even, np.append(smooth, smooth[0]), bc_type="periodic")
    lap = speed.antiderivative()
    stretched = even * (lap(even[-1]) / (2.0 * np.pi))  # the lap is a whole one
    return CubicSpline(stretched, np.append(smooth, smooth[0]), bc_type="periodic")


def time_optimal_eight(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """The lemniscate of ``figure_eight``, A = ``scale_m``, as quickly as level accelerations up to
    ``acceleration_m_s2`` allow. Changes of the acceleration are smoothed a little, so that the limit is met to a few
    per cent."""
    size = params["scale_m"]
    speed = _quickest(float(size), float(params["acceleration_m_s2"]))
    lap_s = speed.x[-1]
    laps, rest = np.divmod(np.asarray(t, float), lap_s)
    angle = 2.0 * np.pi * laps + speed.antiderivative()(rest)
    w, dw, ddw = (speed(rest, order)[:, None] for order in range(3))
    p0, p1, p2, p3 = size * _lemniscate(angle)
    level = (p0, p1 * w, p2 * w**2 + p1 * dw, p3 * w**3 + 3.0 * p2 * w * dw + p1 * ddw)
    point = PathPoint(*(np.pad(x, ((0, 0), (0, 1))) for x in level))
    point.position_m[:, 2] = params["altitude_m"]
    return point


@functools.lru_cache(maxsize=32)
def _least_snap(corners: tuple[tuple[float, ...], ...], speed_m_s: float) -> BSpline:
    """Through corners at times in proportion to their distances, at rest at both ends.

    Of all such paths the spline of degree 7 has the least integral of snap squared (Mellinger, Kumar 2011,
    doi:10.1109/ICRA.2011.5980409; ``de`` Boor: the natural interpolant of a derivative of order 4).
    """
    points = np.array(corners)
    times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]) / speed_m_s
    still = [(order, np.zeros(3)) for order in (1, 2, 3)]
    return make_interp_spline(times, points, k=7, bc_type=(still, still))


def minimum_snap(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """From (0, 0, ``altitude_m``) through ``waypoints_m`` [[x, y, z], ...] and back with the least snap. The mean
    speed over the straight lines between them is ``speed_mps``; then it rests there."""
    home = (0.0, 0.0, float(params["altitude_m"]))
    corners = (home, *(tuple(float(x) for x in point) for point in params["waypoints_m"]), home)
    spline = _least_snap(corners, float(params["speed_mps"]))
    end = spline.t[-1]
    moving = (np.asarray(t, float) < end)[:, None]
    at = np.clip(t, 0.0, end)
    return PathPoint(spline(at), *(spline(at, order) * moving for order in (1, 2, 3)))
