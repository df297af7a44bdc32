"""From any fault to the ground: hold the place with the vehicle's own loops, then land by its own planner.

Once landing has begun the vehicle no longer needs the host. If the link is lost, the vehicle's watchdog acts. It
levels out 0.5 s after the last set-point and stops its motors after 2 s (supervisor.c of firmware 2025.12.1). The
high-level commander is not under that watchdog.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..host_clock import Clock
from ..vehicle_link import HL_LAND, Link
from . import setpoint_packets
from .flight_plan import LANDED_M
from .landing_profile import LANDING_M_S, SHORTEST_LANDING_S, goal_m, lasts_s
from .pose_tracker import Believed

HOLD_S = 1.0
BRIEF_HOLD_S = 0.2
"""Without poses a hold drifts, without lift it sinks: it is only long enough to stop the path then."""
EVERY_S = 0.02
AGAIN_S, TRIES = 0.05, 20
"""Time for which the commands to land and to end set-points, in this order, are repeated, since any may be lost. A
planner that lands refuses a repetition. If set-points end before it knows of the landing, the vehicle falls."""
ANSWER_S, UNANSWERED_S = 0.15, 1.2
"""Maximum wait for the planner's answer to one command to land, without set-points, which would end the planner's work.
Then the vehicle is held and commanded again. A planner that has not answered for UNANSWERED_S is not used."""
UNHEARD_S, SUNK_M, SINKS_M_S = 1.5, 0.05, 0.1
"""A vehicle that has not begun to sink by then is not landing, and its watchdog stops its motors half a second later.
A planner's landing from 3 m has sunk by 7 cm; one that is given over from velocities may rise a little before."""
FALLS_M_S = 1.8
"""Planned landings have 0.77 m/s at most, and 1.3 m/s while they take over from rates and thrust: what sinks faster has
no planner."""
MARGIN_M = 0.15
"""The place to hold lies this far inside the fence."""
AFTER_S = 0.7
"""From the planner's end to motors off and rest."""
AT_ONCE = 3


def place_to_hold(position_m: np.ndarray, velocity_m_s: np.ndarray, fence: tuple[np.ndarray, np.ndarray],
                  ground_m: float) -> np.ndarray:
    """Where the vehicle can come to rest (3,): a little ahead of where it is, inside the fence, above the ground."""
    least, most = fence
    margin = np.minimum(MARGIN_M, 0.25 * (most - least))
    place = np.clip(np.nan_to_num(position_m + 0.3 * velocity_m_s), least + margin, most - margin)
    place[2] = max(place[2], ground_m + 2.0 * LANDED_M)
    return place


def hand_over(link: Link, clock: Clock, place_m: np.ndarray, yaw_rad: float, ground_m: float, brief: bool,
              seen: Callable[[], Believed | None], tick: Callable[[], None] = lambda: None,
              own: Callable[[np.ndarray], np.ndarray] | None = None) -> str:
    """Holds ``place_m`` (3,), then lands as ``land``; returns when it should be on the ground. ``seen()``: the vehicle
    as the poses show it now, None without; ``tick`` is called all the while. ``own``: a place (3,) in the belief of a
    vehicle that is astray, whose planner is no help. A set-point that cannot be sent is none: the link may come back.
    """
    if own is not None:
        _lower(link, clock, seen(), ground_m, seen, tick, own)
        return "it does not know where it is"
    hold = setpoint_packets.position(place_m, yaw_rad)
    until = clock.now() + (BRIEF_HOLD_S if brief else HOLD_S)
    while clock.now() < until:
        _try(link.send_setpoint, hold)
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
    now = seen()
    from_m = float(place_m[2]) if now is None else max(float(place_m[2]), float(now.position_m[2]))
    return land(link, clock, ground_m, from_m, seen, tick)


def land(link: Link, clock: Clock, ground_m: float, from_m: float, seen: Callable[[], Believed | None],
         tick: Callable[[], None]) -> str:
    """Land by the vehicle's own planner from a height and wait for the end. Returns "", or why set-points took it down
    instead. Without poses it returns when the planner ends, before it is certain that the vehicle is on the ground."""
    first = seen()
    lasts = lasts_s(ground_m, from_m, blind=first is None)
    answers = first is not None and bool(link.planner_answers)
    if first is not None and answers and not _answered(link, clock, ground_m, lasts, first, tick):
        _lower(link, clock, _above(first, seen()), ground_m, seen, tick)
        return f"its planner did not answer the command to land for {UNANSWERED_S:.1f} s"
    begun, sent, tries = clock.now(), -np.inf, 0
    while (since := clock.now() - begun) < lasts + (0.0 if first is None else AFTER_S):
        if tries < TRIES and clock.now() - sent > AGAIN_S - 1e-6:
            _tell(link, ground_m, max(lasts - since, SHORTEST_LANDING_S))
            sent, tries = clock.now(), tries + 1
        why = _not_landing(first, seen(), since, ground_m, judged=not answers or bool(link.alarm))
        if why:
            _lower(link, clock, _above(first, seen()), ground_m, seen, tick)
            return why
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
    return ""


def _answered(link: Link, clock: Clock, ground_m: float, lasts: float, first: Believed,
              tick: Callable[[], None]) -> bool:
    """Commands the landing while the last set-point holds, until the planner has accepted it. Set-points may end then:
    a vehicle without both falls."""
    begun = clock.now()
    while clock.now() - begun < UNANSWERED_S:
        _try(link.land, goal_m(ground_m), lasts)
        asked = clock.now()
        while clock.now() - asked < ANSWER_S:
            tick()
            clock.sleep_until(clock.now() + 0.5 * EVERY_S)
            answer_s, error = link.planner_answers.get(HL_LAND, (-np.inf, 0))
            if answer_s > begun and error == 0:
                return True
        _try(link.send_setpoint, setpoint_packets.position(first.position_m, first.yaw_rad))
    return False


def _above(first: Believed | None, now: Believed | None) -> Believed | None:
    """Over the place where the landing began, as high as now: a vehicle in wind drifts while its loops take over."""
    if first is None or now is None:
        return first or now
    return replace(now, position_m=np.array([*first.position_m[:2], now.position_m[2]]))


def _not_landing(first: Believed | None, now: Believed | None, since_s: float, ground_m: float, judged: bool) -> str:
    """``judged``: whether a vehicle that does not sink does not land. A planner that answered may let it rise first.
    If the end of set-points is lost, the vehicle reports on its console that it levels out."""
    if first is None or now is None or now.position_m[2] < ground_m + 2.0 * LANDED_M:
        return ""
    if now.velocity_m_s[2] < -FALLS_M_S:
        return f"commanded to land it fell with {-now.velocity_m_s[2]:.1f} m/s"
    sinks = now.position_m[2] < first.position_m[2] - SUNK_M or now.velocity_m_s[2] < -SINKS_M_S
    if judged and UNHEARD_S < since_s < UNHEARD_S + 2.0 * EVERY_S and not sinks:
        return f"commanded to land it did not sink for {UNHEARD_S:.1f} s"
    return ""


def _lower(link: Link, clock: Clock, first: Believed | None, ground_m: float, seen: Callable[[], Believed | None],
           tick: Callable[[], None], own: Callable[[np.ndarray], np.ndarray] = lambda place: place) -> None:
    """Down by set-points from where it is, until it is seen near the ground or should be."""
    if first is None:
        return
    now: Believed | None = first
    top, begun = float(first.position_m[2]), clock.now()
    most_s = (top - ground_m) / LANDING_M_S + 2.0 * AFTER_S
    while (since := clock.now() - begun) < most_s and (now is None or now.position_m[2] > ground_m + LANDED_M):
        place = np.array([*first.position_m[:2], max(top - LANDING_M_S * since, ground_m - MARGIN_M)])
        _try(link.send_setpoint, setpoint_packets.position(own(place), first.yaw_rad))
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
        now = seen()


def command_landing(link: Link, ground_m: float, from_m: float) -> None:
    """Command a landing from a height by the vehicle's own planner, a few times at once, without waiting; poses end."""
    for _ in range(AT_ONCE):
        _tell(link, ground_m, lasts_s(ground_m, from_m, blind=True))


def _tell(link: Link, ground_m: float, lasts: float) -> None:
    _try(link.land, goal_m(ground_m), lasts)
    _try(link.release)


def _try(send: Callable[..., object], *what: object) -> None:
    try:
        send(*what)
    except Exception:  # a driver that is gone raises anything; the vehicle's own watchdog is what is left then
        return
