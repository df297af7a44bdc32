"""A campaign on the simulated vehicle, on its own clock, killed in the middle: flown to its end and compared."""

import dataclasses
import json

import pytest
from test_campaign import PLAN, written

from controllers.plants.served_vehicle import served
from nanobench_tools.cli.main import main
from nanobench_tools.radio.campaign import rest_voltage as rest
from nanobench_tools.radio.fly import session
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions
from nanobench_tools.sources.nanobench_writer import sheet_path

pytestmark = pytest.mark.slow

ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)
FULL_V, KILLED_AFTER = 4.15, 3


class Lab:
    """One vehicle, whose battery is exchanged when somebody asks for it; the program is killed after one flight, which
    was completed, before anything of it but the raw recording was on the disk."""

    def __init__(self) -> None:
        self.volts, self.flights, self.kill, self.killed = FULL_V, 0, True, ""
        self.fly, self.measure = session.fly_session, rest.rest_voltage

    def world(self) -> VirtualWorld:
        return VirtualWorld(served(battery_V=self.volts), RadioOptions(latency_s=0.010), ROOM)

    def rest_voltage(self, *_: object) -> float:
        world = self.world()
        with world.served() as uri:
            found = self.measure(uri, world)
        assert found == pytest.approx(self.volts, abs=0.005)  # a step of its converter
        return found

    def fly_session(self, request):
        world = self.world()
        with world.served() as uri:
            result = self.fly(dataclasses.replace(request, uri=uri, source=world, clock=world))
        self.volts -= 0.04
        self.flights += 1
        if self.kill and self.flights == KILLED_AFTER:
            self.kill, self.killed = False, result.recording.csv.name
            result.recording.csv.unlink()
            sheet_path(result.recording.csv).unlink()
            raise KeyboardInterrupt
        return result


def test_a_killed_campaign_goes_on_and_ends_in_the_comparison(tmp_path, monkeypatch, capsys):
    lab, out = Lab(), tmp_path / "fly.json"
    monkeypatch.setattr(session, "fly_session", lab.fly_session)
    monkeypatch.setattr(rest, "rest_voltage", lab.rest_voltage)
    folder = tmp_path / "flights"
    command = ["fly", "--campaign", str(written(tmp_path, PLAN.replace("= 3", "= 2"))), "--uri", "virtual://0",
               "--mocap", "simulated://127.0.0.1:1", "--record", str(folder), "--json", str(out)]
    assert main(command) == 130
    assert len(json.loads((folder / "campaign.json").read_text())["flights"]) == KILLED_AFTER - 1

    lab.volts = 4.0  # the last pair was begun at 4.07 V, and there is no terminal to ask for another battery
    assert main(command) == 2
    assert "needs 4.0" in capsys.readouterr().err
    lab.volts = 4.1
    assert main(command) == 0
    assert lab.flights == 4
    body = json.loads(out.read_text())
    assert [pair["matched"] for pair in body["pairs"]] == [True, True]
    assert lab.killed in {flight["csv"] for flight in body["flights"]}
    rows = {row["controller"]: row for row in body["control"]["rows"]}
    assert {name: row["n"] for name, row in rows.items()} == {"onboard_pid": 2, "geometric": 2}
    assert rows["geometric"]["metrics"]["rmse_m"] < 0.5 * rows["onboard_pid"]["metrics"]["rmse_m"]
    assert sum(pairs["n"] for pairs in body["control"]["voltage_pairs"]) >= 1  # by mean voltages in flight
