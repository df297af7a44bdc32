"""Packets of one kind at a time vanish or come late in flight: the flight goes on, or ends on the ground and says why.

On the simulated vehicle's own clock, through cflib.
"""

from __future__ import annotations

import pytest
from faulty_world import FaultyWorld, every, kind
from toy_vehicle import Notes

from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.radio.crtp import Port
from nanobench_tools.radio.fly import session
from nanobench_tools.radio.fly.flight_plan import chosen_path
from nanobench_tools.radio.fly.outcome import Outcome
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.session import Request, fly_session
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.packet_faults import Kind
from nanobench_tools.radio.simulated.supervisor import State

SETPOINTS, END_OF_SETPOINTS = kind(Port.GENERIC, 0), kind(Port.GENERIC, 1)
POSES, HIGH_LEVEL, ECHO = kind(Port.LOCALIZATION, 1), kind(Port.HIGH_LEVEL), kind(Port.LINK)
LOG, PARAMETERS, CONSOLE = kind(Port.LOG), kind(Port.PARAM), kind(Port.CONSOLE)
GENTLY_M_S = 1.5
"""A landing of the vehicle's own planner sinks with 0.8 m/s at most, and 1.3 while it takes over; a fall from there has
4.5."""


def any_of(*kinds: Kind) -> Kind:
    """Packets of any of these kinds."""
    return lambda packet: any(one(packet) for one in kinds)


def slow(*case: object) -> object:
    """A case that ``make test`` leaves out, its name last; each outcome has one that it keeps."""
    return pytest.param(*case[:-1], id=str(case[-1]), marks=pytest.mark.slow)


pytestmark = pytest.mark.usefixtures("short_phases")


def flown(world: FaultyWorld, patch: pytest.MonkeyPatch, controller: str = "onboard_pid") -> tuple[Outcome, list[str]]:
    """Outcome, and what the flight said of itself."""
    notes = Notes()
    patch.setattr(session, "Watch", lambda *_, **__: _Watch(notes))
    path = chosen_path("circle", 0.5, 0.4, 4.0)
    with world.served() as uri:
        outcome = fly_session(Request(path, pilot_for(controller, None, None), Limits(), uri, world, (),
                                      clock=world)).outcome
        return outcome, notes.said


class _Watch:
    """The display, kept."""

    def __init__(self, notes: Notes) -> None:
        self.tick, self.note = notes.tick, notes.note

    def __enter__(self) -> _Watch:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def on_the_ground(world: FaultyWorld) -> bool:
    return world.simulation.onboard.vehicle.true_pose()[0][2] < 0.02


@pytest.mark.parametrize("fault", [
    slow({"up": ECHO, "down": any_of(ECHO, PARAMETERS, CONSOLE)}, "echoes, parameters and console"),
    slow({"up": SETPOINTS, "lasts_s": 0.3}, "set-points 0.3 s"),
    slow({"up": POSES, "lasts_s": 0.5}, "poses 0.5 s"), slow({"down": LOG, "lasts_s": 1.5}, "log 1.5 s"),
    pytest.param({"up": every, "down": every, "lasts_s": 0.3}, id="link 0.3 s"),
    slow({"up": every, "down": every, "share": 0.6}, "60 percent"),
    slow({"up": any_of(SETPOINTS, POSES), "late_s": 0.05}, "set-points and poses late"),
    slow({"down": LOG, "late_s": 0.2}, "log late"),
    slow({"radio": RadioOptions(latency_s=0.01, loss=0.6)}, "radio 60 percent")])
def test_what_a_flight_can_do_without_does_not_end_it(fault, monkeypatch):
    world = FaultyWorld(**fault)
    outcome, _ = flown(world, monkeypatch)
    assert outcome.stop is None
    assert on_the_ground(world)
    assert world.sank_m_s < GENTLY_M_S
    assert world.simulation.onboard.supervisor.state != State.LOCKED
    assert world.struck > 10 or "radio" in fault


@pytest.mark.parametrize(("fault", "rule", "words"), [
    slow({"up": SETPOINTS}, "console", "No setpoint, levelling out", "set-points"),
    slow({"down": LOG}, "silent log", "battery and supervisor were not heard of for 2.0 s", "log"),
    slow({"up": POSES}, "astray", "m from the poses", "poses"),
    slow({"down": every}, "lost link", "no packet for 0.5", "everything that comes"),
    slow({"up": every, "down": every, "lasts_s": 0.8}, "lost link", "no packet for 0.5", "link 0.8 s")])
def test_what_it_cannot_do_without_ends_it_gently_on_the_ground(fault, rule, words, monkeypatch):
    world = FaultyWorld(**fault)
    outcome, said = flown(world, monkeypatch)
    assert outcome.stop is not None
    assert outcome.stop.rule == rule
    assert words in outcome.stop.reason
    assert f"stop: {outcome.stop}" in said
    assert on_the_ground(world)
    assert world.sank_m_s < GENTLY_M_S


@pytest.mark.parametrize(("fault", "rule"), [
    slow({"up": every}, "console", "everything that is sent"),
    slow({"up": every, "down": every}, "lost link", "link")])
def test_a_vehicle_that_nothing_reaches_is_left_to_its_watchdog_and_the_reason_is_said(fault, rule, monkeypatch):
    """It levels out after 0.5 s and stops its motors after 2: that is the firmware's, and it falls."""
    world = FaultyWorld(**fault)
    outcome, said = flown(world, monkeypatch)
    assert outcome.stop is not None
    assert outcome.stop.rule == rule
    assert f"stop: {outcome.stop}" in said
    assert outcome.stop.phase not in ("landing", "landed")
    world.sleep_until(world.now() + 3.0)
    assert on_the_ground(world)
    assert world.simulation.onboard.supervisor.state == State.LOCKED


@pytest.mark.parametrize(("fault", "words", "most_m_s"), [
    slow({"up": HIGH_LEVEL}, "its planner did not answer the command to land", 1.8, "commands to land"),
    slow({"up": END_OF_SETPOINTS}, "commanded to land it did not sink for 1.5 s", GENTLY_M_S, "end of set-points")])
def test_a_vehicle_that_does_not_hear_that_it_shall_land_is_taken_down_by_set_points(fault, words, most_m_s,
                                                                                      monkeypatch):
    world = FaultyWorld(**fault)
    _, said = flown(world, monkeypatch)
    assert any(text.startswith(words) and text.endswith("taken down by set-points") for text in said)
    assert on_the_ground(world)
    assert world.sank_m_s < most_m_s
