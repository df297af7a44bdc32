"""Every rule, by a fault injected into link, motion capture or controller: held, landed, and told why."""

import os
import signal

import numpy as np
import pytest
from toy_vehicle import Notes, Toy

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.radio.fly import setpoint_packets
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.pilot import OnboardPilot
from nanobench_tools.radio.fly.safety import HardFence, Limits, LowBattery, Situation, first_stop, rules
from nanobench_tools.radio.fly.safety_handover import place_to_hold

pytestmark = pytest.mark.usefixtures("short_phases")
IN_PATH = 106.5


def slow_case(*values: object) -> object:
    """A case that ``make test`` leaves out."""
    return pytest.param(*values, marks=pytest.mark.slow)


def flown(toy: Toy, pilot=None, limits: Limits | None = None) -> tuple:
    notes = Notes()
    flight = Flight(toy, toy.track, pilot or OnboardPilot("pid", 1), toy.ready(), limits or Limits(), toy, (notes,))
    return flight.run(), notes


def landed(toy: Toy) -> bool:
    return toy.place[2] < 0.05 and not toy.motors and "land" in [w for _, w in toy.told]


def test_a_flight_without_faults_flies_its_plan_and_lands():
    toy = Toy()
    outcome, _ = flown(toy)
    assert outcome.stop is None
    assert [name for name, _ in outcome.phases] == [
        "ground", "take-off", "hover", "approach", "fade-in", "path", "fade-out", "hover at end", "landing", "landed"]
    assert landed(toy)
    assert outcome.beat.missed == 0


def failing(toy: Toy, what) -> Toy:
    toy.at.append((IN_PATH, what))
    return toy


def raising(toy: Toy) -> OnboardPilot:
    class Raises(OnboardPilot):
        def packet(self, time_s, state, reference):
            if toy.time_s > IN_PATH:
                raise RuntimeError("no idea")
            return super().packet(time_s, state, reference)

    return Raises("mine", 1)


def no_number(toy: Toy) -> OnboardPilot:
    class Nan(OnboardPilot):
        def packet(self, time_s, state, reference):
            nan = toy.time_s > IN_PATH
            return (setpoint_packets.rates(40000.0, np.full(3, np.nan)) if nan
                    else super().packet(time_s, state, reference))

    return Nan("mine", 1)


def slow(toy: Toy) -> OnboardPilot:
    class Slow(OnboardPilot):
        def packet(self, time_s, state, reference):
            if toy.time_s > IN_PATH:
                toy.sleep_until(toy.time_s + 0.15)
            return super().packet(time_s, state, reference)

    return Slow("mine", 1)


def late(toy: Toy) -> OnboardPilot:
    class Late(OnboardPilot):
        def packet(self, time_s, state, reference):
            if toy.time_s > IN_PATH:
                toy.sleep_until(toy.time_s + 0.012)
            return super().packet(time_s, state, reference)

    return Late("mine", 1)


@pytest.mark.parametrize(("rule", "fault"), [
    ("stale pose", lambda toy: setattr(toy, "blind", True)),
    ("lost link", lambda toy: setattr(toy, "mute", True)),
    slow_case("lost link", lambda toy: setattr(toy, "lost", "radio unplugged")),
    slow_case("geofence", lambda toy: setattr(toy, "drift_m_s", np.array([2.9, 0.0, 0.0]))),
    slow_case("speed", lambda toy: setattr(toy, "drift_m_s", np.array([0.0, 3.4, 0.0]))),
    slow_case("tilt", lambda toy: setattr(toy, "quaternion", so3.from_euler_zyx(0.0, 1.0, 0.0))),
    slow_case("low battery", lambda toy: toy.values.update({"pm.vbat": 2.7})),
    slow_case("supervisor", lambda toy: toy.values.update({"supervisor.info": 1 << 7})),
    slow_case("console", lambda toy: setattr(toy, "alarm", "ESTKALMAN: State out of bounds, resetting")),
    slow_case("slow link", lambda toy: toy.round_trips_s.extend([0.4] * 10)),
    slow_case("slow link", lambda toy: setattr(toy, "log_late_s", 0.3)),
    slow_case("silent log", lambda toy: setattr(toy, "unlogged", True)),
])
def test_a_fault_of_the_vehicle_its_link_or_the_poses_ends_the_flight_on_the_ground(rule, fault):
    toy = Toy()

    def inject() -> None:
        fault(toy)
        toy.at.append((toy.time_s + 0.9, lambda: setattr(toy, "drift_m_s", np.zeros(3))))  # it does obey the hold

    outcome, notes = flown(failing(toy, inject))
    assert outcome.stop.rule == rule
    assert outcome.stop.phase == "path"
    assert any(text.startswith(f"stop: {rule}") for text in notes.said)
    assert IN_PATH - 100.0 <= outcome.stop.time_s < IN_PATH - 100.0 + 2.1
    assert landed(toy)


SEEN = {  # rule -> what of the situation it sees at its limit and beyond
    "interrupted": ({}, {"interrupted": "Ctrl-C"}), "lost link": ({"silent_s": 0.5}, {"silent_s": 0.51}),
    "supervisor": ({"supervisor": 1 << 4}, {"supervisor": 1 << 6}), "poses": ({}, {"pose_fault": "the same pose"}),
    "estimate": ({}, {"estimate_fault": "it turns"}), "stale pose": ({"pose_age_s": 0.3}, {"pose_age_s": np.nan}),
    "console": ({}, {"alarm": "assert"}), "controller": ({}, {"controller_error": "no number"}),
    "overrun": ({"call_s": 0.1, "late_ticks": 9}, {"late_ticks": 10}),
    "braking distance": ({"velocity_m_s": np.array([2.0, 0.0, 0.0])}, {"velocity_m_s": np.array([5.0, 0.0, 0.0])}),
    "geofence": ({"position_m": np.array([2.0, 0.0, -0.1])}, {"position_m": np.array([0.0, -2.1, 1.0])}),
    "tilt": ({"tilt_rad": 0.87}, {"tilt_rad": 0.88}),
    "speed": ({"velocity_m_s": np.array([0.0, 3.0, 0.0])}, {"velocity_m_s": np.array([0.0, 3.1, 0.0])}),
    "low battery": ({"battery_V": 2.91}, {"battery_V": 2.89}), "sinks": ({"below_m": 0.3}, {"below_m": 0.31}),
    "falls": ({"below_m": 0.1, "sinks_m_s": 3.0}, {"below_m": 0.2, "sinks_m_s": 1.21}),
    "silent log": ({"health_age_s": 2.0}, {"health_age_s": 2.1}), "slow link": ({"trip_s": 0.25}, {"trip_s": 0.26}),
    "astray": ({"astray_m": 0.2}, {"astray_m": 0.21})}


@pytest.mark.parametrize("rule", SEEN)
def test_each_rule_ends_the_flight_beyond_its_limit_and_none_at_it(rule):
    """For two seconds, as long as any rule with a memory waits."""
    assert {one.name for one in rules(Limits())} == set(SEEN)
    for seen, expected in zip(SEEN[rule], (set(), {rule}), strict=True):
        checks = rules(Limits())
        stops = [first_stop(checks, Situation(time_s=t, **seen), "path") for t in np.arange(0.0, 2.0, 0.01)]
        assert {stop.rule for stop in stops if stop is not None} == expected


@pytest.mark.slow
def test_a_vehicle_that_cannot_hold_its_height_lands_before_it_lies_on_the_ground():
    toy = Toy()
    outcome, _ = flown(failing(toy, lambda: toy.drift_m_s.__setitem__(2, -1.8)))  # it climbs with 1.5 m/s at most
    assert outcome.stop.rule == "sinks"
    assert "m below the commanded height for 1.5 s; battery 3.90 V" in outcome.stop.reason
    assert landed(toy)


@pytest.mark.parametrize(("rule", "pilot", "words"), [
    ("controller", raising, "RuntimeError: no idea"), slow_case("controller", no_number, "no number"),
    ("overrun", slow, "the controller took 150 ms"), slow_case("overrun", late, "10 deadlines missed in a row")])
@pytest.mark.slow
def test_a_fault_of_the_controller_ends_the_flight_on_the_ground(rule, pilot, words):
    toy = Toy()
    outcome, _ = flown(toy, pilot(toy))
    assert outcome.stop.rule == rule
    assert words in str(outcome.stop)
    assert landed(toy)
    kinds = {setpoint_packets.decoded(p)["kind"] for p in toy.packets}
    assert kinds == {"position", "stop"}  # what the controller said wrongly was never sent


def test_ctrl_c_lands_and_the_signal_is_given_back():
    before = signal.getsignal(signal.SIGINT)
    toy = Toy()
    outcome, _ = flown(failing(toy, lambda: os.kill(os.getpid(), signal.SIGINT)))
    assert (outcome.stop.rule, outcome.stop.reason) == ("interrupted", "Ctrl-C")
    assert landed(toy)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_vehicle_that_does_not_lift_is_told_again_and_then_left():
    toy = Toy()
    toy.most_m_s = 0.0
    outcome, _ = flown(toy)
    assert (outcome.stop.rule, outcome.stop.phase) == ("take-off", "take-off")
    assert [w for _, w in toy.told].count("take-off") >= 3


def test_a_reason_on_the_ground_flies_nothing():
    toy = Toy()
    toy.blind = True
    flight = Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, (), ground_s=1.0)
    assert flight.run().stop.phase == "ground"
    assert "take-off" not in [w for _, w in toy.told]


@pytest.mark.parametrize(("rule", "fault"), [
    slow_case("lost link", lambda toy: setattr(toy, "mute", True)),
    ("supervisor", lambda toy: toy.values.__setitem__("supervisor.info", 1 << 7))])
@pytest.mark.slow
def test_what_goes_wrong_while_it_lands_is_said(rule, fault):
    toy = Toy()
    land = toy.land

    def faulty(height_m: float, duration_s: float) -> None:
        land(height_m, duration_s)
        fault(toy)

    toy.land = faulty
    outcome, _ = flown(toy)
    assert (outcome.stop.rule, outcome.stop.phase) == (rule, "landing")
    assert [name for name, _ in outcome.phases][-1] == "landed"


def test_dips_of_the_battery_under_load_are_none():
    rule = LowBattery(3.0)
    said = [rule.check(Situation(time_s=0.01 * k, battery_V=2.8 if k % 4 == 0 else 3.3)) for k in range(400)]
    assert not any(said)
    assert any(rule.check(Situation(time_s=4.0 + 0.01 * k, battery_V=2.8)) for k in range(300))


def test_a_battery_that_will_be_empty_before_it_is_home_ends_the_flight_sooner():
    def first_s(home_s: float) -> float:
        rule = LowBattery(3.0)
        return next(t for t in np.arange(0.0, 100.0, 0.01)
                    if rule.check(Situation(time_s=t, battery_V=3.6 - 0.01 * t, home_s=home_s)))

    assert 60.5 < first_s(0.0) < 61.5
    assert first_s(0.0) - first_s(10.0) == pytest.approx(10.0, abs=0.5)


def test_the_load_of_take_off_is_no_trend_of_the_battery():
    rule = LowBattery(2.9)
    assert not any(rule.check(Situation(time_s=t, battery_V=3.8 if t < 0.5 else 3.2, home_s=8.0))
                   for t in np.arange(-2.0, 30.0, 0.01))


def test_a_vehicle_too_fast_to_stop_before_the_hard_fence_is_stopped_inside():
    rule = HardFence(*Limits().fence)
    place = np.array([1.7, 0.0, 1.0])
    assert not rule.check(Situation(position_m=place, velocity_m_s=np.array([1.0, 0.0, 0.0])))
    assert "outside the hard fence" in rule.check(Situation(position_m=place, velocity_m_s=np.array([2.9, 0.0, 0.0])))
    assert not rule.beyond(Situation(position_m=np.array([2.9, 0.0, 1.0])))
    assert rule.beyond(Situation(position_m=np.array([3.1, 0.0, 1.0])))


def test_beyond_the_hard_fence_the_motors_stop():
    toy = Toy()
    outcome, _ = flown(failing(toy, lambda: setattr(toy, "drift_m_s", np.array([2.4, 0.0, 0.0]))))
    assert outcome.stop.rule == "emergency stop"
    assert "outside the hard fence" in outcome.stop.reason
    assert not toy.motors
    assert toy.place[0] < 2.0 + HardFence.HARD_M + 0.1


def test_the_place_to_hold_lies_inside_the_fence_and_above_the_ground():
    fence = Limits().fence
    place = place_to_hold(np.array([2.6, 0.0, 0.3]), np.array([1.0, 0.0, -3.0]), fence, 0.0)
    assert (place >= fence[0]).all()
    assert place[0] == pytest.approx(1.85)
    assert place[2] == pytest.approx(0.06)
    assert np.isfinite(place_to_hold(np.full(3, np.nan), np.zeros(3), fence, 0.0)).all()


def test_a_fence_that_is_none_is_refused():
    with pytest.raises(UsageError, match="each least below"):
        Limits(fence_m=(1.0, -1.0, -1.0, 1.0, 0.0, 2.0))
