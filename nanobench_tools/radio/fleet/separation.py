"""Distances that vehicles keep from each other: in plans before take-off, and in flight.

A vehicle below another one flies in its downwash. So the space that each vehicle keeps free is a cylinder that is
higher than wide. Vehicles that approach each other must still be able to brake outside it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...errors import InputError
from ..fly.flight_plan import HOVER_END, TAKEOFF, Plan
from ..fly.mission import LIFT_AGAIN_S
from ..fly.safety import HardFence

STEP_S = 0.02
LATE_S = LIFT_AGAIN_S[0]
"""A vehicle whose command to take off is repeated begins its plan so much later than the others."""
ALONG = np.linspace(0.0, 1.0, 6)


@dataclass(frozen=True)
class Separation:
    """Distances [m] between centres. Conventions, not measured: a Crazyflie 2 is 0.14 m wide.

    - horizontal_m, vertical_m: of the cylinder.
    - landing_m: level distance below which one vehicle would land on the other, at any height.
    - margin_m: added in the check of plans, for errors of tracking."""

    horizontal_m: float = 0.4
    vertical_m: float = 0.8
    landing_m: float = 0.3
    margin_m: float = 0.2

    def why(self, apart_m: np.ndarray, closing_m_s: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
        """Code per row: 0 far enough, 1 inside the cylinder, 2 about to be.

        apart_m, closing_m_s (n, 3): place and velocity of one vehicle relative to another."""
        inside = self._inside(apart_m, margin_m)
        brake = 2.0 * HardFence.BRAKE_M_S2  # both brake
        rest_m = HardFence.DELAY_S * closing_m_s + closing_m_s * np.abs(closing_m_s) / (2.0 * brake)
        nearer = np.sum(apart_m * closing_m_s, axis=1) < 0.0
        soon = np.any([self._inside(apart_m + share * rest_m, margin_m) for share in ALONG], axis=0)
        code: np.ndarray = np.where(inside, 1, np.where(nearer & soon, 2, 0))
        return code

    def _inside(self, apart_m: np.ndarray, margin_m: float) -> np.ndarray:
        wide = np.linalg.norm(apart_m[:, :2], axis=1) < self.horizontal_m + margin_m
        inside: np.ndarray = wide & (np.abs(apart_m[:, 2]) < self.vertical_m + margin_m)
        return inside


@dataclass(frozen=True)
class Timeline:
    """A vehicle over common times (n,): place_m, velocity_m_s (n, 3); low_m, high_m (n,): heights that it may have;
    flies (n,): not on the ground."""

    place_m: np.ndarray
    velocity_m_s: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray
    flies: np.ndarray


def timeline(plan: Plan, delay_s: float, time_s: np.ndarray) -> Timeline:
    """A plan that begins ``delay_s`` after the first vehicle may take off. During take-off and landing any height
    between ground and hover is possible."""
    since = time_s - delay_s
    ends, ground = plan.ends, float(plan.start_m[2])
    reference = plan.at(np.clip(since, 0.0, ends[HOVER_END]))
    place, velocity = reference.position_m.copy(), reference.velocity_m_s.copy()
    before, after = since < 0.0, since > max(ends.values())
    streamed = (since >= ends[TAKEOFF]) & (since <= ends[HOVER_END])
    velocity[~streamed] = 0.0
    low = np.where(streamed, place[:, 2], ground)
    high = np.where(before | after, ground, place[:, 2])
    return Timeline(place, velocity, low, high, ~(before | after))


def check_plans(plans: Mapping[str, tuple[Plan, float]], separation: Separation) -> list[tuple[str, str, float]]:
    """Raises InputError for the first two plans (name -> plan and delay [s]) that come too close.

    Each may be LATE_S late. Returns the pairs with their smallest horizontal distance [m].
    """
    end = LATE_S + max(delay + max(plan.ends.values()) for plan, delay in plans.values())
    time_s = np.arange(0.0, end + STEP_S, STEP_S)
    lines = {name: (timeline(plan, delay, time_s), timeline(plan, delay + LATE_S, time_s))
             for name, (plan, delay) in plans.items()}
    found = []
    for one, other in combinations(lines, 2):
        least = [_check_pair(one, other, lines[one][i], lines[other][j], time_s, separation)
                 for i, j in ((0, 0), (0, 1), (1, 0))]
        found.append((one, other, min(least)))
    return found


def _check_pair(one: str, other: str, a: Timeline, b: Timeline, time_s: np.ndarray, separation: Separation) -> float:
    apart = a.place_m - b.place_m
    gap = np.maximum(a.low_m - b.high_m, 0.0) - np.maximum(b.low_m - a.high_m, 0.0)
    level = np.linalg.norm(apart[:, :2], axis=1)
    both = a.flies & b.flies
    code = separation.why(np.column_stack([apart[:, :2], gap]), a.velocity_m_s - b.velocity_m_s, separation.margin_m)
    code = np.where(both, code, 0)
    code = np.where((a.flies | b.flies) & (level < separation.landing_m), 3, code)
    first = int(np.argmax(code > 0))
    if code[first]:
        reason = {1: "inside the downwash cylinder", 2: "too fast to brake outside the downwash cylinder",
                  3: "so that one would land on the other"}[int(code[first])]
        raise InputError(f"{one} and {other}", f"their plans come too close: {level[first]:.2f} m level and "
                         f"{abs(gap[first]):.2f} m in height apart {time_s[first]:.1f} s after take-off, {reason}",
                         "move or delay one; not armed")
    return float(level[a.flies | b.flies].min())
