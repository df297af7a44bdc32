"""What a practice flight is asked to do when: ground, take-off, hover, path, landing, ground - for n flights at once.

The published recordings run this timeline: motors on at about 2.0 s, take-off planner of 2 s, streamed hover from
2.5 s after it began, streamed path 1 s later, landing planner of 3 s from the place reached, motors off, 3.5 s ground.
The planner is the firmware's seventh-order polynomial between two standstills (zero velocity, acceleration, jerk).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..methods import Reference
from .references import PathSpec

TICK_S = 0.01
"""The high-level commander runs at 100 Hz; so do the streamed setpoints."""
TAKEOFF_S, TAKEOFF_TO_HOVER_S, HOVER_S, LANDING_S = 2.0, 2.5, 1.0, 3.0
LANDED_HEIGHT_M = 0.08
"""Height the landing planner ends at."""
GROUND_AFTER_S = 3.2
LEAD_S = 0.3
"""The messages begin this long before the first row, so that late stamps leave no row without a packet before it."""

OFF, TAKEOFF, HOVER, PATH, LANDING = range(5)


def planner(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of the time 0..1 (any shape) -> share of the way, its first and second derivative by the share of time."""
    x = np.clip(share, 0.0, 1.0)
    inside = (share >= 0.0) & (share <= 1.0)
    way = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    speed = 140.0 * x**3 * (1.0 - x) ** 3
    acceleration = 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x)
    return way, speed * inside, acceleration * inside


@dataclass(frozen=True)
class Events:
    """Times of one flight [s]; the recording's first row is at LEAD_S."""

    motors_on_s: float
    path_start_s: float
    landing_s: float
    motors_off_s: float
    end_s: float


def draw_events(spec: PathSpec, rng: np.random.Generator) -> Events:
    """The published timeline with the small spread seen between recordings."""
    on = round(LEAD_S + 2.0 + 0.1 * rng.uniform(-1.0, 1.0), 2)
    path = round(on + TAKEOFF_TO_HOVER_S + HOVER_S + 0.05 * rng.uniform(0.0, 1.0), 2)
    landing = round(path + spec.duration_s + 0.15, 2)
    off = round(landing + LANDING_S + rng.uniform(0.05, 0.15), 2)
    return Events(on, path, landing, off, round(off + GROUND_AFTER_S + rng.uniform(0.0, 0.2), 2))


class Timeline:
    """Phases and references of n flights on the 100 Hz tick; take-off and landing start where the vehicle is then."""

    def __init__(self, specs: Sequence[PathSpec], events: Sequence[Events]) -> None:
        self.specs, self.events = tuple(specs), tuple(events)
        self.ticks = 1 + max(round(e.end_s / TICK_S) for e in events)
        t = TICK_S * np.arange(self.ticks)[:, None]
        on, path, land, off = (np.array([getattr(e, name) for e in events])[None] - 1e-9
                               for name in ("motors_on_s", "path_start_s", "landing_s", "motors_off_s"))
        hover = on + TAKEOFF_TO_HOVER_S
        before = [(t < on) | (t >= off), t < hover, t < path, t < land]
        self.phase = np.select(before, [OFF, TAKEOFF, HOVER, PATH], LANDING)
        share, duration = (np.where(t < hover, (t - on) / TAKEOFF_S, (t - land) / LANDING_S),
                           np.where(t < hover, TAKEOFF_S, LANDING_S))
        way, speed, acceleration = planner(share)
        self.way, self.way_1_s, self.way_1_s2 = way, speed / duration, acceleration / duration**2
        self.altitude_m = np.array([s.altitude_m for s in specs])
        self._streamed = np.zeros((3, self.ticks, len(specs), 3))
        self._streamed[0, :, :, 2] = self.altitude_m
        self._yaw = np.zeros((self.ticks, len(specs)))
        for i, spec in enumerate(specs):
            rows = self.phase[:, i] == PATH
            self._streamed[:, rows, i] = spec.at(t[rows, 0] - events[i].path_start_s)
            self._yaw[rows, i] = spec.yaw_at(t[rows, 0] - events[i].path_start_s)
        self._from_m = np.zeros((len(specs), 3))
        self._from_yaw = np.zeros(len(specs))

    def __len__(self) -> int:
        return len(self.specs)

    def at(self, tick: int, position_m: np.ndarray, yaw_rad: np.ndarray) -> tuple[np.ndarray, Reference, np.ndarray]:
        """Estimated position (n, 3), yaw (n,) now -> motors allowed (n,) bool, reference with derivatives, and the yaw
        rate [rad/s] (n,) that the planner asks for. Call with rising ticks: the start of a planner is remembered.

        Where motors are off the reference is the place itself, so that no controller winds up.
        """
        phase = self.phase[tick]
        planned = (phase == TAKEOFF) | (phase == LANDING)
        begins = planned & (phase != self.phase[tick - 1]) if tick else planned
        self._from_m = np.where(begins[:, None], position_m, self._from_m)
        self._from_yaw = np.where(begins, yaw_rad, self._from_yaw)
        p, v, a = (x[tick].copy() for x in self._streamed)
        target = self._from_m.copy()
        target[:, 2] = np.where(phase == TAKEOFF, self.altitude_m, LANDED_HEIGHT_M)
        path = target - self._from_m
        col = planned[:, None]
        p = np.where(col, self._from_m + self.way[tick][:, None] * path, p)
        v = np.where(col, self.way_1_s[tick][:, None] * path, v)
        a = np.where(col, self.way_1_s2[tick][:, None] * path, a)
        yaw = np.where(planned, self._from_yaw * (1.0 - self.way[tick]), self._yaw[tick])
        yaw_rate = np.where(planned, -self._from_yaw * self.way_1_s[tick], 0.0)
        off = phase == OFF
        p[off], v[off], a[off] = position_m[off], 0.0, 0.0
        return ~off, Reference(p, np.where(off, yaw_rad, yaw), v, a), yaw_rate

    def as_flown(self, tick: int, reference: Reference) -> Reference:
        """The reference the published flights got: streamed points carry no derivatives, the onboard planner's do."""
        streamed = (self.phase[tick] == HOVER) | (self.phase[tick] == PATH)
        keep = ~streamed[:, None]
        return Reference(reference.position_m, reference.yaw_rad, reference.velocity_m_s * keep,
                         reference.acceleration_m_s2 * keep)
