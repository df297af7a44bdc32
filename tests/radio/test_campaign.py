"""A campaign chooses flights by battery voltage; after an interruption no flight is repeated or lost."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from toy_vehicle import Toy

from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError
from nanobench_tools.radio.campaign.campaign_plan import FlightId, read_campaign
from nanobench_tools.radio.campaign.campaign_run import check_window, fly_campaign
from nanobench_tools.radio.campaign.campaign_state import STATE, opened
from nanobench_tools.radio.campaign.next_flight import Window, matches, needed, next_flight
from nanobench_tools.radio.fly.outcome import Outcome
from nanobench_tools.radio.fly.safety import Stop
from nanobench_tools.radio.recorder import check_folder

PLAN = """
repeats = 3
[[controller]]
name = "onboard_pid"
[[controller]]
name = "geometric"
[[path]]
trajectory = "figure_eight"
speed = 1.0
seconds = 6
"""
PID, GEOMETRIC = "onboard_pid", "geometric"


def written(folder: Path, text: str = PLAN) -> Path:
    path = folder / "plan.toml"
    path.write_text(text)
    return path


@pytest.fixture
def plan(tmp_path):
    return read_campaign(written(tmp_path))


def test_the_controller_that_begins_alternates(plan):
    assert [flight.controller for flight in plan.flights] == [PID, GEOMETRIC, GEOMETRIC, PID, PID, GEOMETRIC]


def test_a_begun_pair_is_completed_only_at_its_voltage(plan):
    """By hand: 4.10 V was flown, so that 4.05 to 4.15 V complete the pair, and others open the next one."""
    flown = {FlightId(1, 1, PID): 4.10}
    for volts, pair in ((4.05, 1), (4.15, 1), (4.04, 2), (4.16, 2)):
        assert next_flight(plan, flown, volts).flight == FlightId(1, pair, GEOMETRIC)


def test_a_battery_is_asked_for_when_no_pair_can_be_opened(plan):
    flown = {FlightId(1, 1, PID): 4.10, FlightId(1, 2, GEOMETRIC): 4.00, FlightId(1, 3, PID): 3.90}
    assert next_flight(plan, flown, 3.80) is None
    assert "pair 3" in needed(plan, flown, 3.80)
    assert "3.85 to 3.95 V: charge it" in needed(plan, flown, 3.80)
    assert "less full" in needed(plan, flown, 4.20)


def test_all_flights_of_a_pair_are_within_the_limit_of_each_other(tmp_path):
    three = read_campaign(written(tmp_path, PLAN + '[[controller]]\nname = "lqr"\n'))
    flown = {FlightId(1, 1, PID): 4.10, FlightId(1, 1, GEOMETRIC): 4.06}
    assert not next_flight(three, flown, 4.12).low_V  # 4.12 is 60 mV from the second: it opens the next pair
    flown[FlightId(1, 1, "lqr")] = 4.08
    (_, apart, matched), = matches(three, flown)
    assert (apart, matched) == (pytest.approx(0.04), True)


def test_a_voltage_that_moved_since_it_was_measured_is_refused_before_arming():
    ready = Toy().ready()
    assert ready.battery_V != ready.battery_V  # not known
    with pytest.raises(InputError, match="not armed"):
        check_window(Window(FlightId(1, 1, PID), 4.0, 4.1), SimpleNamespace(battery_V=4.11))
    check_window(Window(FlightId(1, 1, PID), 4.0, 4.1), SimpleNamespace(battery_V=4.1))


class Bench:
    """A vehicle whose battery falls by ``drop_V`` a flight, and is charged when asked. ``fails``: number of the flight
    that lands early; ``killed``: of the one after which the program ends before the state is written."""

    def __init__(self, folder: Path, drop_V: float = 0.06, fails: int = -1, killed: int = -1) -> None:
        self.folder, self.drop_V, self.fails, self.killed = folder, drop_V, fails, killed
        self.volts, self.flown, self.charged = 4.15, [], 0

    def fly(self, window: Window):
        number = len(self.flown)
        self.flown.append(window.flight)
        csv = self.folder / f"{number:02d}_{self.volts:.2f}.csv"
        csv.touch()
        result = SimpleNamespace(outcome=Outcome(), ready=SimpleNamespace(battery_V=self.volts),
                                 recording=SimpleNamespace(csv=csv))
        self.volts -= self.drop_V
        if number == self.killed:
            raise KeyboardInterrupt
        if number == self.fails:
            result.outcome.stop = Stop("geofence", "too far", 1.0, "path")
        return result

    def charge(self, text: str) -> None:
        assert "charge it" in text
        self.charged += 1
        self.volts = 4.15

    def run(self, plan):
        check_folder(self.folder)
        with opened(self.folder, plan, lambda text: None) as state:
            return fly_campaign(state, lambda: self.volts, self.fly, self.charge, lambda text: None), state


def test_a_battery_that_empties_opens_pairs_and_the_next_one_completes_them(plan, tmp_path):
    bench = Bench(tmp_path / "flights")
    stop, state = bench.run(plan)
    assert stop is None
    assert sorted(bench.flown) == sorted(plan.flights)
    assert bench.charged == 1
    assert [matched for *_, matched in matches(plan, state.flown_V)] == [True] * 3


def test_a_flight_that_landed_early_is_flown_again_and_its_recording_does_not_count(plan, tmp_path):
    bench = Bench(tmp_path / "flights", 0.0, fails=2)
    stop, state = bench.run(plan)
    assert stop.rule == "geofence"
    assert (len(state.done), state.ended_early) == (2, ["02_4.15.csv"])
    stop, state = bench.run(plan)
    assert stop is None
    assert bench.flown == [*plan.flights[:3], *plan.flights[2:]]
    assert "02_4.15.csv" not in {path.name for path in state.recordings}


def test_no_flight_is_repeated_after_the_program_ended_between_two_flights(plan, tmp_path):
    bench = Bench(tmp_path / "flights", 0.0, killed=3)
    with pytest.raises(KeyboardInterrupt):
        bench.run(plan)
    kept = json.loads((tmp_path / "flights" / STATE).read_text())["flights"]
    assert len(kept) == 3
    _, state = bench.run(plan)
    assert bench.flown == [*plan.flights[:4], *plan.flights[3:]]  # the one that was not completed, and only that
    assert len(state.recordings) == len(plan.flights)


def test_the_state_of_another_plan_is_refused_and_a_missing_recording_named(plan, tmp_path):
    folder = tmp_path / "flights"
    bench = Bench(folder, 0.0)
    bench.run(plan)
    other = read_campaign(written(tmp_path, PLAN.replace("1.0", "0.9")))
    with pytest.raises(InputError, match="another plan"), opened(folder, other, print):
        pass
    (folder / "01_4.15.csv").unlink()
    with pytest.raises(InputError, match=r"01_4\.15\.csv: this recording is missing"), opened(folder, plan, print):
        pass


def test_two_programs_do_not_fly_one_campaign(plan, tmp_path):
    check_folder(tmp_path)
    with opened(tmp_path, plan, print), pytest.raises(InputError, match="another program"), \
            opened(tmp_path, plan, print):
        pass


@pytest.mark.parametrize(("change", "said"), [
    (("repeats = 3", "repeat = 3"), "did you mean 'repeats'?"),
    (("repeats = 3", "repeats = 0"), "from 1 to 1000"),
    (("repeats = 3", "repeats = 2.5"), "whole number"),
    (("speed = 1.0", "speed = true"), "speed = True; give a number"),
    (("speed = 1.0", "pace = 1.0"), "unknown key 'pace'"),
    (('"geometric"', '"onboard_pid"'), "there twice"),
    (('"geometric"', '"geometrik"'), "did you mean 'geometric'?"),
    (('name = "geometric"', 'name = "geometric"\nsimulator = "no.toml"'), "there is no such file"),
    (('[[controller]]\nname = "geometric"', ""), "give at least two"),
    (("[[path]]", "[path]"), "write [[path]]"),
    (("[[path]]", "[[path"), "is not TOML"),
    (("figure_eight", "figure_nine"), "did you mean 'figure_eight'?"),
    (("seconds = 6", "seconds = 6\nsize = 9"), "beyond the fence"),
])
def test_a_mistake_in_the_plan_is_one_line(change, said, tmp_path, capsys):
    path = written(tmp_path, PLAN.replace(*change))
    command = ["fly", "--campaign", str(path), "--uri", "udp://127.0.0.1:1", "--mocap", "simulated", "--record",
               str(tmp_path / "flights")]
    assert main(command) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(("more", "said"), [
    (["--controller", "lqr"], "--controller does not go with --campaign"),
    (["--dry-run"], "--dry-run does not go"),
    ([], "needs --uri URI, --mocap SOURCE and --record DIR"),
])
def test_options_that_do_not_go_with_a_campaign(more, said, tmp_path, capsys):
    assert main(["fly", "--campaign", str(written(tmp_path)), *more]) == 2
    assert said in capsys.readouterr().err
