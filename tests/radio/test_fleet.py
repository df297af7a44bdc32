"""Plans of fleets, the distances in them and in flight, and one end for all; nothing flies but a toy."""

from __future__ import annotations

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

from nanobench_tools.cli import simulate_serve
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError
from nanobench_tools.radio.fleet import fleet_session, separation
from nanobench_tools.radio.fleet.fleet_plan import read_fleet
from nanobench_tools.radio.fleet.gathering import Gathering, OtherRefusedError
from nanobench_tools.radio.fleet.member import Member
from nanobench_tools.radio.fleet.separation import Separation, check_plans, timeline
from nanobench_tools.radio.fleet.traffic import Traffic
from nanobench_tools.radio.fly.guardian import Guardian
from nanobench_tools.radio.fly.interrupts import Interrupts
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.pilot import OnboardPilot
from nanobench_tools.radio.fly.safety import Limits, Situation, Stop
from nanobench_tools.radio.fly.session import Request
from nanobench_tools.radio.host_clock import HostClock
from nanobench_tools.radio.several_flights import together

TWO = """
[[vehicle]]
name = "left"
uri = "udp://127.0.0.1:19850"
place = [0.0, -0.8]
trajectory = "circle"
size = 0.4
seconds = 6
controller = "onboard_pid"

[[vehicle]]
name = "right"
uri = "udp://127.0.0.1:19851"
place = [0.0, 0.8]
trajectory = "circle"
size = 0.4
seconds = 6
controller = "geometric"
delay_s = 1.0
"""
WALL = Separation(0.4, 0.8, 0.3, 0.0)


def fleet(tmp_path, *changes: tuple[str, str], text: str = TWO):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "fleet.toml"
    path.write_text(text)
    return path


def plans(path):
    return {v.name: (v.plan(), v.delay_s) for v in read_fleet(path).vehicles}


def test_paths_lie_where_the_vehicles_are(tmp_path):
    left, right = read_fleet(fleet(tmp_path)).vehicles
    for vehicle, y in ((left, -0.8), (right, 0.8)):
        points = vehicle.path.at(np.linspace(0.0, 6.0, 601)).position_m
        assert np.linalg.norm(points[:, :2] - [0.0, y], axis=1) == pytest.approx(np.full(601, 0.4), abs=1e-6)
    high = read_fleet(fleet(tmp_path, ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.1, 0.8, 0.3]"))).vehicles
    assert high[1].plan().height_m == pytest.approx(right.plan().height_m + 0.3)


def test_two_circles_side_by_side_keep_their_distance(tmp_path):
    """Centres 1.6 m apart, radii of 0.4 m: at least 0.8 m; on the ground and in phase 1.6 m."""
    (one, other, least), = check_plans(plans(fleet(tmp_path)), Separation())
    assert (one, other) == ("left", "right")
    assert 0.8 <= least <= 1.6


@pytest.mark.parametrize("change", [
    ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.0, -0.5, 0.0]"),   # the paths cross
    ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.0, -0.8, 0.9]"),   # one above the other: landing
    ("place = [0.0, 0.8]", "place = [0.0, -0.7]\ncentre = [0.0, 0.8, 0.0]"),   # they take off next to each other
])
def test_plans_that_come_too_close_are_refused_before_a_link_is_opened(change, tmp_path, capsys):
    assert main(["fly", "--fleet", str(fleet(tmp_path, change)), "--mocap", "simulated"]) == 2
    err = capsys.readouterr().err
    assert "left and right: their plans come too close" in err
    assert "not armed" in err
    assert len(err.splitlines()) == 1


def test_a_vehicle_that_takes_off_late_is_checked_too(tmp_path, monkeypatch):
    """Two circles 0.7 m apart, flown in phase: always 0.7 m. At 0.5 m/s, 0.8 s late is another 0.4 m."""
    path = fleet(tmp_path, ("place = [0.0, 0.8]", "place = [0.0, -0.1]"), ("delay_s = 1.0", "delay_s = 0.0"))
    with pytest.raises(InputError, match="too close"):
        check_plans(plans(path), Separation())
    monkeypatch.setattr(separation, "LATE_S", 0.0)
    (*_, least), = check_plans(plans(path), Separation())
    assert least == pytest.approx(0.7, abs=0.001)


def test_heights_count_only_where_they_are_certain(tmp_path):
    plan, _ = plans(fleet(tmp_path))["left"]
    line = timeline(plan, 2.0, np.array([0.0, 3.0, 8.0, 100.0]))
    assert line.flies.tolist() == [False, True, True, False]
    assert line.low_m == pytest.approx([0.0, 0.0, 1.0, 0.0])
    assert line.high_m == pytest.approx([0.0, 1.0, 1.0, 0.0])


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


def test_one_landing_lands_the_others_and_the_first_reason_counts():
    toy, notes = Toy(), Notes()
    gathering, traffic = Gathering(("one",), lambda ready: None), Traffic(WALL)
    member = Member("one", 0.0, traffic, gathering)
    toy.at.append((110.0, lambda: traffic.end("other", Stop("geofence", "x = 3.00 m", 1.0, "path"))))
    toy.at.append((110.0, lambda: traffic.end("third", Stop("tilt", "80 deg", 1.0, "path"))))
    outcome = Flight(toy, toy.track, OnboardPilot("mine", 1), toy.ready(), Limits(), toy, (notes,),
                     company=member).run()
    assert (outcome.stop.rule, outcome.stop.reason) == ("fleet", "other ended: geofence: x = 3.00 m")
    assert "land" in [what for _, what in toy.told]
    assert toy.place[2] < 0.05


def test_an_emergency_stop_reaches_a_flight_in_a_thread():
    toy, outcomes = Toy(), []
    member = Member("one", 0.0, Traffic(WALL), Gathering(("one",), lambda ready: None))
    flight = Flight(toy, toy.track, OnboardPilot("mine", 1), toy.ready(), Limits(), toy, (), company=member)
    toy.at.append((110.0, lambda: flight.interrupts.stop("space bar")))
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


VEHICLE = TWO.split("[[vehicle]]")[1]


@pytest.mark.parametrize(("path_of", "said"), [
    (lambda p: fleet(p, ("19851", "19850")), "two vehicles have the uri 'udp://127.0.0.1:19850'"),
    (lambda p: fleet(p, ('"right"', '"left"')), "two vehicles have the name 'left'"),
    (lambda p: fleet(p, text="[[vehicle]]" + VEHICLE), "has 1 [[vehicle]]; a fleet has 2 to 8"),
    (lambda p: fleet(p, text="".join(f"[[vehicle]]\nname = '{i}'\nuri = 'udp://127.0.0.1:{19850 + i}'\n"
                                     f"place = [{i}.0, 0.0]\ncontroller = 'lqr'\n" for i in range(9))), "has 9"),
    (lambda p: fleet(p, ("delay_s", "delay")), "did you mean 'delay_s'?"),
    (lambda p: fleet(p, ("delay_s = 1.0", "delay_s = 60.0")), "give a number from 0 to 20"),
    (lambda p: fleet(p, ("place = [0.0, 0.8]", "place = [0.0]")), "give 2 numbers"),
    (lambda p: fleet(p, ("place = [0.0, 0.8]", "")), "vehicle 2: place is missing"),
    (lambda p: fleet(p, ('controller = "geometric"', 'controller = "mpc_daqp"\nsimulator = "no.toml"')),
     "simulator = 'no.toml': there is no such file"),
    (lambda p: fleet(p, ('"udp://127.0.0.1:19851"', '"http://x"')), "uri = 'http://x': no URI of a Crazyflie"),
    (lambda p: fleet(p, ('"geometric"', '"geometrik"')), "did you mean 'geometric'?"),
    (lambda p: fleet(p, ("size = 0.4", "size = 4.0")), "beyond the fence"),
    (lambda p: fleet(p, text=TWO + "[separation]\nhorizontal = 1.0\n"), "did you mean 'horizontal_m'?"),
    (lambda p: fleet(p, text=TWO + "[separation]\nhorizontal_m = 1.0\n"), "vertical_m = 0.8 is below horizontal_m"),
    (lambda p: fleet(p, text=TWO + "[vehicles]\n"), "unknown key 'vehicles'"),
    (lambda p: p / "none.toml", "cannot be read"),
])
def test_a_mistake_in_the_plan_is_one_line(path_of, said, tmp_path, capsys):
    assert main(["fly", "--fleet", str(path_of(tmp_path)), "--mocap", "simulated"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_options_of_one_vehicle_do_not_go_with_a_fleet(tmp_path, capsys):
    for more in (["--controller", "lqr"], ["--uri", "udp://127.0.0.1:1"], ["--yaw", "3"]):
        assert main(["fly", "--fleet", str(fleet(tmp_path)), *more]) == 2
        assert f"{more[0]} does not go with --fleet" in capsys.readouterr().err
    assert main(["fly", "--fleet", str(fleet(tmp_path))]) == 2
    assert "left has no mocap" in capsys.readouterr().err


def test_a_dry_run_shows_the_distances_and_sends_nothing(tmp_path, capsys):
    assert main(["fly", "--fleet", str(fleet(tmp_path)), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "2 plans keep their distances; nothing was sent" in out


def test_the_vehicles_of_a_plan_are_served_at_their_addresses_and_places(tmp_path, capsys):
    given = dict.fromkeys(simulate_serve.SERVE_OPTIONS)
    found = simulate_serve._spots(None, {**given, "fleet": fleet(tmp_path, ("delay_s = 1.0", "yaw_deg = 30"))})
    assert [(spot.host, spot.port, spot.start) for spot in found] == [
        ("127.0.0.1", 19850, (0.0, -0.8, 0.0, 0.0)), ("127.0.0.1", 19851, (0.0, 0.8, 0.0, 30.0))]
    assert main(["simulate", "--fleet", str(fleet(tmp_path)), "--vehicles", "2"]) == 2
    assert "--fleet FILE has the addresses" in capsys.readouterr().err
    assert main(["simulate", "--fleet", str(fleet(tmp_path, ("127.0.0.1:19851", "10.0.0.1:19851")))]) == 2
    assert "others could reach it" in capsys.readouterr().err
