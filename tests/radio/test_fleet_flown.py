"""Fleets on simulated vehicles that share one clock: flown, and with faults of one that land all."""

import os
import signal

import numpy as np
import pytest
from cflib_world import until
from fleet_plans import TWO
from fleet_worlds import Watched

from nanobench_tools.errors import InputError
from nanobench_tools.radio.fleet import fleet_session
from nanobench_tools.radio.packets import read_packets
from nanobench_tools.sources.discover import load_recordings

pytestmark = pytest.mark.slow


def test_two_vehicles_fly_at_once_with_a_recording_each(tmp_path):
    watched = Watched(tmp_path, TWO.replace("seconds = 4", "seconds = 5"), record=True)
    left, right = watched.fly()
    assert (left.error, right.error) == (None, None)
    assert (left.result.outcome.stop, right.result.outcome.stop) == (None, None)
    assert (watched.top_m > 0.9).all()
    assert max(watched.heights_m) < 0.01
    begun = [dict(one.result.outcome.phases)["take-off"] for one in (left, right)]
    assert begun[1] - begun[0] == pytest.approx(1.0, abs=0.05)
    assert watched.nearest_m > 0.8  # what the plans keep, and the lag of the first
    flights = load_recordings([tmp_path / "flights"]).flights
    assert len(flights) == 2
    for one, y in ((left, -0.8), (right, 0.8)):
        sheet = read_packets(one.result.raw).sheet
        assert (sheet["vehicle"], sheet["centre_m"]) == (one.vehicle.name, [0.0, y, 0.0])
        flight = next(f for f in flights if f.name.startswith(one.vehicle.name))
        assert np.median(flight["mocap"]["py"]) == pytest.approx(y, abs=0.45)


def test_the_link_of_one_dies_and_all_land(tmp_path):
    """It falls by its watchdog, the other one lands by its planner."""
    def cut(watched: Watched, since_s: float) -> None:
        watched.fleet.worlds[0].down = since_s > 3.0

    watched = Watched(tmp_path, fault=cut)
    left, right = watched.fly()
    assert left.result.outcome.stop.rule == "lost link"
    assert right.result.outcome.stop.rule == "fleet"
    assert right.result.outcome.stop.reason.startswith("left ended: lost link")
    reaction = right.result.outcome.phases[-2][1] - left.result.outcome.phases[-2][1]
    assert 0.0 <= reaction < 0.05  # seconds between the two hand-overs
    watched.fleet.run_on(3.0)
    assert max(watched.heights_m) < 0.05
    assert watched.sank_m_s[1] < 1.0


def test_vehicles_that_come_too_close_land_before_they_touch(tmp_path, monkeypatch):
    """Their plans cross, and the check of plans is switched off."""
    monkeypatch.setattr(fleet_session, "check_plans", lambda plans, separation: [])
    text = TWO.replace("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.0, -0.8, 0.0]")
    watched = Watched(tmp_path, text)
    rules = {one.result.outcome.stop.rule for one in watched.fly()}
    assert "separation" in rules
    assert rules <= {"separation", "fleet"}
    assert watched.nearest_m > 0.2  # a Crazyflie 2 is 0.14 m wide
    assert max(watched.heights_m) < 0.05


@pytest.mark.parametrize(("fault", "said"), [
    ("crossing", "their plans come too close"), ("exchanged", "exchanged with another vehicle?")])
def test_no_vehicle_is_armed_if_the_plans_do_not_fit_the_measured_places(fault, said, tmp_path):
    if fault == "crossing":
        watched = Watched(tmp_path, TWO.replace("centre", "x").replace("place = [0.0, 0.8]", "place = [0.0, -0.2]"))
    else:
        watched = Watched(tmp_path, places={0: (0.0, 0.8), 1: (0.0, -0.8)})
    with pytest.raises(InputError, match="not armed") as refused:
        watched.fly()
    assert said in str(refused.value)
    assert watched.top_m.max() < 0.01


@pytest.mark.parametrize(("signals", "rule"), [(1, "interrupted"), (2, "emergency stop")])
def test_ctrl_c_ends_all_flights(signals, rule, tmp_path):
    left = [signals]

    def pressed(watched: Watched, since_s: float) -> None:
        if since_s > 2.0 * (signals - left[0] + 1) and left[0]:
            left[0] -= 1
            os.kill(os.getpid(), signal.SIGINT)
            asked = "requested" if left[0] == signals - 1 else "emergency"
            assert until(lambda: all(getattr(one.interrupts, asked) for one in watched.session.members))

    watched = Watched(tmp_path, TWO.replace("seconds = 4", "seconds = 60"), fault=pressed)
    stops = [one.result.outcome.stop for one in watched.fly()]
    assert {stop.rule for stop in stops} <= {rule, "fleet"}
    assert rule in {stop.rule for stop in stops}
    watched.fleet.run_on(2.0)
    assert max(watched.heights_m) < 0.05
    assert (watched.sank_m_s.max() < 1.0) == (signals == 1)
