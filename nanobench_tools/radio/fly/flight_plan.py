"""Phases of a flight: take-off, hover, approach, fade-in, path, fade-out, hover, landing.

Take-off and landing are the vehicle's planner; the rest is streamed. A fade moves along the path itself, from rest to
its speed or back. The path's time follows the speed of the firmware's polynomial between two standstills, so that
position, velocity, acceleration and jerk stay continuous.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...errors import UsageError
from ...methods import Reference
from ...practice.curves import planner
from ...practice.references import FAMILIES, PathSpec, family_named, path_spec
from ...so3 import wrap_angle

TAKEOFF, HOVER, APPROACH, FADE_IN, PATH, FADE_OUT, HOVER_END, LANDING = PHASES = (
    "take-off", "hover", "approach", "fade-in", "path", "fade-out", "hover at end", "landing")
TAKEOFF_S, SETTLE_S, HOVER_S, FADE_S, END_S, LANDING_S = 2.0, 0.5, 2.0, 2.0, 1.0, 3.0
APPROACH_M_S, SHORTEST_APPROACH_S = 0.4, 1.5
"""Mean speed from the place of take-off to where the path begins."""
LANDED_M = 0.03
"""Height below which a vehicle has landed. Landings are planned to the ground itself. If motors stop above it, the
vehicle falls, and its supervisor may take the second bounce for a crash."""
SIZES = ("scale_m", "radius_m", "radius_x_m", "amplitude_x_m", "distance_m")
SPEED_LABELS = ((0.6, "slow"), (0.85, "medium"), (np.inf, "fast"))


def chosen_path(name: str, speed_m_s: float | None, size_m: float | None, duration_s: float | None) -> PathSpec:
    """The path of a family at a speed. Raises UsageError."""
    family = family_named(name)
    label = next(text for most, text in SPEED_LABELS if (0.5 if speed_m_s is None else speed_m_s) <= most)
    known = {**FAMILIES[family].defaults, **FAMILIES[family].speeds["slow"]}
    params: dict[str, float] = {}
    if duration_s is not None:
        params["duration_s"] = duration_s
    if speed_m_s is not None and "speed_mps" not in known:
        raise UsageError(f"--speed: {family} has no speed; it has {', '.join(known)}")
    if size_m is not None:
        key = next((key for key in SIZES if key in known), None)
        if key is None:
            raise UsageError(f"--size: {family} has no size; it has {', '.join(known)}")
        params[key] = size_m
        for own, other in (("radius_x_m", "radius_y_m"), ("amplitude_x_m", "amplitude_y_m")):
            if key == own:
                params[other] = size_m * known[other] / known[own]
    spec = path_spec(family, "slow", speed_m_s=speed_m_s, **params)
    return PathSpec(spec.family, label, spec.params)


@dataclass(frozen=True)
class Plan:
    """A path from a place on the ground: start_m (3,), start_yaw_rad. Times [s] are from the command to take off."""

    spec: PathSpec
    start_m: np.ndarray
    start_yaw_rad: float

    @property
    def height_m(self) -> float:
        """Of the hover, absolute."""
        return self.spec.altitude_m

    @property
    def hover_m(self) -> np.ndarray:
        return np.array([self.start_m[0], self.start_m[1], self.height_m])

    @cached_property
    def ends(self) -> dict[str, float]:
        """Phase -> time at which it ends."""
        first = self.spec.at(np.zeros(1)).position_m[0]
        approach = max(SHORTEST_APPROACH_S, float(np.linalg.norm(first - self.hover_m)) / APPROACH_M_S)
        inner = max(self.spec.duration_s - FADE_S, 0.0)
        lasts = (TAKEOFF_S + SETTLE_S, HOVER_S, approach, FADE_S, inner, FADE_S, END_S, LANDING_S)
        return dict(zip(PHASES, np.cumsum(lasts).tolist(), strict=True))

    @cached_property
    def _begin_and_end_m(self) -> np.ndarray:
        """(2, 3) of the path."""
        return self._path(np.array([0.0, self.spec.duration_s]), np.zeros((3, 2)))[0]

    def phase(self, time_s: float) -> str:
        """Of a time; the last one after it."""
        return next((name for name, end in self.ends.items() if time_s < end), LANDING)

    def at(self, time_s: np.ndarray) -> Reference:
        """References at times (k,): arrays of (k, 3) and (k,). The hover before it begins, the end of the path after
        it."""
        t = np.asarray(time_s, float)
        ends = self.ends
        first, last = self._begin_and_end_m
        begin, approach = ends[HOVER], ends[APPROACH] - ends[HOVER]
        way, *rises = planner(np.clip((t - begin) / approach, 0.0, 1.0))
        step = first - self.hover_m
        turn = -float(wrap_angle(self.start_yaw_rad))
        parts = [self.hover_m + way[:, None] * step]
        parts += [(rise / approach**k)[:, None] * step for k, rise in enumerate(rises, 1)]
        yaw, yaw_rate = -turn + way * turn, rises[0] / approach * turn
        along, speed = self._own_time(t - ends[APPROACH])
        moving = self._path(along, speed)
        on_path = (t >= ends[APPROACH])[:, None]
        position, velocity, acceleration, jerk = (np.where(on_path, path, before)
                                                  for path, before in zip(moving, parts, strict=True))
        over = t >= ends[FADE_OUT]
        position[over] = last
        turned = on_path[:, 0]
        yaw = np.where(turned, self.spec.yaw_at(along), yaw)
        yaw_rate = np.where(turned, self.spec.yaw_rate_at(along) * speed[0], yaw_rate)
        return Reference(position, yaw, velocity, acceleration, jerk, yaw_rate)

    def reference(self, time_s: float) -> Reference:
        """For a controller of one vehicle, with its future."""
        now = self.at(np.array([time_s]))

        def ahead(seconds: np.ndarray) -> Reference:
            later = self.at(time_s + np.asarray(seconds, float))
            turn = later.yaw_rate_rad_s
            return Reference(later.position_m[:, None], later.yaw_rad[:, None], later.velocity_m_s[:, None],
                             later.acceleration_m_s2[:, None],
                             None if later.jerk_m_s3 is None else later.jerk_m_s3[:, None],
                             None if turn is None else turn[:, None])

        return Reference(now.position_m, now.yaw_rad, now.velocity_m_s, now.acceleration_m_s2, now.jerk_m_s3,
                         now.yaw_rate_rad_s, ahead)

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and most (3,) of all that is streamed."""
        t = np.arange(0.0, self.ends[HOVER_END], 0.02)
        points = self.at(t).position_m
        return points.min(axis=0), points.max(axis=0)

    def fastest_m_s(self) -> float:
        """Of all that is streamed."""
        t = np.arange(0.0, self.ends[HOVER_END], 0.02)
        return float(np.linalg.norm(self.at(t).velocity_m_s, axis=1).max())

    def _own_time(self, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Time along the path (k,) at ``since`` (k,) s after its fade-in began, and three derivatives (3, k)."""
        whole = self.spec.duration_s
        total = max(whole - FADE_S, 0.0) + 2.0 * FADE_S
        share = whole / (total - FADE_S)  # 1 unless the path is shorter than a fade
        back = np.minimum(since, total - since)  # both fades are the same, run backwards
        late = since > total - since
        x = np.clip(back / FADE_S, 0.0, 1.0)
        # speed of the path's time: way of the planner; its integral and derivatives
        integral = FADE_S * x**5 * (7.0 + x * (-14.0 + x * (10.0 - 2.5 * x)))
        speed, bend, third, _ = planner(x)
        along = integral + np.maximum(back - FADE_S, 0.0)
        bend, third = bend / FADE_S, third / FADE_S**2
        along = np.where(late, (total - FADE_S) - along, along)
        bend = np.where(late, -bend, bend)
        inside = (since >= 0.0) & (since <= total)
        return np.clip(share * along, 0.0, whole), share * np.stack([speed, bend, third]) * inside

    def _path(self, along: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, ...]:
        """Position, velocity, acceleration, jerk (k, 3) of the path at its own times (k,), which run at ``speed`` with
        its derivatives (3, k)."""
        p, v, a, j = self.spec.at(along)
        d1, d2, d3 = (x[:, None] for x in speed)
        return p, v * d1, a * d1**2 + v * d2, j * d1**3 + 3.0 * a * d1 * d2 + v * d3
