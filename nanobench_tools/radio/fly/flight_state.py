"""State of a flight: poses, log and link as one situation per tick, and its phases for those who listen.

Values of the log count with their age: a flight must not go by old ones.
"""

import numpy as np

from ..host_clock import Clock
from ..vehicle_link import Link
from . import safety
from .company import ALONE, Company
from .dead_reckoning import DeadReckoning
from .flight_loop import Pacer
from .flight_plan import Plan
from .guardian import Guardian
from .interrupts import Interrupts
from .landing_profile import lasts_s
from .outcome import Listener, Outcome
from .pilot import PERIOD_S
from .pose_gate import PoseGate
from .pose_physics import PosePhysics
from .pose_tracker import Believed, PoseTrack
from .prepare import Ready
from .safety import Limits, Situation

HEALTH = ("pm.vbat", "supervisor.info")
ESTIMATE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
FRESH_S = 0.2
"""An older estimate, or pose, is not compared: the vehicle moves meanwhile."""


def health_age_s(link: Link, host_s: float) -> float:
    """Since battery or supervisor were last heard of, whichever is longer; inf if never."""
    return host_s - min(link.logged_s.get(name, -np.inf) for name in HEALTH)


def astray(link: Link, believed: Believed | None, host_s: float) -> np.ndarray:
    """From where the poses are to where the vehicle believes to be (3,) m; nan if either is not fresh."""
    if believed is None or host_s - believed.pose_s > FRESH_S:
        return np.full(3, np.nan)
    if not all(host_s - link.logged_s.get(name, -np.inf) < FRESH_S for name in ESTIMATE):
        return np.full(3, np.nan)
    return np.asarray(np.array([link.values[name] for name in ESTIMATE]) - believed.position_m)


ECHO_S, RECENT_TRIPS = 0.1, 3
TIMELY_S, LATE_S = 0.25, 0.1
"""A log is of now only while echoes that were requested this long ago have come, and it is not later than this."""
PLAIN = 1.3
"""Deviation of the vehicle's estimate that ends a flight whose poses are missing, in units of the tolerance."""
MISSING_S = 0.1
"""Poses are missing after so long."""


class FlightState:
    """State of one flight of a prepared vehicle."""

    def __init__(self, link: Link, track: PoseTrack, ready: Ready, limits: Limits, clock: Clock,
                 listeners: tuple[Listener, ...], gate: PoseGate | None, company: Company = ALONE) -> None:
        self.link, self.track, self.limits, self.clock = link, track, limits, clock
        self.plan: Plan = ready.plan
        self.ground_m = float(ready.pose.position_m[2])
        self.company = company
        self.rules = (*safety.rules(limits), *company.rules)
        self.interrupts = Interrupts()
        self._gate = gate or PoseGate()
        self._gate.ground_m = self.ground_m
        self._physics = PosePhysics()
        self._reckoning = DeadReckoning(ground_m=self.ground_m, delay_s=ready.delay_s)
        self._listeners = listeners
        self._outcome = Outcome()
        self._now = Situation()
        self._believed: Believed | None = None
        self._phase, self._echo_s = "", 0.0
        self.pacer = Pacer(clock, PERIOD_S)
        self._guardian: Guardian | None = None
        self._unbelieved = False

    def _look(self, time_s: float) -> None:
        """The situation now."""
        host, link, now = self.clock.now(), self.link, self._now
        believed = self.track.at(host)
        self._believed = believed
        now.time_s = time_s
        now.pose_age_s = np.inf if believed is None else host - believed.pose_s
        if believed is not None:
            now.position_m, now.velocity_m_s = believed.position_m, believed.velocity_m_s
            now.tilt_rad = believed.tilt_rad
        now.battery_V = float(link.values.get("pm.vbat", np.nan))
        now.supervisor = int(link.values.get("supervisor.info", 0))
        now.silent_s, now.lost = host - link.heard_s, link.lost
        now.health_age_s = health_age_s(link, host)
        now.estimate_fault = self._lost_estimate(self._reckon(host, believed))
        now.astray_m = float(np.linalg.norm(astray(link, believed, host)))
        now.pose_fault = self._pose_fault(host, believed)
        now.home_s = lasts_s(self.ground_m, self._height())
        trips = list(link.round_trips_s)[-RECENT_TRIPS:]
        now.trip_s = max(float(np.median(trips)) if trips else 0.0, link.log_late_s)
        now.alarm = link.alarm
        now.late_ticks = self.pacer.beat.late_in_a_row
        now.interrupted = self.interrupts.requested
        self._request_echo()

    def _pose_fault(self, host_s: float, believed: Believed | None) -> str:
        """Why the poses are not believed. Once there is a reason, it stays."""
        link = self.link
        timely = host_s - link.echoed_s < TIMELY_S and link.log_late_s < LATE_S
        return self._gate.why or self._now.pose_fault or self._physics.check(believed, link.values, link.logged_s,
                                                                             host_s, timely)

    def _reckon(self, host_s: float, believed: Believed | None) -> str:
        """Why the vehicle's estimate is not trusted, if poses are missing."""
        doubted = self._unbelieved or bool(self._gate.why)
        self._reckoning.update(host_s, None if doubted else believed, self.link.values, self.link.logged_s)
        return self._reckoning.fault if self._reckoning.blind_s > MISSING_S else ""

    def _lost_estimate(self, fault: str) -> str:
        """A reason to end a flight, for which a short gap of the poses and an old log are not enough."""
        return fault if self._reckoning.excess > PLAIN else ""

    def _request_echo(self) -> None:
        """Keeps the link's round trips coming."""
        if self.clock.now() >= self._echo_s:
            self._echo_s = self.clock.now() + ECHO_S
            self.link.request_echo()

    def _report(self, time_s: float, commanded_m: np.ndarray | None, yaw_rad: float = 0.0) -> None:
        self.company.seen(self._phase, self._believed)
        for listener in self._listeners:
            listener.tick(time_s, self._phase, self._believed, commanded_m, yaw_rad)

    def _enter(self, phase: str, host_s: float) -> None:
        self._phase = phase
        self._outcome.phases.append((phase, host_s))
        self._note(phase)

    def _stopping(self, stop: safety.Stop) -> None:
        """The flight ends early: those who listen and the others in the air know at once."""
        self._note(f"stop: {stop}")
        self.company.stopped(stop)

    def _note(self, text: str) -> None:
        for listener in self._listeners:
            listener.note(text)

    def _height(self) -> float:
        return self.ground_m if self._believed is None else float(self._believed.position_m[2])

    def _seen(self) -> Believed | None:
        """Where it is, if poses come that are believed."""
        if self._unbelieved:
            return None
        now = self.clock.now()
        believed = self.track.at(now)
        return None if believed is None or now - believed.pose_s > self.limits.stale_s else believed

    def _own(self, place_m: np.ndarray) -> np.ndarray:
        """A place in the belief of the vehicle, as far as it is known."""
        off = astray(self.link, self._seen(), self.clock.now())
        return place_m + (off if np.isfinite(off).all() else 0.0)

    def _alive(self) -> None:
        self.interrupts.raise_if_asked()
        if self._guardian is not None:
            self._guardian.alive()

    def _taken(self) -> bool:
        return self._guardian is not None and self._guardian.taken
