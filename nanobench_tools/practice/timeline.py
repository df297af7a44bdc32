"""Timeline of n practice flights: ground, take-off, hover, path, landing, ground.

The published recordings run this timeline: motors on at about 2.0 s, take-off planner of 2 s, streamed hover from 2.5
s after it began. The streamed path begins 1 s later. Then come the landing planner of 3 s from the place reached,
motors off, and 3.5 s ground. The planner is the firmware's seventh-order polynomial between two standstills (zero
velocity, acceleration, jerk).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..methods import Reference
from .curves import planner
from .references import PathSpec

TICK_S = 0.01
"""The high-level commander runs at 100 Hz; so do the streamed setpoints."""
TAKEOFF_S, TAKEOFF_TO_HOVER_S, HOVER_S, LANDING_S = 2.0, 2.5, 1.0, 3.0
LANDED_HEIGHT_M = 0.08
"""Height the landing planner ends at."""
GROUND_AFTER_S = 3.2
LEAD_S = 0.3
"""The messages begin this long before the first row, so that late timestamps leave no row without a packet before
it."""

OFF, TAKEOFF, HOVER, PATH, LANDING = range(5)


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
        way, speed, acceleration, jerk = planner(share)
        self.way, self.way_1_s = way, speed / duration
        self._planned = (acceleration / duration**2, jerk / duration**3)
        self.altitude_m = np.array([s.altitude_m for s in specs])
        self._streamed = np.zeros((4, self.ticks, len(specs), 3))
        self._streamed[0, :, :, 2] = self.altitude_m
        self._yaw, self._yaw_rate = np.zeros((2, self.ticks, len(specs)))
        for i, spec in enumerate(specs):
            rows = self.phase[:, i] == PATH
            self._streamed[:, rows, i] = spec.at(t[rows, 0] - events[i].path_start_s)
            self._yaw[rows, i] = spec.yaw_at(t[rows, 0] - events[i].path_start_s)
            self._yaw_rate[rows, i] = spec.yaw_rate_at(t[rows, 0] - events[i].path_start_s)
        self._from_m = np.zeros((len(specs), 3))
        self._from_yaw = np.zeros(len(specs))
        ends = [np.flatnonzero(self.phase[:, i] == PATH)[-1:] for i in range(len(specs))]
        self._last_m = np.stack([self._streamed[0, end[0] if len(end) else 0, i] for i, end in enumerate(ends)])
        self._last_yaw = np.array([self._yaw[end[0] if len(end) else 0, i] for i, end in enumerate(ends)])

    def __len__(self) -> int:
        return len(self.specs)

    def at(self, tick: int, position_m: np.ndarray, yaw_rad: np.ndarray) -> tuple[np.ndarray, Reference, np.ndarray]:
        """Estimated position (n, 3), yaw (n,) now -> motors allowed (n,) bool, reference with derivatives, and the
        planner's yaw rate [rad/s] (n,). Call with rising ticks: the start of a planner is remembered.

        With motors off the reference is the place itself, so that no controller winds up.
        """
        phase = self.phase[tick]
        planned = (phase == TAKEOFF) | (phase == LANDING)
        begins = planned & (phase != self.phase[tick - 1]) if tick else planned
        self._from_m = np.where(begins[:, None], position_m, self._from_m)
        self._from_yaw = np.where(begins, yaw_rad, self._from_yaw)
        whole, yaw_rate = self._commanded(np.array([tick]), (self._from_m, self._from_yaw), (position_m, yaw_rad))
        p, yaw, v, a, j, turn = (row[0] for row in whole)
        now = Reference(p, yaw, v, a, j, turn, partial(self._ahead, tick, position_m, yaw_rad))
        return phase != OFF, now, yaw_rate[0]

    def _commanded(self, rows: np.ndarray, start: tuple[np.ndarray, np.ndarray],
               rest: tuple[np.ndarray, np.ndarray]) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        """References at ticks ``rows`` (k,): the six arrays of a Reference, (k, n, ...), and the planner's yaw rate (k,
        n). ``start`` and ``rest``: place (n, 3) and yaw (n,) at the start of a planner and without motors."""
        phase = self.phase[rows]
        planned, off = (phase == TAKEOFF) | (phase == LANDING), phase == OFF
        way, speed = self.way[rows], self.way_1_s[rows]
        target = np.repeat(start[0][None], len(rows), axis=0)
        target[:, :, 2] = np.where(phase == TAKEOFF, self.altitude_m, LANDED_HEIGHT_M)
        path = target - start[0]
        p, v, a, j = self._streamed[:, rows]
        col = planned[:, :, None]
        p = np.where(col, start[0] + way[:, :, None] * path, p)
        v = np.where(col, speed[:, :, None] * path, v)
        a, j = (np.where(col, by[rows][:, :, None] * path, streamed)
                for by, streamed in zip(self._planned, (a, j), strict=True))
        yaw = np.where(planned, start[1] * (1.0 - way), self._yaw[rows])
        yaw_rate = np.where(planned, -start[1] * speed, 0.0)
        p[off], v[off], a[off], j[off] = np.broadcast_to(rest[0], p.shape)[off], 0.0, 0.0, 0.0
        turn = np.where(planned, yaw_rate, np.where(off, 0.0, self._yaw_rate[rows]))
        return (p, np.where(off, rest[1], yaw), v, a, j, turn), yaw_rate

    def _ahead(self, tick: int, position_m: np.ndarray, yaw_rad: np.ndarray, seconds: np.ndarray) -> Reference:
        """``Reference.ahead`` at a tick, linear between ticks. A planner that has not begun starts at the end of the
        path, or for take-off at the place of the vehicle."""
        phase = self.phase[tick]
        planned, off = (phase == TAKEOFF) | (phase == LANDING), phase == OFF
        start = np.where(planned[:, None], self._from_m, np.where(off[:, None], position_m, self._last_m))
        start_yaw = np.where(planned, self._from_yaw, np.where(off, yaw_rad, self._last_yaw))
        landed = start.copy()
        landed[:, 2] = LANDED_HEIGHT_M
        rest = np.where(off[:, None], position_m, landed), np.where(off, yaw_rad, 0.0)
        exact = np.minimum(tick + np.asarray(seconds, float) / TICK_S, self.ticks - 1.0)
        rows = np.floor(exact + 1e-9).astype(int)
        share = exact - rows
        low, _ = self._commanded(rows, (start, start_yaw), rest)
        high, _ = self._commanded(np.minimum(rows + 1, self.ticks - 1), (start, start_yaw), rest)
        p, yaw, v, a, j, turn = (x + share.reshape(-1, *[1] * (x.ndim - 1)) * (y - x)
                                 for x, y in zip(low, high, strict=True))
        return Reference(p, yaw, v, a, j, turn)

    def as_flown(self, tick: int, reference: Reference) -> Reference:
        """The reference the published flights got: streamed points carry no derivatives, the onboard planner's do."""
        streamed = (self.phase[tick] == HOVER) | (self.phase[tick] == PATH)

        def commanded(derivative: np.ndarray) -> np.ndarray:
            return np.where(streamed.reshape(-1, *[1] * (derivative.ndim - 1)), 0.0, derivative)

        jerk, turn = reference.jerk_m_s3, reference.yaw_rate_rad_s
        return Reference(reference.position_m, reference.yaw_rad, commanded(reference.velocity_m_s),
                         commanded(reference.acceleration_m_s2), None if jerk is None else commanded(jerk),
                         None if turn is None else commanded(turn))
