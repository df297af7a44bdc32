"""Flights of a fleet: one thread each, with the loop, rules and recorder of a single flight."""

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, replace

from ...errors import InputError, NanobenchError
from ..fly.company import GROUND_S
from ..fly.interrupts import Interrupts
from ..fly.keys import space_stops
from ..fly.pilot import PERIOD_S
from ..fly.pose_tracker import Believed
from ..fly.prepare import Ready
from ..fly.safety import Rule, Stop
from ..fly.session import Request, Result, fly_session
from ..host_clock import Clock
from .fleet_plan import FleetVehicle
from .gathering import Gathering, OtherRefusedError
from .separation import Separation, check_plans
from .traffic import Traffic, rules_of


class Member:
    """The ``company`` of a flight. ``interrupts``: of the flight, once it has begun; ``given_up``: why it was
    abandoned. ``share``: of a tick by which its loop comes after that of the first vehicle, so that they take turns."""

    single = False

    def __init__(self, name: str, delay_s: float, traffic: Traffic, gathering: Gathering, share: float = 0.0) -> None:
        self.name, self.delay_s = name, delay_s + share * PERIOD_S
        self._traffic, self._gathering = traffic, gathering
        self.rules: tuple[Rule, ...] = rules_of(traffic, name)
        self.interrupts: Interrupts | None = None
        self.given_up: Stop | None = None

    def confirm(self, ready: Ready, clock: Clock) -> None:
        """Before arming: waits for the others and the check of all plans."""
        self._gathering.ready(self.name, ready, clock)

    def ground_s(self, clock: Clock) -> float:
        """Armed: waits for the others. Time until this vehicle takes off."""
        return self._gathering.armed(self.name, clock, GROUND_S) + self.delay_s - clock.now()

    def flies(self, interrupts: Interrupts) -> None:
        """The flight begins."""
        self.interrupts = interrupts

    def seen(self, phase: str, believed: Believed | None) -> None:
        """Every tick."""
        self._traffic.seen(self.name, phase, believed)

    def stopped(self, stop: Stop) -> None:
        """The flight ends early: so do the others."""
        self._traffic.end(self.name, stop)

    def abandons(self, stop: Stop) -> bool:
        """The program goes on for the others."""
        self.given_up = stop
        return True


JOIN_S, REFUSED_S = 0.05, 10.0
"""Interval of a look at the threads; wait for threads that prepare a vehicle once the fleet is refused."""


@dataclass
class Flown:
    """Result of one vehicle: ``result``, or why it did not fly (``error``), or why its flight was abandoned."""

    vehicle: FleetVehicle
    result: Result | None = None
    error: BaseException | None = None
    given_up: Stop | None = None


class Fleet:
    """``requests``: of each vehicle, complete but for its company. ``confirm`` is called once before any vehicle is
    armed. ``turn(i)``: context of the thread of vehicle i (a simulated clock needs it)."""

    def __init__(self, vehicles: Sequence[FleetVehicle], requests: Sequence[Request], separation: Separation,
                 confirm: Callable[[], None] = lambda: None,
                 turn: Callable[[int], AbstractContextManager[None]] = lambda i: nullcontext()) -> None:
        self.vehicles, self._requests, self._separation = vehicles, requests, separation
        self._confirm, self._turn = confirm, turn
        self.traffic = Traffic(separation)
        self.gathering = Gathering(tuple(v.name for v in vehicles), self._check)
        self.members = [Member(v.name, v.delay_s, self.traffic, self.gathering, i / len(vehicles))
                        for i, v in enumerate(vehicles)]
        self.flown = [Flown(v) for v in vehicles]
        self._interrupted = False

    def fly(self) -> list[Flown]:
        """All flights until the last has ended. Raises InputError if any vehicle does not fly: then none does."""
        threads = [threading.Thread(target=self._run, args=(i,), name=f"flight of {vehicle.name}", daemon=True)
                   for i, vehicle in enumerate(self.vehicles)]
        interrupts = Interrupts()
        with ExitStack() as stack:
            stack.enter_context(interrupts.caught())
            for thread in threads:
                thread.start()
            self._wait(threads, interrupts, stack)
        for member, flown in zip(self.members, self.flown, strict=True):
            flown.given_up = member.given_up
        self._raise_refusal()
        return self.flown

    def _check(self, ready: Mapping[str, Ready]) -> None:
        """Before arming, from where the vehicles are."""
        for vehicle in self.vehicles:
            vehicle.check_place(ready[vehicle.name].pose.position_m)
        check_plans({v.name: (ready[v.name].plan, v.delay_s) for v in self.vehicles}, self._separation)
        self._confirm()

    def _run(self, i: int) -> None:
        vehicle, member, request = self.vehicles[i], self.members[i], self._requests[i]
        with self._turn(i):
            try:
                self.flown[i].result = fly_session(replace(
                    request, company=member, label=vehicle.name, sheet={
                        **request.sheet, "vehicle": vehicle.name, "centre_m": list(vehicle.path.centre_m)},
                    say=lambda text: request.say(f"{vehicle.name}: {text}"),
                    confirm=lambda ready: member.confirm(ready, request.clock)))
            except BaseException as error:  # the others have to know
                self.flown[i].error = error
                self.gathering.refuse(f"{vehicle.name}: {error}")
                self.traffic.end(vehicle.name, Stop("error", f"{type(error).__name__}: {error}", 0.0, ""))
            finally:
                self.traffic.gone(vehicle.name)

    def _wait(self, threads: Sequence[threading.Thread], interrupts: Interrupts, stack: ExitStack) -> None:
        """Until every thread has ended or was abandoned. Passes requests to end on to all flights. The space bar counts
        once a flight has begun: before, Enter answers the question whether to arm."""
        refused_looks, listens = 0, not self._requests[0].clock.real
        while True:
            try:
                alive = [t for t, member in zip(threads, self.members, strict=True)
                         if t.is_alive() and member.given_up is None]
                if not alive or refused_looks > REFUSED_S / JOIN_S:
                    return
                alive[0].join(JOIN_S)
                flying = any(member.interrupts is not None for member in self.members)
                if self.gathering.refused and not flying:
                    refused_looks += 1
                if flying and not listens:
                    listens = True
                    stack.enter_context(space_stops(lambda: self._stop("space bar")))
                if interrupts.requested:
                    self._request(interrupts.requested, flying)
            except KeyboardInterrupt:
                self._stop(interrupts.emergency) if interrupts.emergency else self._leave(interrupts.requested)

    def _request(self, why: str, flying: bool) -> None:
        """A first request: land, or do not fly."""
        if not flying:
            self._interrupted = True
            self.gathering.refuse(f"interrupted by {why}")
        for member in self.members:
            if member.interrupts is not None:
                member.interrupts.requested = why

    def _stop(self, why: str) -> None:
        """Motors of all vehicles off."""
        self.gathering.refuse(why)
        for member in self.members:
            if member.interrupts is not None:
                member.interrupts.stop(why)

    def _leave(self, why: str) -> None:
        self.gathering.refuse(why)
        for member in self.members:
            if member.interrupts is not None:
                member.interrupts.leave(why)

    def _raise_refusal(self) -> None:
        """The first reason not to fly, if no vehicle flew; bugs of this program; KeyboardInterrupt before arming."""
        errors = [(flown.vehicle, flown.error) for flown in self.flown if flown.error is not None]
        for _, error in errors:
            if not isinstance(error, NanobenchError):
                raise error
        if any(flown.result is not None or flown.given_up is not None for flown in self.flown):
            return
        if self._interrupted:
            raise KeyboardInterrupt
        for vehicle, error in errors:
            if not isinstance(error, OtherRefusedError):
                named = any(v.name in str(error) or v.uri in str(error) for v in self.vehicles)
                raise error if named else InputError(f"{vehicle.name} ({vehicle.uri})", str(error))
        raise InputError("--fleet", self.gathering.refused or "no vehicle answered", "none was armed")
