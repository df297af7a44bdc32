"""From whatever goes wrong to the ground: hold the place with the vehicle's own loops, then land by its own planner.

Once landing is under way the vehicle needs the host no more. Where nothing can be sent any more, the vehicle's own
watchdog acts: it levels out 0.5 s after the last set-point and stops its motors after 2 s (supervisor.c of firmware
2025.12.1); the high-level commander is not under that watchdog.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import fly_setpoints
from .fly_clock import Clock
from .fly_link import Link
from .fly_plan import LANDED_M

HOLD_S = 1.0
BRIEF_HOLD_S = 0.2
"""Without poses a hold drifts, without lift it sinks: it is only long enough to stop the path then."""
EVERY_S = 0.02
AGAIN_S = 0.2
"""A command to land may be lost on its way: it is sent again until the vehicle sinks, at most TRIES times."""
TRIES = 3
LANDING_M_S, SHORTEST_LANDING_S = 0.35, 1.5
MARGIN_M = 0.15
"""The place to hold lies this far inside the fence."""
AFTER_S = 0.7
"""From the planner's end to motors off and rest."""


def place_to_hold(position_m: np.ndarray, velocity_m_s: np.ndarray, fence: tuple[np.ndarray, np.ndarray],
                  ground_m: float) -> np.ndarray:
    """Where the vehicle can come to rest (3,): a little ahead of where it is, inside the fence, above the ground."""
    least, most = fence
    margin = np.minimum(MARGIN_M, 0.25 * (most - least))
    place = np.clip(np.nan_to_num(position_m + 0.3 * velocity_m_s), least + margin, most - margin)
    place[2] = max(place[2], ground_m + 2.0 * LANDED_M)
    return place


def hand_over(link: Link, clock: Clock, place_m: np.ndarray, yaw_rad: float, ground_m: float, brief: bool,
              height_m: Callable[[], float], tick: Callable[[], None] = lambda: None) -> None:
    """Holds ``place_m`` (3,), then lands; returns when the vehicle should be on the ground. ``height_m()``: believed
    height now; ``tick`` is called all the while. A set-point that cannot be sent is none: the link may come back."""
    hold = fly_setpoints.position(place_m, yaw_rad)
    until = clock.now() + (BRIEF_HOLD_S if brief else HOLD_S)
    while clock.now() < until:
        _try(link.send_setpoint, hold)
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
    land(link, clock, ground_m, max(place_m[2], height_m()), height_m, tick)


def land(link: Link, clock: Clock, ground_m: float, from_m: float, height_m: Callable[[], float],
         tick: Callable[[], None]) -> None:
    """Lands by the vehicle's own planner from a height, and waits for its end."""
    lasts = _lasts(ground_m, from_m)
    begun, sent, tries = clock.now(), -np.inf, 0
    while clock.now() < begun + lasts + AFTER_S:
        sinks = height_m() < from_m - 0.1
        if tries < TRIES and not sinks and clock.now() - sent > AGAIN_S * (1 + 2 * tries):
            _try(link.release)
            _try(link.land, ground_m + LANDED_M, max(lasts - (clock.now() - begun), SHORTEST_LANDING_S))
            sent, tries = clock.now(), tries + 1
        tick()
        clock.sleep_until(clock.now() + EVERY_S)


def tell_to_land(link: Link, ground_m: float, from_m: float) -> None:
    """Tells the vehicle once to land from a height by its own planner, and waits for nothing."""
    _try(link.release)
    _try(link.land, ground_m + LANDED_M, _lasts(ground_m, from_m))


def _lasts(ground_m: float, from_m: float) -> float:
    return max(SHORTEST_LANDING_S, (from_m - ground_m) / LANDING_M_S)


def _try(send: Callable, *what: object) -> None:
    try:
        send(*what)
    except Exception:  # a driver that is gone raises anything; the vehicle's own watchdog is what is left then
        return
