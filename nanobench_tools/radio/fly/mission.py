"""A flight: take-off, the streamed part at 100 Hz, landing. A violated rule ends it on the ground."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np

from ..host_clock import Clock
from ..in_time import end_at_once
from ..vehicle_link import FLYING, Link
from . import safety, setpoint_packets
from .attitude_descent import descend
from .dead_reckoning import DeadReckoning
from .flight_loop import Pacer, ahead_of_others, undisturbed
from .flight_plan import LANDING, TAKEOFF, Plan
from .guardian import Guardian
from .interrupts import Hung, Interrupts
from .landing_profile import lasts_s
from .latest_log import astray, health_age_s
from .outcome import Listener, Outcome
from .pilot import PERIOD_S, Pilot, finite
from .pose_gate import PoseGate
from .pose_physics import PosePhysics
from .pose_tracker import Believed, PoseTrack
from .prepare import Ready
from .safety import Limits, Situation, Stop, first_stop
from .safety_handover import command_landing, hand_over, land, place_to_hold

HANG_S = 0.25
"""After so long in one call the guardian takes the flight from a controller."""
LISTEN_S = 0.2
"""So long before it flies a controller is run without being heard, so that its filters know the vehicle and battery."""
GROUND, LANDED = "ground", "landed"
GROUND_M = 0.03
STILL_S, WRITTEN_S = 4.0, 0.2
"""Maximum wait for motors that do not turn; and for the recording's writer, if the program ends at once."""
ECHO_S, RECENT_TRIPS = 0.1, 3
TIMELY_S = 0.25
"""A log is of now only while echoes that were requested this long ago have come."""
FALSE_S = 3.0
"""Poses that contradict the IMU may have been false for so long before it is found."""
PLAIN = 1.3
"""Deviation of the vehicle's estimate that ends a flight whose poses are missing, in units of the tolerance."""
TOUCHED_M = 0.15
"""Below this height above the ground the IMU shows the touchdown, and the estimate is not compared."""
MISSING_S = 0.1
"""Poses are missing after so long."""
STOP_S, STOP_AGAIN_S = 5.0, 0.02
"""An emergency stop is repeated until the vehicle reports that it is locked, so long at most."""
LOW_M, OFF_TIMES = 0.3, 25
"""Poses that fail below this height at take-off: the motors stop, since a drop from there does no harm. The command
is repeated so often, since a link may lose some."""
AT_REST_TIMES = 3
"""The vehicle is disarmed so often after it has come to rest."""
RELEASES = 50
"""Number of times that the end of set-points is sent after landing, since a link may lose some."""
LIFT_S, LIFT_AGAIN_S = 6.0, (0.8, 2.4)
"""Maximum time on the ground after the command to take off. The command is repeated before: soon, since it may have
been lost, then late, since the integrators of a heavy vehicle need time."""


class EstimateLostError(Exception):
    """Poses are missing, and the vehicle's estimate is not trusted: the planner is no help."""


class Flight:
    """One flight of a prepared vehicle. ``setpoint``: told of every packet that is sent, with its host time. ``gate``
    of the poses; ``feed`` switches off that they are sent to the vehicle."""

    def __init__(self, link: Link, track: PoseTrack, pilot: Pilot, ready: Ready, limits: Limits, clock: Clock,
                 listeners: tuple[Listener, ...] = (), setpoint: Callable[[float, bytes], None] | None = None,
                 ground_s: float = 0.0, gate: PoseGate | None = None,
                 feed: Callable[[bool], None] = lambda on: None) -> None:
        self.link, self.track, self.pilot, self.limits, self.clock = link, track, pilot, limits, clock
        self.plan: Plan = ready.plan
        self.ground_m = float(ready.pose.position_m[2])
        self.rules = safety.rules(limits)
        self._hard = safety.HardFence(*limits.fence)
        self.interrupts = Interrupts()
        self.ground_s = ground_s
        self._gate, self._feed = gate or PoseGate(), feed
        self._gate.ground_m = self.ground_m
        self._physics = PosePhysics()
        self._reckoning = DeadReckoning(ground_m=self.ground_m, delay_s=ready.delay_s)
        self._watches_estimate = False
        self._listeners, self._setpoint = listeners, setpoint
        self._outcome = Outcome()
        self._now = Situation()
        self._believed: Believed | None = None
        self._phase, self._echo_s = "", 0.0
        self.pacer = Pacer(clock, PERIOD_S)
        self._guardian: Guardian | None = None
        self._hung: Stop | None = None
        self._unbelieved = False

    def run(self) -> Outcome:
        """Fly the plan, or as much of it as the rules allow. On return the vehicle is on the ground, or was given up.
        Bugs of this program are raised after the landing."""
        with ExitStack() as stack:
            if self.clock.real:
                self._guardian = Guardian(HANG_S, self._take_over, self._give_up)
                stack.enter_context(self._guardian.watching())
                stack.enter_context(ahead_of_others())  # a thread that begins later is not among them
            stack.enter_context(undisturbed())  # collects garbage, for which poses have to wait
            try:
                with self.interrupts.caught():
                    stop = self._flown()
            except Hung:
                stop = self._hung
            except KeyboardInterrupt:
                stop = self._emergency() if self.interrupts.emergency else self._leave()
        self._outcome.stop, self._outcome.beat = stop, self.pacer.beat
        return self._outcome

    def _flown(self) -> Stop | None:
        try:
            stop = self._fly()
        except Exception as error:
            if not self._taken():
                self._end(Stop("error", f"{type(error).__name__}: {error}", self._now.time_s, self._phase))
            raise
        return self._wait_for_guardian() if self._taken() else stop

    # -- the loop

    def _fly(self) -> Stop | None:
        if (stop := self._wait()) is not None:
            return stop
        self.pacer = Pacer(self.clock, PERIOD_S)
        start = self.clock.now()
        self._enter(TAKEOFF, start)
        commanded_at = [start]
        self.link.release()  # the zero set-point with which the last client closed still overrides the planner
        self.link.take_off(self.plan.height_m, 2.0)
        while True:
            due = self.pacer.wait()
            self._alive()
            if self._taken():
                return None
            time_s = due - commanded_at[-1]
            self._look(time_s)
            stop = first_stop(self.rules, self._now, self._phase) or self._does_not_lift(due, commanded_at)
            if stop is None:
                phase = self.plan.phase(time_s)
                if phase != self._phase:
                    self._enter(phase, due)
                if phase == LANDING:
                    return self._land()
                if phase != TAKEOFF:
                    stop = self._stream(time_s)
                elif time_s > self.plan.ends[TAKEOFF] - LISTEN_S:
                    stop = self._stream(time_s, send=False)
                else:
                    self._report(time_s, None)
            if stop is not None:
                return self._end(stop)
            self.pacer.done()

    def _wait(self) -> Stop | None:
        """On the ground for ``ground_s``, so that a recording shows the rest; a reason then ends it there."""
        start = self.clock.now()
        self._enter(GROUND, start)
        while (time_s := self.clock.now() - start) < self.ground_s:
            self._look(time_s - self.ground_s)
            if (stop := first_stop(self.rules, self._now, GROUND)) is not None:
                self._note(f"stop: {stop}")
                self._rest()
                return stop
            self._idle()
            self.clock.sleep_until(self.clock.now() + PERIOD_S)
        return None

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
        now.pose_fault = self._gate.why or now.pose_fault or self._physics.check(
            believed, link.values, link.logged_s, host, timely=host - link.echoed_s < TIMELY_S)
        now.home_s = lasts_s(self.ground_m, self._height())
        trips = list(link.round_trips_s)[-RECENT_TRIPS:]
        now.trip_s = float(np.median(trips)) if trips else 0.0
        now.alarm = link.alarm
        now.late_ticks = self.pacer.beat.late_in_a_row
        now.interrupted = self.interrupts.requested
        self._request_echo()

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

    def _stream(self, time_s: float, send: bool = True) -> Stop | None:
        """One set-point, not sent while the controller only listens. An error in it ends the flight at once."""
        commanded = self.plan.reference(time_s)
        begun = self.clock.now()
        error, packet = "", b""
        if self._guardian is not None:
            self._guardian.begin(self.pilot.name)
        try:
            if self._believed is None:
                raise ValueError("no pose")
            packet = self.pilot.packet(time_s, self._believed.state(self._now.battery_V), commanded)
            if not finite(packet):
                error = f"{self.pilot.name} commanded what is no number: {setpoint_packets.in_words(packet)}"
        except Exception as raised:  # anybody's code: it must not take the vehicle down
            error = f"{self.pilot.name} raised {type(raised).__name__}: {raised}"
        ours = self._guardian is None or self._guardian.end()
        self._now.call_s = self.clock.now() - begun
        self._now.controller_error = error
        if not ours:
            return None
        if error:
            return first_stop(self.rules, self._now, self._phase)
        if not send:
            self._report(time_s, None)
            return None
        self._now.below_m = float(commanded.position_m[0, 2]) - self._height()
        self.link.send_setpoint(packet)
        self.pacer.sent(self._now.call_s)
        self._pass_on(packet)
        self._report(time_s, commanded.position_m[0], float(commanded.yaw_rad[0]))
        return None

    def _pass_on(self, packet: bytes) -> None:
        """To who wants to know what was sent: anybody's code, which is not asked again once it raises."""
        if self._setpoint is None:
            return
        if self._guardian is not None:
            self._guardian.begin("the listener to set-points")
        try:
            self._setpoint(self.clock.now(), packet)
        except Exception as raised:
            self._setpoint = None
            self._note(f"the listener to set-points raised {type(raised).__name__}: {raised}; it is not called again")
        if self._guardian is not None:
            self._guardian.end()

    def _report(self, time_s: float, commanded_m: np.ndarray | None, yaw_rad: float = 0.0) -> None:
        for listener in self._listeners:
            listener.tick(time_s, self._phase, self._believed, commanded_m, yaw_rad)

    def _enter(self, phase: str, host_s: float) -> None:
        self._phase = phase
        self._outcome.phases.append((phase, host_s))
        self._note(phase)

    def _note(self, text: str) -> None:
        for listener in self._listeners:
            listener.note(text)

    def _does_not_lift(self, now_s: float, commanded_s: list[float]) -> Stop | None:
        """Repeat the take-off command to a vehicle on the ground, after which the plan begins anew; give up after
        LIFT_S. ``commanded_s``: time of the command."""
        if self._phase != TAKEOFF or self._height() > self.ground_m + GROUND_M:
            return None
        if why := self._physics.climb(now_s):
            self._now.pose_fault = why
            return Stop(safety.PosesDisagree.name, why, now_s - commanded_s[0], TAKEOFF)
        if now_s - commanded_s[0] > LIFT_S:
            reason = f"the vehicle does not leave the ground: too heavy? battery {self._now.battery_V:.2f} V"
            return Stop("take-off", reason, now_s - commanded_s[0], TAKEOFF)
        if now_s - commanded_s[-1] > LIFT_AGAIN_S[min(len(commanded_s), len(LIFT_AGAIN_S)) - 1]:
            commanded_s.append(now_s)
            self.link.release()
            self.link.take_off(self.plan.height_m, 2.0)
        return None

    def _height(self) -> float:
        return self.ground_m if self._believed is None else float(self._believed.position_m[2])

    # -- the end

    def _land(self) -> Stop | None:
        """The plan's own landing. A link that was lost meanwhile or a vehicle that says it crashed is no good end."""
        self._down(lambda: land(self.link, self.clock, self.ground_m, self._height(), self._seen, self._idle))
        self._rest()
        self._look(self._now.time_s)
        watched = [rule for rule in self.rules if isinstance(rule, safety.LostLink | safety.VehicleStopped)]
        stop = first_stop(watched, self._now, LANDING)
        if stop is not None:
            self._note(f"stop: {stop}")
        return stop

    def _end(self, stop: Stop) -> Stop:
        """Holds, lands, and says why."""
        self._note(f"stop: {stop}")
        now = self._now
        if stop.rule == safety.PosesDisagree.name and self._phase == TAKEOFF and \
                now.position_m[2] < self.ground_m + LOW_M:
            return self._drop(stop)
        self._enter("hand-over", self.clock.now())
        if stop.rule == safety.PosesDisagree.name:
            self._feed(False)  # the vehicle goes on by its IMU
            self._unbelieved = True
            if not self._gate.why:  # it took time to find out, and the vehicle's filter had them
                self._reckoning.rewind(FALSE_S)
                self._reckon(self.clock.now(), None)
        place = place_to_hold(now.position_m, now.velocity_m_s, self.limits.fence, self.ground_m)
        yaw = 0.0 if self._believed is None else self._believed.yaw_rad
        brief = now.pose_age_s > self.limits.stale_s or stop.rule in (safety.Sinks.name, safety.PosesDisagree.name,
                                                                                  safety.ConsoleAlarm.name)
        own = self._own if stop.rule == safety.Astray.name else None
        self._down(lambda: hand_over(self.link, self.clock, place, yaw, self.ground_m, brief=brief, seen=self._seen,
                                     tick=self._idle, own=own))
        self._rest()
        return stop

    def _down(self, way: Callable[[], str]) -> None:
        """To the ground by ``way``. If the vehicle turns out not to know where it is, by attitude and thrust."""
        self._watches_estimate = True
        try:
            self._check_estimate(self._reckoning.fault if self._seen() is None else "")
            self._by_setpoints(way())
            self._watches_estimate = False
        except EstimateLostError as lost:
            self._watches_estimate = False
            self._note(f"{lost}: taken down by attitude and thrust")
            descend(self.link, self.clock, self._reckoning, self.ground_m, self._seen, self._idle)
            self._unbelieved = True  # motors off, even if poses come again

    def _check_estimate(self, fault: str) -> None:
        high = self._reckoning.position_m[2] > self.ground_m + TOUCHED_M
        if fault and high and self._watches_estimate and np.isfinite(self._reckoning.hover_counts):
            raise EstimateLostError(fault)

    def _drop(self, stop: Stop) -> Stop:
        """Motors off just above the ground: where poses lie, set-points and planner would fly after them."""
        self._feed(False)
        self._unbelieved = True
        for _ in range(OFF_TIMES):
            self.link.send_setpoint(setpoint_packets.stop())
            self.link.stop_planner()
            self.link.arm(False)
            self._idle()
            self.clock.sleep_until(self.clock.now() + STOP_AGAIN_S)
        self._note("motors off just above the ground")
        self._rest()
        return stop

    def _emergency(self) -> Stop:
        """Motors off at once, wherever the vehicle is; repeated until it reports so."""
        stop = Stop("emergency stop", self.interrupts.emergency, self._now.time_s, self._phase)
        self._note(f"stop: {stop}")
        until, locked = self.clock.now() + STOP_S, False
        while not locked and self.clock.now() < until:
            try:
                self.link.emergency_stop()
                self.link.request_echo()
            except Exception as error:  # a driver that is gone: the vehicle's watchdog is left
                self._note(f"the emergency stop could not be sent: {error}")
                break
            self._alive()
            self.clock.sleep_until(self.clock.now() + STOP_AGAIN_S)
            locked = bool(int(self.link.values.get("supervisor.info", 0)) & safety.LOCKED)
        said = "the vehicle reports that it is locked" if locked else "the vehicle did not acknowledge it"
        self._note(f"emergency stop: {said}")
        self._outcome.left = True
        return Stop(stop.rule, f"{stop.reason}; {said}", stop.time_s, stop.phase)

    def _own(self, place_m: np.ndarray) -> np.ndarray:
        """A place in the belief of the vehicle, as far as it is known."""
        off = astray(self.link, self._seen(), self.clock.now())
        return place_m + (off if np.isfinite(off).all() else 0.0)

    def _by_setpoints(self, why: str) -> None:
        if why:
            self._note(f"{why}: taken down by set-points")

    def _rest(self) -> None:
        """Motors off, if the vehicle is where they may be."""
        newest, again = self.track.newest, 0
        if self._unbelieved or newest is None or newest.position_m[2] < self.ground_m + 4.0 * GROUND_M:
            self.link.send_setpoint(setpoint_packets.stop())
            self.link.release()  # else the vehicle's watchdog would miss further set-points and lock it
            again = RELEASES
        self._enter(LANDED, self.clock.now())
        until = self.clock.now() + STILL_S
        while int(self.link.values.get("supervisor.info", 0)) & FLYING and self.clock.now() < until:
            if again:
                again -= 1
                self.link.release()
            self._idle()
            self.clock.sleep_until(self.clock.now() + PERIOD_S)
        if again or not int(self.link.values.get("supervisor.info", 0)) & FLYING:
            for _ in range(AT_REST_TIMES):
                self.link.arm(False)

    def _seen(self) -> Believed | None:
        """Where it is, if poses come that are believed."""
        if self._unbelieved:
            return None
        now = self.clock.now()
        believed = self.track.at(now)
        return None if believed is None or now - believed.pose_s > self.limits.stale_s else believed

    def _idle(self) -> None:
        self._alive()
        self._request_echo()
        self._report(self._now.time_s, None)
        self._cut_outside()
        fault = self._reckon(self.clock.now(), self.track.at(self.clock.now()))
        self._check_estimate(fault)

    def _cut_outside(self) -> None:
        """A vehicle that gets beyond the hard fence while it should land: its motors stop."""
        believed = self._seen()
        if believed is None or self._taken() or self._phase in (GROUND, LANDED):
            return
        self._now.position_m = believed.position_m
        if why := self._hard.beyond(self._now):
            self.interrupts.emergency = why
            raise KeyboardInterrupt

    def _alive(self) -> None:
        if self._guardian is not None:
            self._guardian.alive()

    def _taken(self) -> bool:
        return self._guardian is not None and self._guardian.taken

    def _leave(self) -> Stop:
        """After a second request: command one landing by the vehicle's planner, and do not wait. If that is lost, the
        vehicle's watchdog levels it and then stops its motors."""
        stop = Stop("interrupted", f"{self.interrupts.requested} twice: left to the vehicle's own landing and watchdog",
                    self._now.time_s, self._phase)
        self._note(f"stop: {stop}")
        self._outcome.left = True
        if self._phase not in (GROUND, LANDED):
            command_landing(self.link, self.ground_m, self._height())
        return stop

    def _take_over(self, why: str) -> None:
        """The guardian's part, in its thread: hand over, then wake the loop."""
        stop = Stop("overrun", why, self._now.time_s, self._phase)
        try:
            self._end(stop)
        except Exception as error:  # nobody else is there to end the flight
            self._note(f"the hand-over raised {type(error).__name__}: {error}")
        self._hung = stop
        self.interrupts.wake()

    def _give_up(self, why: str) -> None:
        """The call does not come back, not even when it is woken: the program ends, with its recording written."""
        why += " and cannot be stopped: the program ends"
        self._note(why)
        time.sleep(WRITTEN_S)
        end_at_once(why)

    def _wait_for_guardian(self) -> Stop | None:
        """The loop goes on while the guardian lands, and is woken then."""
        while self._hung is None:
            self.clock.sleep_until(self.clock.now() + 0.05)
        self.clock.sleep_until(self.clock.now() + 0.05)
        return self._hung
