"""A flight: take-off, the streamed part at 100 Hz, landing. A violated rule ends it on the ground."""

import time
from collections.abc import Callable
from contextlib import ExitStack

from ..host_clock import Clock
from ..in_time import end_at_once
from ..vehicle_link import Link
from . import safety, setpoint_packets
from .company import ALONE, Company
from .flight_ending import GROUND, GROUND_M, FlightEnding
from .flight_loop import Pacer, ahead_of_others, undisturbed
from .flight_plan import LANDING, TAKEOFF
from .guardian import Guardian
from .interrupts import Hung
from .outcome import Listener, Outcome
from .pilot import PERIOD_S, Pilot, finite
from .pose_gate import PoseGate
from .pose_tracker import PoseTrack
from .prepare import Ready
from .safety import Limits, Stop, first_stop

HANG_S = 0.25
"""After so long in one call the guardian takes the flight from a controller."""
LISTEN_S = 0.2
"""So long before it flies a controller is run without being heard, so that its filters know the vehicle and battery."""
WRITTEN_S = 0.2
"""Maximum wait for the recording's writer, if the program ends at once."""
LIFT_S, LIFT_AGAIN_S = 6.0, (0.8, 2.4)
"""Maximum time on the ground after the command to take off. The command is repeated before: soon, since it may have
been lost, then late, since the integrators of a heavy vehicle need time."""


class Flight(FlightEnding):
    """One flight of a prepared vehicle. ``setpoint``: told of every packet that is sent, with its host time. ``gate``
    of the poses; ``feed`` switches off that they are sent to the vehicle; ``company``: others in the air."""

    def __init__(self, link: Link, track: PoseTrack, pilot: Pilot, ready: Ready, limits: Limits, clock: Clock,
                 listeners: tuple[Listener, ...] = (), setpoint: Callable[[float, bytes], None] | None = None,
                 ground_s: float = 0.0, gate: PoseGate | None = None,
                 feed: Callable[[bool], None] = lambda on: None, company: Company = ALONE) -> None:
        super().__init__(link, track, ready, limits, clock, listeners, gate, feed, company)
        self.pilot, self.ground_s, self._setpoint = pilot, ground_s, setpoint
        self._hung: Stop | None = None

    def run(self) -> Outcome:
        """Fly the plan, or as much of it as the rules allow. On return the vehicle is on the ground, or was given up.
        Bugs of this program are raised after the landing."""
        with ExitStack() as stack:
            if self.clock.real:
                self._guardian = Guardian(HANG_S, self._take_over, self._give_up)
                stack.enter_context(self._guardian.watching())
                stack.enter_context(ahead_of_others())  # a thread that begins later is not among them
            stack.enter_context(undisturbed(self.company.single))  # collects garbage, for which poses have to wait
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
                self._stopping(stop)
                self._rest()
                return stop
            self._idle()
            self.clock.sleep_until(self.clock.now() + PERIOD_S)
        return None

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
        self._now.sinks_m_s = float(commanded.velocity_m_s[0, 2] - self._now.velocity_m_s[2])
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

    def _take_over(self, why: str) -> None:
        """The guardian's part, in its thread: hand over, then wake the loop."""
        stop = Stop("overrun", why, self._now.time_s, self._phase)
        try:
            self._end(stop)
        except KeyboardInterrupt:  # of a flight in a thread
            self._emergency()
        except Exception as error:  # nobody else is there to end the flight
            self._note(f"the hand-over raised {type(error).__name__}: {error}")
        self._hung = stop
        self.interrupts.wake()

    def _give_up(self, why: str) -> None:
        """The call does not come back, not even when it is woken: the program ends, with its recording written. In
        company the flight is abandoned, since others fly in this program."""
        if self.company.abandons(Stop("overrun", why, self._now.time_s, self._phase)):
            return
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
