"""The reference paths: families with the parameters of the published sheets, and one path with all its numbers.

A new family is one function in ``curves.py`` or ``courses.py`` and one line in FAMILIES.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import UsageError, unknown_name
from ..lookup.deprecation import todays_name
from ..methods import Reference
from .courses import minimum_snap, time_optimal_eight
from .curves import (
    PathPoint,
    circle,
    figure_eight,
    helix,
    hover_until_landing,
    linear_ramp,
    lissajous,
    multisine_sysid,
    oval,
    random_waypoints,
    staircase_climb,
    star,
    trefoil,
)


@dataclass(frozen=True)
class Family:
    """``path(t, params)``, t (n,) s from the start of the path; ``defaults`` and the three ``speeds`` fill params."""

    path: Callable[[np.ndarray, Mapping[str, Any]], PathPoint]
    prefix: str
    defaults: Mapping[str, Any]
    speeds: Mapping[str, Mapping[str, Any]]


_SPEEDS = {"slow": {"speed_mps": 0.5}, "medium": {"speed_mps": 0.75}, "fast": {"speed_mps": 1.0}}
_ONE_SPEED: dict[str, dict[str, Any]] = {name: {} for name in _SPEEDS}
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
    "multisine_sysid": Family(multisine_sysid, "A1b", {
        "altitude_m": 1.1, "duration_s": 60.0, "fade_s": 2.0, "freq_max_hz": 5.0, "freq_min_hz": 0.1,
        "num_components": 15, "period_s": 30.0, "x_amplitude_m": 0.8, "y_amplitude_m": 0.8, "z_amplitude_m": 0.35},
        _ONE_SPEED),
    "random_waypoints": Family(random_waypoints, "B11", {
        "altitude_m": 1.1, "duration_s": 60.0, "num_waypoints": 39, "seed": 42, "speed_mps": 0.75, "x_max_m": 2.0,
        "x_min_m": -1.0, "y_max_m": 1.0, "y_min_m": -1.7, "z_max_m": 1.5, "z_min_m": 0.7}, _ONE_SPEED),
    "staircase_climb": Family(staircase_climb, "B12", {
        "altitude_m": 0.5, "duration_s": 60.0, "hold_time_s": 2.0, "speed_mps": 0.3, "step_m": 0.5, "x_max_m": 1.5,
        "z_climb_m": 0.9}, _ONE_SPEED),
    "hover_until_landing": Family(hover_until_landing, "C4", {"altitude_m": 1.0, "min_voltage": 3.0,
                                                              "duration_s": 60.0}, _ONE_SPEED),
    "time_optimal_eight": Family(time_optimal_eight, "H1", {**_FLAT, "scale_m": 1.0}, {
        "slow": {"acceleration_m_s2": 1.0}, "medium": {"acceleration_m_s2": 2.0}, "fast": {"acceleration_m_s2": 3.0}}),
    "minimum_snap": Family(minimum_snap, "H2", {**_FLAT, "waypoints_m": (
        (0.9, 0.5, 1.3), (0.2, 1.0, 0.8), (-0.8, 0.6, 1.2), (-0.3, -0.2, 0.7), (-0.9, -0.9, 1.1), (0.3, -1.0, 1.4),
        (1.0, -0.4, 0.9))}, {"slow": {"speed_mps": 0.4}, "medium": {"speed_mps": 0.55}, "fast": {"speed_mps": 0.7}}),
}
"""Families H are not of the published sheets: they show what is left to gain above them."""

RECORDED = ("circle", "figure_eight", "helix", "linear_ramp", "oval", "star", "trefoil", "lissajous")
"""The families of which there are recordings; practice flights fly these unless told otherwise."""


@dataclass(frozen=True)
class PathSpec:
    """A family with all its parameters; ``speed`` is the label slow | medium | fast. ``turn``: amplitude [rad] and
    period [s] of a sinusoidal rotation about the vertical along the path. No published flight has it."""

    family: str
    speed: str
    params: Mapping[str, Any]
    turn: tuple[float, float] = (0.0, 1.0)

    @property
    def has_speeds(self) -> bool:
        """Whether the family is flown slow, medium and fast."""
        speeds = FAMILIES[self.family].speeds
        return speeds["slow"] != speeds["fast"]

    @property
    def trajectory_id(self) -> str:
        """Like the published ones; families of one speed have none in their id."""
        base = f"{FAMILIES[self.family].prefix}_{ID_NAME.get(self.family, self.family)}"
        return f"{base}_{self.speed}" if self.has_speeds else base

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

    def yaw_rate_at(self, t: np.ndarray) -> np.ndarray:
        """Derivative [rad/s] (n,) of the heading."""
        amplitude, period_s = self.turn
        return amplitude * 2.0 * np.pi / period_s * np.cos(2.0 * np.pi / period_s * np.asarray(t, float))

    def reference(self, t: np.ndarray) -> Reference:
        """All references of a controller at t (n,) s from the start of the path."""
        p, v, a, j = self.at(t)
        return Reference(p, self.yaw_at(t), v, a, j, self.yaw_rate_at(t))


ID_NAME = {"figure_eight": "figure8", "hover_until_landing": "battery_drain"}
"""Where the published trajectory_id spells a family differently from its trajectory_type."""


def family_named(name: str) -> str:
    """The family that ``name`` means; a former name warns. Raises UsageError with the nearest one for an unknown."""
    family = todays_name("--trajectory", name)
    if family not in FAMILIES:
        raise unknown_name("trajectory", name, FAMILIES)
    return family


def path_spec(family: str = "circle", speed: str = "medium", *, speed_m_s: float | None = None,
              **params: Any) -> PathSpec:
    """The published parameters of a family at a speed, with ``speed_m_s`` and ``params`` replacing some of them.

    Raises UsageError for an unknown family, speed or parameter.
    """
    family = family_named(family)
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
