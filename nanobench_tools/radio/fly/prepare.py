"""From an open link to a vehicle that is ready to take off: the checklist in its order, then arming.

Nothing is armed, and no pose is fed, before everything that can be checked without has been checked.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from ... import so3
from ...errors import InputError
from ..host_clock import Clock
from ..in_time import last_resort
from ..mocap.pose_datagram import Pose
from ..vehicle_link import CflibLink
from . import checklist
from .flight_loop import ahead_of_others
from .flight_plan import Plan
from .pilot import PERIOD_S, Pilot
from .pose_tracker import PoseTrack
from .safety import CRASHED, LOCKED, TUMBLED, Limits

ECHOES, ECHOES_S, ECHO_S = 10, 3.0, 0.05
WARM_TICKS, WARM_S = 40, 600.0
"""A controller is run so often on the ground; one that hangs there is ended after WARM_S: compiling may take long."""
RESET_S = 0.4
ARM_S = 2.0


@dataclass(frozen=True)
class Ready:
    """``pose``: of the vehicle on the ground; ``delay_s``: from the host to the vehicle's loops; ``call_s``: median
    time a set-point takes to make; ``plan``: from here; ``battery_V``: at rest."""

    pose: Pose
    plan: Plan
    delay_s: float
    call_s: float
    battery_V: float = float("nan")


class Preparation:
    """``feed`` switches on that poses are sent to the vehicle; ``say`` takes one line a step; ``confirm`` is called
    before motors turn, and raises to refuse; ``check_motors``: turns them for a moment, and raises to refuse."""

    def __init__(self, link: CflibLink, track: PoseTrack, clock: Clock, limits: Limits, mocap: str,
                 feed: Callable[[bool], None], say: Callable[[str], None],
                 confirm: Callable[[Ready], None] = lambda ready: None,
                 check_motors: Callable[[CflibLink], None] | None = None) -> None:
        self.link, self.track, self.clock, self.limits, self.mocap = link, track, clock, limits, mocap
        self._feed, self._say, self._confirm = feed, say, confirm
        self._check_motors = check_motors
        self._volts: list[float] = []

    def run(self, pilot: Pilot, plan_from: Callable[[np.ndarray, float], Plan], yaw_rad: float) -> Ready:
        """Raises InputError for any failed check; the vehicle is then not armed."""
        pose = self._on_the_ground()
        self._estimate(pose, yaw_rad)
        delay_s = self._link_delay()
        plan = plan_from(pose.position_m, float(so3.euler_zyx(pose.quaternion)[2]))
        checklist.check_plan(plan, self.limits)
        call_s = self._warm(pilot, plan, delay_s)
        self.link.set_parameter("stabilizer.controller", pilot.onboard)
        ready = Ready(pose, plan, delay_s, call_s, float(np.mean(self._volts)))
        self._confirm(ready)
        if self._check_motors is not None:
            self._check_motors(self.link)
        if not checklist.standing_still(self.track, pose):
            raise InputError(f"--mocap {self.mocap}", "the vehicle was moved during the checks", "leave it; not armed")
        self._arm()
        return ready

    def _on_the_ground(self) -> Pose:
        uri, values = self.link.uri, self.link.values
        if not checklist.wait_for(self.clock, checklist.LOGS_S, lambda: set(checklist.NEEDED_LOGS) <= set(values)):
            raise InputError(uri, "log packets do not come", "is the link good enough? not armed")
        self._wait_for_supervisor()
        checklist.check_battery(uri, values["pm.vbat"])
        before, started = self.track.count, self.clock.now()
        checklist.wait_for(self.clock, checklist.POSES_S - (self.clock.now() - started),
                           lambda: self.track.count - before >= checklist.FEWEST_POSES)
        waited = max(self.clock.now() - started, 1e-3)
        pose = checklist.check_poses(self.mocap, self.track.newest, self.track.count - before, waited)
        checklist.check_frame(self.mocap, pose, np.array([values[f"acc.{a}"] for a in "xyz"]), self.limits.fence)
        self._say(f"battery {values['pm.vbat']:.2f} V, poses at {(self.track.count - before) / waited:.0f} Hz, "
                  "up is up")
        return pose

    def _wait_for_supervisor(self) -> None:
        """Waits for a vehicle whose supervisor does not allow arming yet: it may still be starting."""
        values = self.link.values
        bits = int(values["supervisor.info"])
        if not checklist.may_arm(bits) and not bits & (LOCKED | CRASHED | TUMBLED):
            self._say(f"the vehicle does not allow arming yet: waits up to {checklist.STARTS_S:.0f} s, Ctrl-C ends it")

            def may_arm() -> bool:
                self.link.request_echo()  # a vehicle that hears nothing for a second stops its log
                return checklist.may_arm(int(values["supervisor.info"]))

            checklist.wait_for(self.clock, checklist.STARTS_S, may_arm)
        checklist.check_supervisor(self.link.uri, int(values["supervisor.info"]))

    def _estimate(self, pose: Pose, yaw_rad: float) -> None:
        """The vehicle's filter starts from here, and has to converge to the poses."""
        self.link.set_parameter("stabilizer.estimator", checklist.KALMAN)
        for attempt in range(1, checklist.RESETS + 1):
            try:
                return self._converged(pose, yaw_rad)
            except checklist.NotConvergedError as error:
                if attempt == checklist.RESETS:
                    raise
                self._say(f"{error.found}: the vehicle's filter is reset again ({attempt + 1} of {checklist.RESETS})")

    def _converged(self, pose: Pose, yaw_rad: float) -> None:
        link = self.link
        for name, value in zip(("X", "Y", "Z", "Yaw"), (*pose.position_m, yaw_rad), strict=True):
            link.set_parameter(f"kalman.initial{name}", float(np.float32(value)))
        link.set_parameter("kalman.resetEstimation", 1)
        until = self.clock.now() + RESET_S
        self.clock.sleep_until(until)
        turn = np.array([link.values[f"stateEstimate.{q}"] for q in ("qx", "qy", "qz", "qw")])
        checklist.check_yaw(self.mocap, float(so3.euler_zyx(pose.quaternion)[2]), float(so3.euler_zyx(turn)[2]))
        self._feed(True)
        steady = checklist.Convergence(self.mocap)

        def come() -> bool:
            newest = self.track.newest
            self._volts.append(link.values["pm.vbat"])
            return newest is not None and steady.near(self.clock.now(), newest, link.values)

        if not checklist.wait_for(self.clock, checklist.CONVERGE_S, come):
            self._feed(False)
            raise steady.refuse(self.track.newest or pose, link.values)
        off, turned = steady.apart(self.track.newest or pose, link.values)
        self._say(f"the estimate has come to the poses: {1000.0 * off:.0f} mm, {turned:.1f} deg apart")

    def _link_delay(self) -> float:
        """Half the median round trip of the link's echo."""
        trips = self.link.round_trips_s
        until = self.clock.now() + ECHOES_S
        while len(trips) < ECHOES and self.clock.now() < until:
            self.link.request_echo()
            self.clock.sleep_until(self.clock.now() + ECHO_S)
        if len(trips) < ECHOES:
            raise InputError(self.link.uri, f"{len(trips)} echoes in {ECHOES_S:.0f} s", "is the link good enough? "
                             "not armed")
        delay = 0.5 * float(np.median(list(trips)))
        self._say(f"link delay {1000.0 * delay:.1f} ms one way")
        return delay

    def _warm(self, pilot: Pilot, plan: Plan, delay_s: float) -> float:
        """Runs the pilot on the ground, so that nothing is compiled in the air; nothing is sent. Raises InputError for
        one that raises or cannot keep up."""
        pilot.link_delay(delay_s)
        believed = self.track.at(self.clock.now())
        battery = self.link.values["pm.vbat"]
        calls = []
        try:
            with last_resort(WARM_S), ExitStack() as as_in_flight:
                for round_ in range(2):
                    pilot.reset()
                    for tick in range(WARM_TICKS):
                        time_s = PERIOD_S * tick
                        commanded = plan.reference(plan.ends["take-off"] + time_s)
                        begun = self.clock.now()
                        if believed is not None:
                            pilot.packet(time_s, believed.state(battery), commanded)
                        if round_:
                            calls.append(self.clock.now() - begun)
                    if self.clock.real and not round_:  # all is compiled: the next round is timed
                        as_in_flight.enter_context(ahead_of_others())
                pilot.reset()
        except Exception as error:  # anybody's code
            raise InputError(f"controller {pilot.name}", f"raised {type(error).__name__}: {error}", "not armed") \
                from error
        call_s = float(np.median(calls))
        if call_s > PERIOD_S:
            raise InputError(f"controller {pilot.name}", f"takes {1000.0 * call_s:.1f} ms a set-point",
                             f"{1000.0 * PERIOD_S:.0f} ms are there; not armed")
        self._say(f"{pilot.name}: {1000.0 * call_s:.2f} ms a set-point")
        return call_s

    def _arm(self) -> None:
        values, ready = self.link.values, checklist.ARMED | checklist.CAN_FLY
        for _ in range(3):
            self.link.arm(True)
            if checklist.wait_for(self.clock, ARM_S / 3.0,
                                  lambda: int(values["supervisor.info"]) & ready == ready):
                self._say("armed")
                return
        self.link.arm(False)
        raise InputError(self.link.uri, "the vehicle does not arm", "see its console; nothing flies")
