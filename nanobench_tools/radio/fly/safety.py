"""Safety rules of a flight: each looks at the situation of one tick and returns the reason to end the flight, or "".

The first reason ends it: the vehicle holds its place with its own loops and lands (``safety_handover``). A new rule is
one class here and one line in ``rules``.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ...errors import UsageError

TUMBLED, LOCKED, CRASHED = 1 << 5, 1 << 6, 1 << 7
"""Bits of ``supervisor.info`` (supervisor.c of firmware 2025.12.1)."""


@dataclass
class Situation:
    """One tick.

    - time_s: of the flight.
    - position_m, velocity_m_s (3,) world and tilt_rad: present estimates.
    - pose_age_s: of the newest pose; battery_V: as last logged; silent_s: since the last packet of the vehicle.
    - lost: why the link is gone.
    - late_ticks: that missed their deadline one after the other; call_s: of the slowest call of the controller since
      the last tick; controller_error: in words.
    - interrupted: name of the signal; supervisor: its bits.
    - streamed: the host flies, not the vehicle's own planner.
    - below_m: height below the set-point, negative above it; sinks_m_s: speed downwards beyond the commanded one.
    - health_age_s: since the last battery or supervisor value.
    - pose_fault: why the poses are not believed, in words.
    - home_s: time that landing from here takes.
    - trip_s: median of the last round trips of the link, or the delay of the log if that is longer.
    - alarm: console line of the vehicle that reports a failure.
    - estimate_fault: why the vehicle's estimate is not trusted, in words; only without poses.
    - astray_m: between the vehicle's own estimate and the poses, nan if unknown."""

    time_s: float = 0.0
    position_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    velocity_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    tilt_rad: float = 0.0
    pose_age_s: float = 0.0
    battery_V: float = 4.0
    silent_s: float = 0.0
    lost: str = ""
    late_ticks: int = 0
    call_s: float = 0.0
    controller_error: str = ""
    interrupted: str = ""
    supervisor: int = 0
    below_m: float = 0.0
    sinks_m_s: float = 0.0
    health_age_s: float = 0.0
    astray_m: float = float("nan")
    pose_fault: str = ""
    home_s: float = 0.0
    trip_s: float = 0.0
    alarm: str = ""
    estimate_fault: str = ""


class Rule(Protocol):
    """``name`` is in the exit line and in the log; ``check`` gives why the flight ends, or ""."""

    name: str

    def check(self, now: Situation) -> str: ...


@dataclass(frozen=True)
class Limits:
    """``fence_m``: least and most x, y, z; ``stale_s``, ``silent_s``: without poses, without a packet; battery_V under
    load; tilt_deg, speed_m_s; ``overrun_s``: one call of the controller; late_ticks in a row."""

    fence_m: tuple[float, float, float, float, float, float] = (-2.0, 2.0, -2.0, 2.0, -0.1, 2.0)
    stale_s: float = 0.3
    silent_s: float = 0.5
    battery_V: float = 2.9
    tilt_deg: float = 50.0
    speed_m_s: float = 3.0
    overrun_s: float = 0.1
    late_ticks: int = 10

    def __post_init__(self) -> None:
        low, high = self.fence
        if not (np.isfinite([*low, *high]).all() and (low < high).all()):
            raise UsageError("--fence: give X_MIN X_MAX Y_MIN Y_MAX Z_MIN Z_MAX [m], each least below its most")

    @property
    def fence(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and most (3,)."""
        return np.array(self.fence_m[::2], float), np.array(self.fence_m[1::2], float)


class Interrupted:
    """Somebody asks for the end: Ctrl-C, or the end of the session."""

    name = "interrupted"

    def check(self, now: Situation) -> str:
        return now.interrupted


class LostLink:
    """No packet for ``silent_s``, or the driver says so."""

    name = "lost link"

    def __init__(self, silent_s: float) -> None:
        self.silent_s = silent_s

    def check(self, now: Situation) -> str:
        if now.lost:
            return now.lost
        return f"no packet for {now.silent_s:.2f} s" if now.silent_s > self.silent_s else ""


class StalePose:
    """No pose for ``stale_s``: neither the vehicle nor the controller knows where it is."""

    name = "stale pose"

    def __init__(self, stale_s: float) -> None:
        self.stale_s = stale_s

    def check(self, now: Situation) -> str:
        return f"no pose for {now.pose_age_s:.2f} s" if not now.pose_age_s <= self.stale_s else ""


class PosesDisagree:
    """Poses repeat, jump, or contradict the IMU: frozen, swapped, mirrored or late."""

    name = "poses"

    def check(self, now: Situation) -> str:
        return now.pose_fault


class Geofence:
    """The believed place leaves the box; below its floor is the ground, which is no reason."""

    name = "geofence"

    def __init__(self, least_m: np.ndarray, most_m: np.ndarray) -> None:
        self.least_m, self.most_m = least_m, most_m

    def check(self, now: Situation) -> str:
        beyond = np.maximum(self.least_m - now.position_m, now.position_m - self.most_m)
        axis = int(np.argmax(beyond))
        if not beyond[axis] > 0.0:
            return ""
        limit = self.most_m[axis] if now.position_m[axis] > self.most_m[axis] else self.least_m[axis]
        return f"{'xyz'[axis]} = {now.position_m[axis]:.2f} m, the fence is at {limit:.2f} m"


class HardFence:
    """HARD_M outside the fence the motors stop: a vehicle that got there obeys nobody. ``check`` is for a vehicle that
    is still inside and could not brake before it; ``beyond`` is the hard fence itself."""

    name = "braking distance"
    HARD_M, DELAY_S, BRAKE_M_S2 = 1.0, 0.1, 3.0

    def __init__(self, least_m: np.ndarray, most_m: np.ndarray) -> None:
        self.least_m, self.most_m = least_m - self.HARD_M, most_m + self.HARD_M

    def _outside_m(self, place_m: np.ndarray) -> float:
        return float(np.maximum(self.least_m - place_m, place_m - self.most_m).max())

    def check(self, now: Situation) -> str:
        speed = now.velocity_m_s
        rests_m = now.position_m + self.DELAY_S * speed + speed * np.abs(speed) / (2.0 * self.BRAKE_M_S2)
        rests_m[2] = max(rests_m[2], self.least_m[2])  # the ground is below
        if not self._outside_m(rests_m) > 0.0:
            return ""
        return (f"at {np.linalg.norm(speed):.1f} m/s it would come to rest {self._outside_m(rests_m):.2f} m outside "
                "the hard fence")

    def beyond(self, now: Situation) -> str:
        outside = self._outside_m(np.maximum(now.position_m, [-np.inf, -np.inf, self.least_m[2]]))
        return f"{outside:.2f} m outside the hard fence" if outside > 0.0 else ""


class SlowLink:
    """Round trips are slow, or the log comes late, for FOR_S. Set-points come late then, too. A landing may be needed
    while the link still works."""

    name = "slow link"
    MOST_S, FOR_S = 0.25, 0.4

    def __init__(self) -> None:
        self._time_s = self._slow_s = 0.0

    def check(self, now: Situation) -> str:
        step, self._time_s = max(now.time_s - self._time_s, 0.0), now.time_s
        self._slow_s = self._slow_s + step if now.trip_s > self.MOST_S else 0.0
        return f"packets take {1000.0 * now.trip_s:.0f} ms" if self._slow_s > self.FOR_S else ""


class ConsoleAlarm:
    """The vehicle reports a failure on its console."""

    name = "console"

    def check(self, now: Situation) -> str:
        return f"the vehicle reports {now.alarm!r}" if now.alarm else ""


class Tilt:
    name = "tilt"

    def __init__(self, most_deg: float) -> None:
        self.most_deg = most_deg

    def check(self, now: Situation) -> str:
        tilt = float(np.degrees(now.tilt_rad))
        return f"{tilt:.0f} deg, the limit is {self.most_deg:.0f}" if not tilt <= self.most_deg else ""


class Speed:
    name = "speed"

    def __init__(self, most_m_s: float) -> None:
        self.most_m_s = most_m_s

    def check(self, now: Situation) -> str:
        speed = float(np.linalg.norm(now.velocity_m_s))
        return f"{speed:.1f} m/s, the limit is {self.most_m_s:.1f}" if not speed <= self.most_m_s else ""


class LowBattery:
    """The mean of the last second is low, or will be before the vehicle has landed, as it falls now. Single dips under
    load do not count, and the first second is not judged. The load of take-off is not part of the trend."""

    name = "low battery"
    MEAN_S, TREND_S, LOADED_S = 1.0, 10.0, 4.0

    def __init__(self, least_V: float) -> None:
        self.least_V = least_V
        self._mean_V: float | None = None
        self._time_s = self._known_s = 0.0
        self._means: deque[tuple[float, float]] = deque()

    def _lost_V(self, home_s: float) -> float:
        """What the way home takes, by the trend of the last TREND_S; 0 before so much is known."""
        means = self._means
        while means and means[-1][0] - means[0][0] > self.TREND_S + 1e-6:
            means.popleft()
        if not means or means[-1][0] - means[0][0] < self.TREND_S - self.MEAN_S:
            return 0.0
        return max(means[0][1] - means[-1][1], 0.0) / (means[-1][0] - means[0][0]) * home_s

    def check(self, now: Situation) -> str:
        step, self._time_s = max(now.time_s - self._time_s, 0.0), now.time_s
        old = now.battery_V if self._mean_V is None else self._mean_V
        self._known_s += 0.0 if self._mean_V is None else step
        self._mean_V = old + min(step / self.MEAN_S, 1.0) * (now.battery_V - old)
        if self._known_s < self.MEAN_S and np.isfinite(now.battery_V):
            return ""
        if not self._mean_V >= self.least_V:
            return f"{self._mean_V:.2f} V, the limit is {self.least_V:.2f}"
        if now.time_s > self.LOADED_S:
            self._means.append((now.time_s, self._mean_V))
        lost = self._lost_V(now.home_s)
        if self._mean_V - lost >= self.least_V:
            return ""
        return (f"{self._mean_V:.2f} V, and the way home of {now.home_s:.0f} s takes {lost:.2f} V; the limit is "
                f"{self.least_V:.2f}")


class Sinks:
    """The vehicle cannot hold the commanded height: an empty battery, or too much weight. Such a flight would hit the
    ground and tip over. Take-off may leave it ``MOST_M`` below for a moment."""

    name = "sinks"
    MOST_M, FOR_S = 0.3, 1.5

    def __init__(self) -> None:
        self._time_s = self._below_s = 0.0

    def check(self, now: Situation) -> str:
        step, self._time_s = max(now.time_s - self._time_s, 0.0), now.time_s
        self._below_s = self._below_s + step if now.below_m > self.MOST_M else 0.0
        if self._below_s < self.FOR_S:
            return ""
        return (f"{now.below_m:.2f} m below the commanded height for {self._below_s:.1f} s; "
                f"battery {now.battery_V:.2f} V")


class Falls:
    """A controller that lets the vehicle fall: from 1 m the vehicle's loops catch it only if they begin at once."""

    name = "falls"
    MOST_M, MOST_M_S = 0.1, 1.2

    def check(self, now: Situation) -> str:
        if not (now.below_m > self.MOST_M and now.sinks_m_s > self.MOST_M_S):
            return ""
        return f"{now.below_m:.2f} m below the commanded height, sinking {now.sinks_m_s:.1f} m/s faster than commanded"


class ControllerFailed:
    """It raised, or what it said is no number."""

    name = "controller"

    def check(self, now: Situation) -> str:
        return now.controller_error


class Overrun:
    """One call took far too long, or deadlines are missed one after the other."""

    name = "overrun"

    def __init__(self, most_s: float, most_ticks: int) -> None:
        self.most_s, self.most_ticks = most_s, most_ticks

    def check(self, now: Situation) -> str:
        if now.call_s > self.most_s:
            return f"the controller took {1000.0 * now.call_s:.0f} ms"
        return f"{now.late_ticks} deadlines missed in a row" if now.late_ticks >= self.most_ticks else ""


class Unheard:
    """Packets come, but battery and supervisor are not among them: the rules that need them would see nothing. Ten
    packets a second are sent; of a link that loses six of ten, twenty in a row go once in 30 000."""

    name = "silent log"
    MOST_S = 2.0

    def check(self, now: Situation) -> str:
        if not now.health_age_s > self.MOST_S:
            return ""
        return f"battery and supervisor were not heard of for {now.health_age_s:.1f} s"


class Astray:
    """The vehicle believes to be somewhere else: poses do not reach its filter. Its own loops hold and land where it
    believes to be, so that sooner is better."""

    name = "astray"
    MOST_M, OLD_S, FOR_S = 0.2, 0.1, 0.5

    def __init__(self) -> None:
        self._time_s = self._lasted_s = 0.0

    def check(self, now: Situation) -> str:
        step, self._time_s = max(now.time_s - self._time_s, 0.0), now.time_s
        most_m = self.MOST_M + self.OLD_S * float(np.linalg.norm(now.velocity_m_s))  # the log is of a moment ago
        self._lasted_s = self._lasted_s + step if now.astray_m > most_m else 0.0
        return f"the vehicle believes to be {now.astray_m:.2f} m from the poses" if self._lasted_s > self.FOR_S else ""


class EstimateLost:
    """Poses are missing, and the vehicle's estimate contradicts its own IMU: its loops would fly after it."""

    name = "estimate"

    def check(self, now: Situation) -> str:
        return now.estimate_fault


class VehicleStopped:
    """Its own supervisor has ended the flight."""

    name = "supervisor"

    def check(self, now: Situation) -> str:
        found = [word for bit, word in ((TUMBLED, "tumbled"), (LOCKED, "locked"), (CRASHED, "crashed"))
                 if now.supervisor & bit]
        return f"the vehicle says it is {' and '.join(found)}" if found else ""


def rules(limits: Limits) -> tuple[Rule, ...]:
    """All of them; the first that has a reason ends the flight."""
    return (Interrupted(), LostLink(limits.silent_s), VehicleStopped(), PosesDisagree(), EstimateLost(),
            StalePose(limits.stale_s), ConsoleAlarm(), ControllerFailed(), Overrun(limits.overrun_s, limits.late_ticks),
            HardFence(*limits.fence), Geofence(*limits.fence),
            Tilt(limits.tilt_deg), Speed(limits.speed_m_s), LowBattery(limits.battery_V), Sinks(), Falls(), Unheard(),
            SlowLink(), Astray())


@dataclass(frozen=True)
class Stop:
    """Why a flight ended early: ``rule`` by name, ``reason`` in words, at time_s of the flight in ``phase``."""

    rule: str
    reason: str
    time_s: float
    phase: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.reason} ({self.time_s:.2f} s, {self.phase})"


def first_stop(checks: Sequence[Rule], now: Situation, phase: str) -> Stop | None:
    """The first rule's reason. Every rule is evaluated, since some have memory."""
    reasons = [(rule.name, rule.check(now)) for rule in checks]
    return next((Stop(name, reason, now.time_s, phase) for name, reason in reasons if reason), None)
