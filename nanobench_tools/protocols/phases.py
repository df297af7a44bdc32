"""Parts of a flight found from content: motors on, the phase in which a path is streamed, a piece cut to the flight."""

from collections.abc import Iterable

import numpy as np

from ..flight import Flight, Span, intersect_spans, mask_of
from ..settings import number
from ..units import PWM_FULL_SCALE

MOTOR_ON = 1000.0 / PWM_FULL_SCALE
"""PWM ratio of motor 1 above which the published protocol takes a row for flown."""

MOVING_M_S = number("tasks.phases.moving_m_s")
PAUSE_S = number("tasks.phases.pause_s")
LANDING_JUMP_S = number("tasks.phases.landing_jump_s")
SHORTEST_S = number("tasks.phases.shortest_s")

JUMP_FACTOR = number("tasks.phases.jump_factor")


def motors_on(flight: Flight) -> np.ndarray:
    """(n,) bool over the rows of the motor stream: motor 1 above MOTOR_ON."""
    return flight["motor"]["m1"] > MOTOR_ON


def is_cut(flight: Flight) -> bool:
    """Whether the recording is a piece already cut to the flight: its motors run from the first rows on.

    A whole recording starts on the ground with the motors off. False where motor 1 was not logged.
    """
    if "motor" not in flight or "m1" not in flight["motor"]:
        return False
    on = motors_on(flight)
    return len(on) > 0 and bool(on[:10].all())


def flown_spans(flight: Flight, airborne: Iterable[Span]) -> tuple[Span, ...]:
    """Where a recording is scored: airborne, or for a piece cut to the flight all its rows with motors on.

    A cut piece has no rest to measure a height above.
    """
    if not is_cut(flight):
        return tuple(airborne)
    time_s, on = flight["motor"].time_s, np.flatnonzero(motors_on(flight))
    return (Span(float(time_s[on[0]]), float(time_s[on[-1]])),)


def streamed_phase(flight: Flight, valid: Iterable[Span] | None = None) -> Span | None:
    """The stretch in which a path was streamed to the vehicle, between hover and landing; or None.

    From the setpoint stream alone: the longest stretch in which the horizontal setpoint moves. Jumps to the start of
    the path and to the landing place do not count. Planned take-off and landing hold x and y still. ``valid``: spans
    in which the setpoints are to be trusted; a log that stopped is followed only up to its stop.
    """
    setpoint = flight["setpoint"]
    rows = np.ones(len(setpoint), bool) if valid is None else mask_of(valid, setpoint.time_s)
    time_s, xy = setpoint.time_s[rows], setpoint["x", "y"][rows]
    if len(time_s) < 2:
        return None
    dt = np.diff(time_s)
    speed = np.linalg.norm(np.diff(xy, axis=0), axis=1) / np.where(dt > 0.0, dt, np.inf)
    moving = np.flatnonzero(speed > MOVING_M_S)
    if not len(moving):
        return None
    pauses = np.flatnonzero(np.diff(time_s[moving]) > PAUSE_S)
    runs = np.split(moving, pauses + 1)
    run = max(runs, key=lambda r: time_s[r[-1] + 1] - time_s[r[0]])
    start = run[0] + _jump_rows(speed[run[0]:run[-1]])
    # A path that runs into the last valid row has no landing jump to take off.
    jump = 0.0 if run[-1] + 1 == len(time_s) - 1 else LANDING_JUMP_S
    phase = Span(float(time_s[start]), float(time_s[run[-1] + 1]) - jump)
    return phase if phase.duration_s >= SHORTEST_S else None


def _jump_rows(speed: np.ndarray) -> int:
    """How many rows the jump at the start of a path takes; the first may hold a part of it only. 0 without a jump."""
    fast = speed > JUMP_FACTOR * np.median(speed)
    first = int(np.argmax(fast))
    if first > 1 or not fast[first]:
        return 0
    return first + int(np.argmin(fast[first:]))


def tracking_spans(flight: Flight, valid: tuple[Span, ...]) -> tuple[Span, ...]:
    """``streamed_phase`` where ``valid``; empty without one."""
    phase = streamed_phase(flight, valid)
    return () if phase is None else intersect_spans([phase], valid)
