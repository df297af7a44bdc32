"""The paths of the practice flights: one function per family gives position, velocity and acceleration.

Each family is a curve over its own phase, flown so that the mean speed over one lap is ``speed_m_s`` (the published
recordings do the same; where they use a rounded lap length, so does this). Parameter names are those of the
NanoBench metadata sheets. A new family is one function and one line in FAMILIES.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ellipe

from ..errors import UsageError


class PathPoint(NamedTuple):
    """position_m, velocity_m_s, acceleration_m_s2, each (n, 3) world."""

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray


def _harmonics(t: np.ndarray, w: float, terms: list[tuple[int, int, float, float]], offset: np.ndarray) -> PathPoint:
    """Sum of amplitude * sin(k w t + phase) on axes: terms are (axis, k, amplitude, phase)."""
    p, v, a = np.zeros((3, len(t), 3))
    p += offset
    for axis, k, amplitude, phase in terms:
        kw = k * w
        s, c = np.sin(kw * t + phase), np.cos(kw * t + phase)
        p[:, axis] += amplitude * s
        v[:, axis] += amplitude * kw * c
        a[:, axis] -= amplitude * kw * kw * s
    return PathPoint(p, v, a)


def _height(params: Mapping[str, Any]) -> np.ndarray:
    return np.array([0.0, 0.0, params["altitude_m"]])


QUARTER = np.pi / 2.0


def circle(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Radius ``radius_m``, counter-clockwise, starts at (radius, 0)."""
    r = params["radius_m"]
    return _harmonics(t, params["speed_mps"] / r, [(0, 1, r, QUARTER), (1, 1, r, 0.0)], _height(params))


def figure_eight(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Lemniscate of Gerono x = A sin, y = A sin cos, A = ``scale_m``; a lap is counted as 4 sqrt(2) A."""
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
    """Pentagram of corners on ``radius_m``, its five edges at constant speed; the acceleration is zero on them."""
    r, speed = params["radius_m"], params["speed_mps"]
    corner = 2.0 * np.pi * 2.0 / 5.0 * np.arange(6)
    corners = r * np.stack([np.cos(corner), np.sin(corner), np.zeros(6)], axis=1)
    edge = 2.0 * r * np.sin(2.0 * np.pi / 5.0)
    along = (speed * t / edge) % 5.0
    i = np.minimum(along.astype(int), 4)
    step = corners[i + 1] - corners[i]
    position = corners[i] + (along - i)[:, None] * step + _height(params)
    return PathPoint(position, step * (speed / edge), np.zeros((len(t), 3)))


def trefoil(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Projection of the trefoil knot, x = (sin + 2 sin 2)/3, y = (cos - 2 cos 2)/3, height -``z_amplitude_m`` sin 3.

    A lap is counted as 8.5 times ``scale_m``.
    """
    size = params["scale_m"]
    w = 2.0 * np.pi * params["speed_mps"] / (8.5 * size)
    return _harmonics(t, w, [(0, 1, size / 3, 0.0), (0, 2, 2 * size / 3, 0.0), (1, 1, size / 3, QUARTER),
                             (1, 2, -2 * size / 3, QUARTER), (2, 3, -params["z_amplitude_m"], 0.0)], _height(params))


def linear_ramp(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """Along x to ``distance_m`` and back once in ``duration_s`` at constant speed."""
    speed = 2.0 * params["distance_m"] / params["duration_s"]
    out = t < params["duration_s"] / 2.0
    p, v, a = np.zeros((3, len(t), 3))
    p[:, 0] = np.maximum(np.where(out, speed * t, 2.0 * params["distance_m"] - speed * t), 0.0)
    v[:, 0] = np.where(out, speed, -speed)
    return PathPoint(p + _height(params), v, a)


def lissajous(t: np.ndarray, params: Mapping[str, Any]) -> PathPoint:
    """x = A_x sin(``freq_x`` s + phase), y = A_y sin(``freq_y`` s); lap length by summing 20,000 chords."""
    fx, fy = params["freq_x"], params["freq_y"]
    terms = [(0, fx, params["amplitude_x_m"], np.radians(params["phase_deg"])), (1, fy, params["amplitude_y_m"], 0.0)]
    lap = _harmonics(np.linspace(0.0, 2.0 * np.pi, 20_001), 1.0, terms, np.zeros(3)).position_m
    length = np.sum(np.linalg.norm(np.diff(lap, axis=0), axis=1))
    return _harmonics(t, 2.0 * np.pi * params["speed_mps"] / length, terms, _height(params))


@dataclass(frozen=True)
class Family:
    """``path(t, params)``, t (n,) s from the start of the path; ``defaults`` and the three ``speeds`` fill params."""

    path: Callable[[np.ndarray, Mapping[str, Any]], PathPoint]
    prefix: str
    defaults: Mapping[str, Any]
    speeds: Mapping[str, Mapping[str, Any]]


_SPEEDS = {"slow": {"speed_mps": 0.5}, "medium": {"speed_mps": 0.75}, "fast": {"speed_mps": 1.0}}
_FLAT = {"altitude_m": 1.0, "duration_s": 30.0}

FAMILIES: dict[str, Family] = {
    "circle": Family(circle, "B2", {**_FLAT, "radius_m": 1.0}, _SPEEDS),
    "figure_eight": Family(figure_eight, "B3", {**_FLAT, "scale_m": 1.0},
                           {**_SPEEDS, "medium": {"speed_mps": 0.7}, "fast": {"speed_mps": 1.0, "scale_m": 1.3}}),
    "helix": Family(helix, "B5", {"altitude_start_m": 0.5, "altitude_end_m": 1.5, "duration_s": 30.0, "radius_m": 1.0},
                    _SPEEDS),
    "linear_ramp": Family(linear_ramp, "B6", {"altitude_m": 1.0, "distance_m": 1.0, "duration_s": 20.0},
                          {name: {"speeds_mps": [0.25, 0.5, 1.0]} for name in _SPEEDS}),
    "oval": Family(oval, "B7", {**_FLAT, "radius_x_m": 1.0, "radius_y_m": 0.4},
                   {**_SPEEDS, "medium": {"speed_mps": 0.75, "radius_x_m": 1.5, "radius_y_m": 0.7}}),
    "star": Family(star, "B8", {**_FLAT, "radius_m": 1.0}, {**_SPEEDS, "medium": {"speed_mps": 0.75, "radius_m": 0.6}}),
    "trefoil": Family(trefoil, "B9", {**_FLAT, "scale_m": 1.0, "z_amplitude_m": 0.15},
                      {**_SPEEDS, "slow": {"speed_mps": 0.5, "duration_s": 15.0}, "medium": {"speed_mps": 0.5}}),
    "lissajous": Family(lissajous, "B10", {**_FLAT, "amplitude_x_m": 0.6, "amplitude_y_m": 0.6, "freq_x": 3,
                                           "freq_y": 2, "phase_deg": 90.0}, _SPEEDS),
}


@dataclass(frozen=True)
class PathSpec:
    """A family with all its parameters; ``speed`` is the label slow | medium | fast. ``turn``: amplitude [rad] and
    period [s] of a sinusoidal turning to and fro about the vertical along the path, as no published flight does."""

    family: str
    speed: str
    params: Mapping[str, Any]
    turn: tuple[float, float] = (0.0, 1.0)

    @property
    def trajectory_id(self) -> str:
        """Like the published ones; the linear ramp has no speed in its id."""
        base = f"{FAMILIES[self.family].prefix}_{ID_NAME.get(self.family, self.family)}"
        return base if self.family == "linear_ramp" else f"{base}_{self.speed}"

    @property
    def altitude_m(self) -> float:
        """Height to which the take-off goes."""
        return float(self.params.get("altitude_m", self.params.get("altitude_start_m", 1.0)))

    @property
    def duration_s(self) -> float:
        return float(self.params["duration_s"])

    def at(self, t: np.ndarray) -> PathPoint:
        """t (n,) s from the start of the path."""
        return FAMILIES[self.family].path(np.asarray(t, float), self.params)

    def yaw_at(self, t: np.ndarray) -> np.ndarray:
        """Heading [rad] (n,) at t (n,) s from the start of the path; 0 at its start."""
        amplitude, period_s = self.turn
        return amplitude * np.sin(2.0 * np.pi / period_s * np.asarray(t, float))


ID_NAME = {"figure_eight": "figure8"}
"""Where the published trajectory_id spells a family differently from its trajectory_type."""


def path_spec(family: str = "circle", speed: str = "medium", *, speed_m_s: float | None = None,
              **params: Any) -> PathSpec:
    """The published parameters of a family at a speed, with ``speed_m_s`` and ``params`` replacing some of them.

    Raises UsageError for an unknown family, speed or parameter.
    """
    if family not in FAMILIES:
        raise UsageError(f"unknown family {family!r}; known: {', '.join(FAMILIES)}")
    found = FAMILIES[family]
    if speed not in found.speeds:
        raise UsageError(f"unknown speed {speed!r}; known: {', '.join(found.speeds)}")
    full = {**found.defaults, **found.speeds[speed]}
    if speed_m_s is not None:
        params["speed_mps"] = float(speed_m_s)
    unknown = set(params) - set(full)
    if unknown:
        raise UsageError(f"{family} has no parameter {', '.join(sorted(unknown))}; it has {', '.join(full)}")
    return PathSpec(family, speed, {**full, **params})
