"""The circle: fly a simulated Crazyflie through cflib, record, audit, score - no edit by hand in between.

On the simulation's own clock, so that the numbers are the same on any machine; through sockets and in real time it is
``test_circle_sockets.py``, with all controllers and hidden effects ``benchmarks/studies/fly_loop.py``.
"""

import dataclasses
import json
import os
import shlex
import signal
from pathlib import Path

import numpy as np
import pytest

from controllers.plants.served_vehicle import served
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.cli.main import main
from nanobench_tools.radio.fly.flight_plan import chosen_path
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.session import Request, fly_session
from nanobench_tools.radio.fly.setpoint_packets import decoded
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.packets import SENT, read_packets
from nanobench_tools.radio.record_export import export
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions
from nanobench_tools.sources.discover import load_recordings

pytestmark = pytest.mark.slow

FLYING = Path(__file__).parents[2] / "docs/flying.md"
ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)
"""Noise as the recordings have it."""
FILTER_S = np.sqrt(2.0) / (2.0 * np.pi * 80.0) + 0.001
"""What the gyro itself is late by: the firmware's low pass (two poles, 80 Hz), and the loop that logs after it."""
CONTROLLERS = {"onboard_pid": 4.15, "mpc_daqp": 3.85}
"""Battery at rest [V]. The predictive controller has no more than it needs: a motor is at its end with every command
that is larger than has to be, and the mixer then takes thrust from all."""


def tutorial() -> dict[str, list[list[str]]]:
    """The commands of the section of docs/flying.md, by verb, without the program's name."""
    section = FLYING.read_text().split("## Fly it and record it\n")[1].split("\n## ")[0]
    found: dict[str, list[list[str]]] = {}
    for line in section.split("With a real vehicle")[0].splitlines():
        if line.startswith("nanobench "):
            verb, *rest = shlex.split(line)[1:]
            found.setdefault(verb, []).append([verb, *rest])
    return found


def value(command: list[str], option: str) -> str:
    return command[command.index(option) + 1]


def in_world(world: VirtualWorld, request: Request):
    """What is asked for over a socket, flown in ``world`` on its own clock."""
    with world.served() as uri:
        return fly_session(dataclasses.replace(request, uri=uri, source=world, clock=world))


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """The tutorial's flights: folder, and controller -> (result, world, audit)."""
    commands, place = tutorial(), tmp_path_factory.mktemp("tutorial")
    served_as = commands["simulate"][0]
    radio = RadioOptions(latency_s=float(value(served_as, "--latency-s")), loss=float(value(served_as, "--loss")))
    assert radio == RadioOptions(latency_s=0.010, loss=0.02)
    results = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for command in commands["fly"]:
            assert value(command, "--uri") == value(served_as, "--serve")
            name = value(command, "--controller")
            world = VirtualWorld(served(battery_V=CONTROLLERS[name]), radio, ROOM)

            def flown(request: Request, name: str = name, world: VirtualWorld = world):
                results[name] = in_world(world, request), world
                return results[name][0]

            patch.setattr("nanobench_tools.radio.fly.session.fly_session", flown)
            assert main([*command, "--quiet"]) == 0
    audits = {str(a.controller): a for a in map(audit, load_recordings([place / "flights"]).flights)}
    return place / "flights", {name: (*found, audits[name]) for name, found in results.items()}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_it_flies_lands_and_the_audit_finds_no_fault(flights, name):
    result, world, found = flights[1][name]
    assert result.outcome.stop is None
    assert world.simulation.onboard.vehicle.true_pose()[0][2] < 0.01
    assert {fault.kind for fault in found.faults} <= {"interpolated"}
    assert found.flight == result.recording.csv.stem
    for stream, count in result.recording.counts.items():
        if stream not in ("mocap", "battery"):
            assert 0.94 < count / result.recording.counts["mocap"] < 1.0  # 2 % are lost, and none is made up


def test_the_audit_finds_the_clock_of_the_recording(flights):
    for name in CONTROLLERS:
        assert abs(flights[1][name][2].clock["imu"].offset_s - FILTER_S) < 0.002
    alignment = flights[1]["onboard_pid"][0].recording.alignment
    assert alignment.down_s == pytest.approx(0.010, abs=0.001)
    assert abs(alignment.rate - 1.0) < 2e-5


def test_stamps_of_arrival_are_late_by_the_link_and_the_audit_says_so(flights, tmp_path):
    raw = next(flights[0].glob(".raw/*onboard-pid*.packets"))
    late = audit(load_recordings([export(raw, tmp_path, "arrival").csv]).flights[0]).clock["imu"]
    assert abs(late.offset_s - FILTER_S - 0.010) < 0.002


def test_an_interrupted_recording_is_exported_again(flights, tmp_path):
    raw = next(flights[0].glob(".raw/*onboard-pid*.packets"))
    cut = tmp_path / "cut.packets"
    cut.write_bytes(raw.read_bytes()[:-150_001])
    assert main(["record", "--export", str(cut), "--out", str(tmp_path), "--quiet"]) == 0
    exported = flights[0] / flights[1]["onboard_pid"][0].recording.csv.name
    whole, part = (load_recordings([p]).flights[0] for p in (exported, tmp_path / "cut.csv"))
    n = len(part["imu"]) - 5
    assert n > 1000
    np.testing.assert_allclose(part["imu"].values[:n], whole["imu"].values[:n], atol=0.02)
    assert (tmp_path / ".raw" / "cut" / "imu.parquet").exists()


def test_the_tutorial_ends_in_a_table_in_which_mpc_is_a_third_better(flights, tmp_path, monkeypatch, capsys):
    assert set(flights[1]) == set(CONTROLLERS)
    commands = tutorial()
    monkeypatch.chdir(flights[0].parent)
    assert main([*commands["audit"][0], "--jobs", "1", "--quiet"]) == 0
    out = tmp_path / "control.json"
    assert main([*commands["control"][0], "--jobs", "1", "--json", str(out), "--quiet"]) == 0
    assert sorted(commands) == ["audit", "control", "fly", "simulate"]
    rmse = {row["controller"]: row["metrics"]["rmse_m"] for row in json.loads(out.read_text())["rows"]}
    assert rmse["mpc_daqp"] < 0.7 * rmse["onboard_pid"]
    assert rmse["mpc_daqp"] < 0.02


def test_commands_of_a_predictive_controller_do_not_swing_between_their_bounds(flights):
    raw = read_packets(next(flights[0].glob(".raw/*mpc*.packets")))
    phases = dict(raw.sheet["flight"]["phases"])
    sent = [decoded(r.payload[1:]) for r in raw.records
            if r.kind == SENT and r.payload[0] & 0xF3 == 0x70 and phases["approach"] < r.time_s < phases["landing"]]
    rates = np.array([s["rate_rad_s"] for s in sent])
    assert len(rates) > 900
    assert np.abs(np.diff(rates, axis=0)).mean() < 0.1  # the path itself turns it by 0.4 rad/s
    assert np.abs(rates).max() < 3.0
    assert np.mean([s["thrust_counts"] == 65535 for s in sent]) < 0.05


def test_the_raw_recording_has_what_was_sent_and_the_sheet_who_flew(flights):
    raw = read_packets(next(flights[0].glob(".raw/*mpc*.packets")))
    assert raw.sheet["synthetic"] is True
    assert raw.sheet["controller"] == "mpc_daqp"
    assert raw.sheet["flight"]["stopped"] is None
    assert [name for name, _ in raw.sheet["flight"]["phases"]][1:4] == ["take-off", "hover", "approach"]


def in_the_air(world: VirtualWorld, seconds: float, what) -> None:
    """Injects a fault once the vehicle has been above 0.8 m for so long."""
    above = []
    step = world._step

    def watched(time_s: float) -> None:
        step(time_s)
        if world.simulation.onboard.vehicle.true_pose()[0][2] > 0.8:
            above.append(time_s)
        if above and time_s > above[0] + seconds:
            what()

    world._step = watched


def test_a_vehicle_whose_program_is_ended_at_once_lands_by_its_own_planner():
    world = VirtualWorld(served(), RadioOptions(latency_s=0.010), ROOM)
    path, pilot = chosen_path("circle", 0.5, 0.4, 4.0), pilot_for("onboard_pid", None, None)
    interrupts = iter((signal.SIGTERM, signal.SIGINT))
    in_the_air(world, 2.0, lambda: [os.kill(os.getpid(), which) for which in interrupts])
    with world.served() as uri:
        outcome = fly_session(Request(path, pilot, Limits(), uri, world, (), clock=world)).outcome
        assert (outcome.left, outcome.stop.rule) == (True, "interrupted")
    high = world.simulation.onboard.vehicle.true_pose()[0][2]
    sinks = []
    for _ in range(80):
        world.sleep_until(world.now() + 0.1)
        sinks.append(-world.simulation.onboard.vehicle.true_pose()[1][2])
    assert high > 0.8
    assert world.simulation.onboard.vehicle.true_pose()[0][2] < 0.05
    assert max(sinks) < 2.0  # it has no poses any more and sinks faster than it was told to; falling, it would be 4 m/s


def test_a_vehicle_flies_again_and_one_that_is_left_alone_falls_by_its_own_watchdog():
    world = VirtualWorld(served(), RadioOptions(), ROOM)
    path, pilot = chosen_path("circle", 0.5, 0.4, 4.0), pilot_for("onboard_pid", None, None)
    request = Request(path, pilot, Limits(), "", world, ())
    assert in_world(world, request).outcome.stop is None
    world.sleep_until(world.now() + 1.0)
    in_the_air(world, 2.0, lambda: setattr(world, "down", True))
    assert in_world(world, request).outcome.stop.rule == "lost link"
    world.sleep_until(world.now() + 3.0)
    onboard = world.simulation.onboard
    assert onboard.vehicle.true_pose()[0][2] < 0.05
    assert not onboard.supervisor.motors_allowed  # it fell from a metre: that is what this firmware does
