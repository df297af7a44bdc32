"""What the vehicle may do (supervisor.c, supervisor_state_machine.c): arming, flying, levelling out, stopping."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

EVERY_MS = 40
WARNING_MS, TIMEOUT_MS = 500, 2000
"""Age of a set-point at which the vehicle levels out, and at which its motors stop for good."""
FLYING_MS, PREFLIGHT_MS, LANDING_MS = 2000, 30000, 3000
"""A motor that has turned within this is flying; time to stay ready; time to stay landed."""
TILTED_G, INVERTED_G, FREE_FALL_G = 0.5, -0.2, 0.1
TILTED_MS, INVERTED_MS = 1000, 100
EMERGENCY_WATCHDOG_MS = 1000


class State(IntEnum):
    """As ``supervisor.info`` and the console know them."""

    NOT_INITIALIZED = 0
    CHECKS_NOT_PASSED = 1
    CHECKS_PASSED = 2
    READY = 3
    FLYING = 4
    LANDED = 5
    RESET = 6
    WARNING_LEVEL_OUT = 7
    FREE_FALL = 8
    LOCKED = 9
    CRASHED = 10


S = State
MOTORS = frozenset({S.READY, S.FLYING, S.LANDED, S.WARNING_LEVEL_OUT})
"""States in which motors may turn."""


@dataclass
class Seen:
    """State that is checked 25 times a second: accelerometer (3,) g, age of the set-point, ticks since a motor turned.
    """

    acc_g: np.ndarray
    setpoint_ms: int
    still_ms: int


class Supervisor:
    """One state, and the conditions that move it. ``checks_tumbling`` is the parameter ``supervisor.tmblChckEn``."""

    def __init__(self, say: Callable[[str], None] = lambda line: None) -> None:
        self.state, self.armed, self.checks_tumbling = S.NOT_INITIALIZED, False, 1
        self.tumbled = self.crashed = self.emergency = self.flying = False
        self._say, self._entered_ms, self._landed_ms = say, 0, 0
        self._tilted_since = self._watchdog_ms = -1

    @property
    def motors_allowed(self) -> bool:
        """Whether motors may turn."""
        return self.state in MOTORS

    @property
    def airborne(self) -> bool:
        """Input of the Kalman filter."""
        return self.state in (S.FLYING, S.WARNING_LEVEL_OUT)

    def arm(self, wanted: bool) -> bool:
        """A request from outside; says whether it was followed."""
        if wanted and self.state not in (S.CHECKS_PASSED, *MOTORS):
            return False
        self.armed = wanted
        return True

    def recover(self) -> bool:
        """A request to forget a crash; it is followed while the vehicle does not lie tumbled."""
        if self.state == S.CRASHED and not self.tumbled:
            self.crashed = False
        return not self.crashed

    def stop(self) -> None:
        """Emergency stop: for good, until a restart."""
        self.emergency = True

    def feed_watchdog(self, now_ms: int) -> None:
        """From the first time on an emergency stop follows unless it comes every second."""
        self._watchdog_ms = now_ms

    def update(self, seen: Seen, now_ms: int) -> None:
        """One of the 25 looks in a second."""
        if self._watchdog_ms >= 0 and now_ms - self._watchdog_ms > EMERGENCY_WATCHDOG_MS:
            self.emergency = True
        was, self.flying = self.flying, seen.still_ms < FLYING_MS
        if was and not self.flying:
            self._landed_ms = now_ms
        self.tumbled = self._tumbling(seen.acc_g, now_ms)
        following = self._next(seen, now_ms)
        if following != self.state:
            self._enter(following, now_ms)

    def _tumbling(self, acc_g: np.ndarray, now_ms: int) -> bool:
        up = float(acc_g[2])
        if not self.checks_tumbling or (np.abs(acc_g) < FREE_FALL_G).all() or up >= TILTED_G:
            self._tilted_since = -1
            return False
        if self._tilted_since < 0:
            self._tilted_since = now_ms
        tilted = now_ms - self._tilted_since
        return tilted > TILTED_MS or (up < INVERTED_G and tilted > INVERTED_MS)

    def _next(self, seen: Seen, now_ms: int) -> State:
        """The first transition whose condition holds."""
        warning, timeout = seen.setpoint_ms > WARNING_MS, seen.setpoint_ms > TIMEOUT_MS
        stayed = now_ms - self._entered_ms
        ways: dict[State, tuple[tuple[bool, State], ...]] = {
            S.NOT_INITIALIZED: ((True, S.CHECKS_NOT_PASSED),),
            S.CHECKS_NOT_PASSED: ((self.emergency, S.FREE_FALL), (not self.tumbled, S.CHECKS_PASSED)),
            S.CHECKS_PASSED: ((self.emergency, S.FREE_FALL), (self.tumbled, S.CHECKS_NOT_PASSED),
                              (self.armed, S.READY)),
            S.READY: ((self.emergency, S.FREE_FALL),
                      (self.tumbled or stayed > PREFLIGHT_MS or not self.armed, S.CHECKS_NOT_PASSED),
                      (self.flying, S.FLYING)),
            S.FLYING: ((timeout or self.emergency, S.FREE_FALL), (self.tumbled, S.CRASHED), (not self.armed, S.RESET),
                       (warning, S.WARNING_LEVEL_OUT), (not self.flying, S.LANDED)),
            S.LANDED: ((now_ms - self._landed_ms > LANDING_MS or not self.armed, S.RESET), (self.flying, S.FLYING)),
            S.RESET: ((True, S.CHECKS_NOT_PASSED),),
            S.WARNING_LEVEL_OUT: ((timeout or self.tumbled or self.emergency, S.FREE_FALL), (not warning, S.FLYING)),
            S.FREE_FALL: ((True, S.LOCKED),),
            S.LOCKED: (),
            S.CRASHED: ((self.emergency, S.LOCKED), (not self.crashed and not self.tumbled, S.CHECKS_NOT_PASSED)),
        }
        return next((to for holds, to in ways[self.state] if holds), self.state)

    def _enter(self, state: State, now_ms: int) -> None:
        if self.state in MOTORS and state not in MOTORS:
            self.armed = False
        self.state, self._entered_ms = state, now_ms
        if state == S.CHECKS_PASSED:
            self.armed = True  # this build arms automatically
        elif state == S.CRASHED:
            self.crashed = True
            self._say("SUP: Crashed, recovery needed")
        elif state == S.LOCKED:
            self._say("SUP: Locked, reboot required")
        elif state == S.WARNING_LEVEL_OUT:
            self._say("SUP: No setpoint, levelling out")

    def info(self, high_level: tuple[bool, bool, bool]) -> int:
        """``supervisor.info``; high_level: active, finished, disabled."""
        bits = (self.state in (S.CHECKS_PASSED, *MOTORS), self.armed, True, self.motors_allowed, self.flying,
                self.tumbled, self.state == S.LOCKED, self.crashed, *high_level)
        return sum(1 << i for i, bit in enumerate(bits) if bit)
