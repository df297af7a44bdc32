"""The end of a flight: the plan's landing, the hand-over after a violated rule, and motors off."""

from collections.abc import Callable

import numpy as np

from ..host_clock import Clock
from ..vehicle_link import FLYING, Link
from . import safety, setpoint_packets
from .attitude_descent import descend, settle
from .company import ALONE, Company
from .dead_reckoning import FRESH_S
from .flight_plan import LANDING, TAKEOFF
from .flight_state import FlightState
from .outcome import Listener
from .pilot import PERIOD_S
from .pose_gate import PoseGate
from .pose_tracker import FIT_S, PoseTrack
from .prepare import Ready
from .safety import Limits, Stop, first_stop
from .safety_handover import command_landing, hand_over, land, place_to_hold

GROUND, LANDED = "ground", "landed"
GROUND_M = 0.03
STILL_S = 4.0
"""Maximum wait for motors that do not turn."""
HEALS_S = 0.3
"""A filter that had false poses and gets those of dead reckoning counts again after so long."""
TOUCHED_M = 0.15
"""Below this height above the ground the IMU shows the touchdown, and the estimate is not compared."""
STOP_S, STOP_AGAIN_S = 5.0, 0.02
"""An emergency stop is repeated until the vehicle reports that it is locked, so long at most."""
LOW_M, OFF_TIMES = 0.3, 25
"""Poses that fail below this height at take-off: the motors stop, since a drop from there does no harm. The command
is repeated so often, since a link may lose some."""
AT_REST_TIMES = 3
"""The vehicle is disarmed so often after it has come to rest."""
RELEASES = 50
"""Number of times that the end of set-points is sent after landing, since a link may lose some."""


class EstimateLostError(Exception):
    """Poses are missing, and the vehicle's estimate is not trusted: the planner is no help."""


class NearGroundError(Exception):
    """A vehicle that flies by dead reckoning is near the ground: the touchdown would spoil that."""


class FlightEnding(FlightState):
    """``feed`` switches off that poses are sent to the vehicle."""

    def __init__(self, link: Link, track: PoseTrack, ready: Ready, limits: Limits, clock: Clock,
                 listeners: tuple[Listener, ...], gate: PoseGate | None, feed: Callable[[bool], None],
                 company: Company = ALONE) -> None:
        super().__init__(link, track, ready, limits, clock, listeners, gate, company)
        self._hard = safety.HardFence(*limits.fence)
        self._feed = feed
        self._watches_estimate, self._healed_s = False, -np.inf

    def _land(self) -> Stop | None:
        """The plan's own landing. A link that was lost meanwhile or a vehicle that says it crashed is no good end."""
        self._down(lambda: land(self.link, self.clock, self.ground_m, self._height(), self._seen, self._idle))
        self._rest()
        self._look(self._now.time_s)
        watched = [rule for rule in self.rules if isinstance(rule, safety.LostLink | safety.VehicleStopped)]
        stop = first_stop(watched, self._now, LANDING)
        if stop is not None:
            self._stopping(stop)
        return stop

    def _end(self, stop: Stop) -> Stop:
        """Holds, lands, and says why."""
        self._stopping(stop)
        now = self._now
        if stop.rule == safety.PosesDisagree.name and self._phase == TAKEOFF and \
                now.position_m[2] < self.ground_m + LOW_M:
            return self._drop(stop)
        self._enter("hand-over", self.clock.now())
        if stop.rule == safety.PosesDisagree.name:
            self._disbelieve()
        place_m, ahead_m_s = now.position_m, now.velocity_m_s
        if self._unbelieved:
            place_m, ahead_m_s = self._reckoning.shown().position_m, np.zeros(3)  # brakes as hard as it can
        place = place_to_hold(place_m, ahead_m_s, self.limits.fence, self.ground_m)
        yaw = 0.0 if self._believed is None else self._believed.yaw_rad
        brief = now.pose_age_s > self.limits.stale_s or stop.rule in (safety.Sinks.name, safety.PosesDisagree.name,
                                                                                  safety.ConsoleAlarm.name)
        own = self._own if stop.rule == safety.Astray.name else None
        self._down(lambda: hand_over(self.link, self.clock, place, yaw, self.ground_m, brief=brief, seen=self._seen,
                                     tick=self._idle, own=own))
        self._rest()
        return stop

    def _disbelieve(self) -> None:
        """The poses are false: the vehicle goes on by its IMU. If its filter had them while they were found out, it
        gets the motion by dead reckoning instead of them."""
        self._feed(False)
        self._unbelieved = True
        if not self._gate.why:
            self._reckoning.rewind(self._physics.false_s + FIT_S)
            self._healed_s = self.clock.now() + HEALS_S
        self._reckon(self.clock.now(), None)

    def _watch_poses(self) -> None:
        """Poses may also turn false during the landing."""
        high = self._reckoning.position_m[2] > self.ground_m + TOUCHED_M
        if self._unbelieved or not high or self._phase in (GROUND, LANDED):
            return
        why = self._now.pose_fault = self._pose_fault(self.clock.now(), self.track.at(self.clock.now()))
        if why:
            self._note(f"poses: {why}")
            self._disbelieve()

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
            return
        except NearGroundError:
            self._watches_estimate, self._healed_s = False, -np.inf
        if self._seen() is None and np.isfinite(self._reckoning.hover_counts):
            settle(self.link, self.clock, self._reckoning, self._idle)

    def _check_estimate(self, fault: str) -> None:
        high = self._reckoning.position_m[2] > self.ground_m + TOUCHED_M
        if self.clock.now() < self._healed_s:
            return
        if fault and high and self._watches_estimate and np.isfinite(self._reckoning.hover_counts):
            raise EstimateLostError(fault)

    def _by_setpoints(self, why: str) -> None:
        if why:
            self._note(f"{why}: taken down by set-points")

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
        self._stopping(stop)
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

    def _idle(self) -> None:
        self._alive()
        self._request_echo()
        self._report(self._now.time_s, None)
        self._cut_outside()
        self._watch_poses()
        fault = self._reckon(self.clock.now(), self.track.at(self.clock.now()))
        if self._watches_estimate and np.isfinite(self._healed_s):
            self._heal()
        self._check_estimate(fault)

    def _heal(self) -> None:
        """The vehicle's filter gets the pose by dead reckoning, while its IMU is heard. A touchdown looks like
        a motion, against which the vehicle would take off."""
        if self._reckoning.position_m[2] < self.ground_m + TOUCHED_M:
            raise NearGroundError
        if self._reckoning.imu_s < FRESH_S and np.isfinite(self._reckoning.time_s):
            shown = self._reckoning.shown()
            self.link.send_pose(shown.position_m, shown.quaternion)

    def _cut_outside(self) -> None:
        """A vehicle that gets beyond the hard fence while it should land: its motors stop."""
        believed = self._seen()
        if believed is None or self._taken() or self._phase in (GROUND, LANDED):
            return
        self._now.position_m = believed.position_m
        if why := self._hard.beyond(self._now):
            self.interrupts.emergency = why
            raise KeyboardInterrupt

    def _leave(self) -> Stop:
        """After a second request: command one landing by the vehicle's planner, and do not wait. If that is lost, the
        vehicle's watchdog levels it and then stops its motors."""
        stop = Stop("interrupted", f"{self.interrupts.requested} twice: left to the vehicle's own landing and watchdog",
                    self._now.time_s, self._phase)
        self._stopping(stop)
        self._outcome.left = True
        if self._phase not in (GROUND, LANDED):
            command_landing(self.link, self.ground_m, self._height())
        return stop
