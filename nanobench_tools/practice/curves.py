"""The curves of the reference paths: one function per family gives position and its first three derivatives.

``t`` (n,) s from the start of the path, ``params`` under the names of the NanoBench metadata sheets. The speed is that
of the mean over a lap (where the published paths use a rounded lap length, so does this). Eight families agree with
the setpoints logged in the recordings. The other four (hover, staircase, waypoints, multisine) have public sheets but
no recordings. They follow the sheets' words, and each function notes where the sheet leaves a choice.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ellipe


class PathPoint(NamedTuple):
    """position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3, each (n, 3) world."""

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray
    jerk_m_s3: np.ndarray


def _harmonics(t: np.ndarray, w: float, terms: list[tuple[int, int, float, float]], offset: np.ndarray) -> PathPoint:
    """Sum of amplitude * sin(k w t + phase) on axes: terms are (axis, k, amplitude, phase)."""
    p, v, a, j = np.zeros((4, len(t), 3))
    p += offset
    for axis, k, amplitude, phase in terms:
        kw = k * w
        s, c = np.sin(kw * t + phase), np.cos(kw * t + phase)
        p[:, axis] += amplitude * s
        v[:, axis] += amplitude * kw * c
        a[:, axis] -= amplitude * kw * kw * s
        j[:, axis] -= amplitude * kw**3 * c
    return PathPoint(p, v, a, j)


def _legs(t: np.ndarray, corners: np.ndarray, starts_s: np.ndarray, speed: float) -> PathPoint:
    """Straight legs from corner to corner (k, 3), leg i begun at starts_s[i] (k - 1,) s at ``speed``, then waits."""
    i = np.clip(np.searchsorted(starts_s, t, side="right") - 1, 0, len(starts_s) - 1)
    step = corners[i + 1] - corners[i]
    length = np.linalg.norm(step, axis=1)
    along = np.clip((t - starts_s[i]) * speed, 0.0, length)
    moving = (along > 0.0) & (along < length)
    unit = step / np.where(length > 0.0, length, 1.0)[:, None]
    still = np.zeros((len(t), 3))
    return PathPoint(corners[i] + along[:, None] * unit, speed * unit * moving[:, None], still, still.copy())


def _height(params: Mapping[str, Any]) -> np.ndarray:
    return np.array([0.0, 0.0, params["altitude_m"]])


QUARTER = np.pi / 2.0


def planner(share: np.ndarray) -> tuple[np.ndarray, ...]:
    """Share of the time 0..1 (any shape) -> share of the way and three derivatives by the share of time.

    The firmware's polynomial between two standstills (pptraj.c, poly7): no velocity, acceleration or jerk at the ends.
    """
    x = np.clip(share, 0.0, 1.0)
    inside = (share >= 0.0) & (share <= 1.0)
    way = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    speed = 140.0 * x**3 * (1.0 - x) ** 3
    acceleration = 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x)
    jerk = 840.0 * x * (1.0 - x) * (1.0 - 5.0 * x + 5.0 * x * x)
    return way, speed * inside, acceleration * inside, jerk * inside


def circle(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Circle of ``radius_m``, counter-clockwise, starts at (radius, 0)."""
    r = params["radius_m"]
    return _harmonics(t, params["speed_mps"] / r, [(0, 1, r, QUARTER), (1, 1, r, 0.0)], _height(params))


def figure_eight(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Figure eight, the lemniscate of Gerono: x = A sin, y = A sin cos, A = ``scale_m``. The nominal lap is 4 sqrt(2)
    A."""
    size = params["scale_m"]
    w = 2.0 * np.pi * params["speed_mps"] / (4.0 * np.sqrt(2.0) * size)
    return _harmonics(t, w, [(0, 1, size, 0.0), (1, 2, size / 2.0, 0.0)], _height(params))


def helix(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Circle that climbs at constant rate from ``altitude_start_m`` to ``altitude_end_m`` in ``duration_s``."""
    r = params["radius_m"]
    start, climb = params["altitude_start_m"], params["altitude_end_m"] - params["altitude_start_m"]
    point = _harmonics(t, params["speed_mps"] / r, [(0, 1, r, QUARTER), (1, 1, r, 0.0)], np.zeros(3))
    point.position_m[:, 2] = start + climb * t / params["duration_s"]
    point.velocity_m_s[:, 2] = climb / params["duration_s"]
    return point


def oval(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Ellipse with half axes ``radius_x_m``, ``radius_y_m``; lap length by the complete elliptic integral."""
    a, b = params["radius_x_m"], params["radius_y_m"]
    long, short = max(a, b), min(a, b)
    lap = 4.0 * long * ellipe(1.0 - (short / long) ** 2)
    w = 2.0 * np.pi * params["speed_mps"] / lap
    return _harmonics(t, w, [(0, 1, a, QUARTER), (1, 1, b, 0.0)], _height(params))


def star(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Pentagram with corners on ``radius_m``, its five edges at constant speed; the acceleration is zero on them."""
    r, speed = params["radius_m"], params["speed_mps"]
    corner = 2.0 * np.pi * 2.0 / 5.0 * np.arange(6)
    corners = r * np.stack([np.cos(corner), np.sin(corner), np.zeros(6)], axis=1)
    edge = 2.0 * r * np.sin(2.0 * np.pi / 5.0)
    along = (speed * t / edge) % 5.0
    i = np.minimum(along.astype(int), 4)
    step = corners[i + 1] - corners[i]
    position = corners[i] + (along - i)[:, None] * step + _height(params)
    return PathPoint(position, step * (speed / edge), *np.zeros((2, len(t), 3)))


def trefoil(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Projection of the trefoil knot, x = (sin + 2 sin 2)/3, y = (cos - 2 cos 2)/3.

    The height is -``z_amplitude_m`` sin 3.
    The nominal lap is 8.5 times ``scale_m``.
    """
    size = params["scale_m"]
    w = 2.0 * np.pi * params["speed_mps"] / (8.5 * size)
    return _harmonics(t, w, [(0, 1, size / 3, 0.0), (0, 2, 2 * size / 3, 0.0), (1, 1, size / 3, QUARTER),
                             (1, 2, -2 * size / 3, QUARTER), (2, 3, -params["z_amplitude_m"], 0.0)], _height(params))


def linear_ramp(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Straight along x to ``distance_m`` and back once in ``duration_s`` at constant speed."""
    speed = 2.0 * params["distance_m"] / params["duration_s"]
    out = t < params["duration_s"] / 2.0
    p, v, a, j = np.zeros((4, len(t), 3))
    p[:, 0] = np.maximum(np.where(out, speed * t, 2.0 * params["distance_m"] - speed * t), 0.0)
    v[:, 0] = np.where(out, speed, -speed)
    return PathPoint(p + _height(params), v, a, j)


def lissajous(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Lissajous figure x = A_x sin(``freq_x`` s + phase), y = A_y sin(``freq_y`` s).

    The lap length is the sum of 20,000 chords.
    """
    fx, fy = params["freq_x"], params["freq_y"]
    terms = [(0, fx, params["amplitude_x_m"], np.radians(params["phase_deg"])), (1, fy, params["amplitude_y_m"], 0.0)]
    lap = _harmonics(np.linspace(0.0, 2.0 * np.pi, 20_001), 1.0, terms, np.zeros(3)).position_m
    length = np.sum(np.linalg.norm(np.diff(lap, axis=0), axis=1))
    return _harmonics(t, 2.0 * np.pi * params["speed_mps"] / length, terms, _height(params))


def hover_until_landing(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Hover at (0, 0, ``altitude_m``); it is landed when the battery has fallen to ``min_voltage``, which no
    curve knows."""
    p, v, a, j = np.zeros((4, len(t), 3))
    return PathPoint(p + _height(params), v, a, j)


def staircase_climb(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Stairs ``step_m`` deep to ``x_max_m`` and ``z_climb_m`` high in all. Speed is ``speed_mps`` with a rest of
    ``hold_time_s`` after every edge. Then down again the same way, and so on. The sheet does not define the order;
    here it is first ahead, then up."""
    stairs = max(round(params["x_max_m"] / params["step_m"]), 1)
    deep, high = params["x_max_m"] / stairs, params["z_climb_m"] / stairs
    k = np.arange(2 * stairs + 1)
    up = np.stack([deep * ((k + 1) // 2), np.zeros(len(k)), params["altitude_m"] + high * (k // 2)], axis=1)
    lap = np.concatenate([up, up[-2::-1]])
    edges_s = np.linalg.norm(np.diff(lap, axis=0), axis=1) / params["speed_mps"] + params["hold_time_s"]
    starts_s = np.concatenate([[0.0], np.cumsum(edges_s)])
    return _legs(t % starts_s[-1], lap, starts_s[:-1], params["speed_mps"])


def random_waypoints(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Straight from (0, 0, ``altitude_m``) through ``num_waypoints`` points of the box at ``speed_mps``; the last is
    held. The sheet gives a seed and no generator: NumPy's default one, x, y, z of a point after each other."""
    low, high = (np.array([params[f"{axis}_{end}_m"] for axis in "xyz"]) for end in ("min", "max"))
    drawn = np.random.default_rng(params["seed"]).uniform(low, high, (params["num_waypoints"], 3))
    corners = np.concatenate([_height(params)[None], drawn])
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    starts_s = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) / params["speed_mps"]
    return _legs(t, corners, starts_s, params["speed_mps"])


def multisine_sysid(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Sum of ``num_components`` sines an axis between ``freq_min_hz`` and ``freq_max_hz``, whole cycles in
    ``period_s``. Amplitudes are up to ``x_amplitude_m`` ..., faded within ``fade_s`` at both ends of ``duration_s``.

    The sheet gives neither frequencies nor phases. Here frequencies rise by a constant factor, and no two axes share
    one. Displacements fall with the square of the frequency above the lowest (so that all accelerate alike). Phases are
    Schroeder's (doi:10.1109/TIT.1970.1054411).
    """
    count, period = params["num_components"], params["period_s"]
    cycles = _whole_cycles(params["freq_min_hz"] * period, params["freq_max_hz"] * period, 3 * count)
    fundamental = 2.0 * np.pi / period
    terms = []
    for axis, name in enumerate("xyz"):
        k = cycles[axis::3]
        size = (k[0] / k) ** 2
        phases = -np.pi * np.arange(len(k)) * (np.arange(len(k)) + 1) / len(k)
        lap = np.sin(np.outer(np.linspace(0.0, 2.0 * np.pi, 3001), k) + phases) @ size
        size = size * (params[f"{name}_amplitude_m"] / np.abs(lap).max())
        terms += [(axis, int(n), float(s), float(phase)) for n, s, phase in zip(k, size, phases, strict=True)]
    swing = _harmonics(t, fundamental, terms, np.zeros(3))
    fade = _fade(t, params["fade_s"], params["duration_s"])
    return PathPoint(_height(params) + fade[0] * swing[0], *(_product(fade, swing, order) for order in (1, 2, 3)))


def _whole_cycles(low: float, high: float, count: int) -> np.ndarray:
    """``count`` different whole numbers from ``low`` to ``high`` or a little above, at about equal ratios."""
    found = np.round(np.geomspace(low, high, count)).astype(int)
    for i in range(1, count):
        found[i] = max(found[i], found[i - 1] + 1)
    return found


def _fade(t: np.ndarray, fade_s: float, duration_s: float) -> list[np.ndarray]:
    """0 to 1 at the start and back at the end, and three derivatives, each (n, 1)."""
    left, right = t / fade_s, (duration_s - t) / fade_s
    sign = np.where(left <= right, 1.0, -1.0) / fade_s
    rise = planner(np.minimum(left, right))
    return [(value * sign**order)[:, None] for order, value in enumerate(rise)]


def _product(a: list[np.ndarray], b: PathPoint, order: int) -> np.ndarray:
    """Derivative of that order of a product of which all derivatives are given (Leibniz)."""
    weights = {1: (1, 1), 2: (1, 2, 1), 3: (1, 3, 3, 1)}[order]
    return sum((w * a[i] * b[order - i] for i, w in enumerate(weights)), np.zeros_like(b[0]))
