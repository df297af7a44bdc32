"""Distances in flight and one end for all vehicles of a fleet; only a toy flies."""

import os
import signal
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from test_fly_ends import WIDE, Hangs, Real, quick
from toy_vehicle import Notes, Toy

from nanobench_tools.radio.fleet import fleet_session
from nanobench_tools.radio.fleet.fleet_session import Member
from nanobench_tools.radio.fleet.gathering import Gathering, OtherRefusedError
from nanobench_tools.radio.fleet.separation import Separation
from nanobench_tools.radio.fleet.traffic import Traffic
from nanobench_tools.radio.fly.guardian import Guardian
from nanobench_tools.radio.fly.interrupts import Interrupts
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.pilot import OnboardPilot
from nanobench_tools.radio.fly.safety import Limits, Situation, Stop
from nanobench_tools.radio.fly.session import Request
from nanobench_tools.radio.host_clock import HostClock
from nanobench_tools.radio.several_flights import together

WALL = Separation(0.4, 0.8, 0.3, 0.0)


@pytest.mark.parametrize(("apart", "closing", "code"), [
    ((0.39, 0.0, 0.0), (0.0, 0.0, 0.0), 1),
    ((0.41, 0.0, 0.0), (0.0, 0.0, 0.0), 0),
    ((0.0, 0.0, 0.79), (0.0, 0.0, 0.0), 1),
    ((0.0, 0.0, 0.81), (0.0, 0.0, 0.0), 0),
    ((0.9, 0.0, 0.0), (-2.0, 0.0, 0.0), 2),    # 0.2 m until both brake, then 4 / 12 m: rests 0.37 m apart
    ((0.95, 0.0, 0.0), (-2.0, 0.0, 0.0), 0),   # rests 0.42 m apart
    ((0.9, 0.0, 0.0), (2.0, 0.0, 0.0), 0),     # away from each other
    ((0.9, 0.5, 0.0), (-2.0, 0.0, 0.0), 0),    # past each other
    ((1.0, 0.0, 0.0), (-4.0, 0.0, 0.0), 2),    # through the cylinder and out again
])
def test_the_cylinder_and_the_speed_of_closing(apart, closing, code):
    assert WALL.why(np.array([apart]), np.array([closing])) == [code]


def believed(place, velocity=(0.0, 0.0, 0.0)):
    return SimpleNamespace(position_m=np.array(place), velocity_m_s=np.array(velocity))


def test_a_vehicle_on_the_ground_is_no_reason_to_land():
    traffic = Traffic(WALL)
    rule = Member("one", 0.0, traffic, Gathering(("one",), lambda ready: None)).rules[0]
    now = Situation(position_m=np.array([0.2, 0.0, 1.0]))
    traffic.seen("other", "path", believed((0.0, 0.0, 1.0)))
    assert rule.check(now) == ""  # this one does not fly yet
    traffic.seen("one", "path", believed((0.2, 0.0, 1.0)))
    assert rule.check(now).startswith("other is 0.20 m level and 0.00 m in height away")
    traffic.seen("other", "landed", believed((0.0, 0.0, 0.0)))
    assert rule.check(now) == ""


def test_one_landing_lands_the_others_and_the_first_reason_counts(short_phases):
    toy, notes = Toy(), Notes()
    gathering, traffic = Gathering(("one",), lambda ready: None), Traffic(WALL)
    member = Member("one", 0.0, traffic, gathering)
    toy.at.append((105.0, lambda: traffic.end("other", Stop("geofence", "x = 3.00 m", 1.0, "path"))))
    toy.at.append((105.0, lambda: traffic.end("third", Stop("tilt", "80 deg", 1.0, "path"))))
    outcome = Flight(toy, toy.track, OnboardPilot("mine", 1), toy.ready(), Limits(), toy, (notes,),
                     company=member).run()
    assert (outcome.stop.rule, outcome.stop.reason) == ("fleet", "other ended: geofence: x = 3.00 m")
    assert "land" in [what for _, what in toy.told]
    assert toy.place[2] < 0.05


def test_an_emergency_stop_reaches_a_flight_in_a_thread(short_phases):
    toy, outcomes = Toy(), []
    member = Member("one", 0.0, Traffic(WALL), Gathering(("one",), lambda ready: None))
    flight = Flight(toy, toy.track, OnboardPilot("mine", 1), toy.ready(), Limits(), toy, (), company=member)
    toy.at.append((105.0, lambda: flight.interrupts.stop("space bar")))
    thread = threading.Thread(target=lambda: outcomes.append(flight.run()))
    thread.start()
    thread.join()
    assert outcomes[0].stop.reason == "space bar; the vehicle reports that it is locked"
    assert not toy.motors


def test_a_controller_that_hangs_in_a_fleet_is_abandoned_after_its_vehicle_has_landed(monkeypatch):
    """In a thread nothing can wake it. The program goes on for the others, who land as well."""
    quick(monkeypatch)
    monkeypatch.setattr(Guardian, "BACK_S", 0.2)
    toy, traffic, hangs = Real(), Traffic(WALL), threading.Event()
    member = Member("one", 0.0, traffic, Gathering(("one",), lambda ready: None))
    flight = Flight(toy, toy.track, Hangs(hangs.wait), toy.ready(), WIDE, toy, (), company=member)
    thread = threading.Thread(target=flight.run, daemon=True)
    thread.start()
    end = time.monotonic() + 60.0
    while member.given_up is None and time.monotonic() < end:
        time.sleep(0.01)
    assert member.given_up.rule == "overrun"
    assert "land" in [what for _, what in toy.told]
    assert traffic.ended("other").startswith("one ended: overrun: mine did not answer within 250 ms")
    assert thread.is_alive()
    hangs.set()
    thread.join(60.0)
    assert not thread.is_alive()


def test_all_wait_for_the_last_one_and_one_refusal_refuses_all():
    said, clock = [], Toy()
    gathering = Gathering(("one", "other"), lambda ready: said.append(sorted(ready)))
    clock.at.append((105.0, lambda: gathering.ready("other", "r2", clock)))
    gathering.ready("one", "r1", clock)
    assert said == [["one", "other"]]
    assert clock.now() >= 105.0
    clock.at.append((110.0, lambda: gathering.refuse("other: battery at 3.50 V")))
    with pytest.raises(OtherRefusedError, match="other: battery at"):
        gathering.armed("one", clock, 2.0)


def test_what_flights_change_in_the_program_is_undone_with_the_last():
    said = []

    @together
    @contextmanager
    def changed(name):
        said.append(f"{name} on")
        yield
        said.append(f"{name} off")

    with changed("b"):
        with changed("a"):
            pass
        assert said == ["b on", "a on"]
    assert said == ["b on", "a on", "a off", "b off"]


class Session:
    """Stands in for the flights of a fleet: each prepares, is asked, and begins. ``said``: in their order."""

    def __init__(self, monkeypatch, before) -> None:
        self.said: list[str] = []
        monkeypatch.setattr(fleet_session, "fly_session", self.fly)
        monkeypatch.setattr(fleet_session, "space_stops", self.keys)
        monkeypatch.setattr(fleet_session, "check_plans", lambda plans, separation: self.said.append("checked"))
        self.before = before
        vehicles = [SimpleNamespace(name=name, uri=name, delay_s=0.0, check_place=lambda place_m: None,
                                    path=SimpleNamespace(centre_m=(0.0, 0.0, 0.0))) for name in ("one", "other")]
        requests = [Request(None, None, Limits(), v.uri, None, (), clock=HostClock()) for v in vehicles]
        self.fleet = fleet_session.Fleet(vehicles, requests, WALL, lambda: self.said.append("asked"))

    @contextmanager
    def keys(self, stop):
        self.said.append("keys")
        yield

    def fly(self, request):
        self.before()
        request.confirm(SimpleNamespace(pose=SimpleNamespace(position_m=None), plan=None))
        request.company.ground_s(request.clock)
        request.company.flies(Interrupts())
        end = time.monotonic() + 60.0
        while "keys" not in self.said and time.monotonic() < end:
            time.sleep(0.001)
        return "flown"


def test_the_space_bar_is_read_only_after_the_question_whether_to_arm(monkeypatch):
    session = Session(monkeypatch, lambda: None)
    assert [one.result for one in session.fleet.fly()] == ["flown", "flown"]
    assert session.said == ["checked", "asked", "keys"]


def test_ctrl_c_before_arming_ends_the_fleet_without_a_flight(monkeypatch):
    def pressed() -> None:
        if threading.current_thread().name.endswith("one"):
            os.kill(os.getpid(), signal.SIGINT)
        end = time.monotonic() + 60.0
        while not session.fleet.gathering.refused and time.monotonic() < end:
            time.sleep(0.001)

    session = Session(monkeypatch, pressed)
    with pytest.raises(KeyboardInterrupt):
        session.fleet.fly()
    assert session.said == []
