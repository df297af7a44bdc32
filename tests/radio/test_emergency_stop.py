"""Somebody can always stop the motors: a second Ctrl-C, the space bar; and the vehicle is disarmed after every end."""

import os
import signal
import socket
import threading
import time

import pytest
from toy_vehicle import Notes, Toy

from nanobench_tools.cli.flights import flight_requests as cli_requests
from nanobench_tools.cli.main import main
from nanobench_tools.errors import UsageError
from nanobench_tools.radio.fly.flight_ending import STOP_S
from nanobench_tools.radio.fly.keys import space_stops
from nanobench_tools.radio.fly.mission import Flight
from nanobench_tools.radio.fly.pilot import OnboardPilot
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.stop_socket import listening, path_of, remove_stale, request_stop

pytestmark = pytest.mark.usefixtures("short_phases")
IN_PATH = 105.0


def flight(toy: Toy) -> tuple[Flight, Notes]:
    notes = Notes()
    return Flight(toy, toy.track, OnboardPilot("pid", 1), toy.ready(), Limits(), toy, (notes,)), notes


def times(toy: Toy, what: str) -> list[float]:
    return [when for when, said in toy.told if said == what]


def press(toy: Toy, again_s: float) -> None:
    for after in (0.0, again_s):
        toy.at.append((IN_PATH + after, lambda: os.kill(os.getpid(), signal.SIGINT)))


def test_a_second_ctrl_c_stops_the_motors_until_the_vehicle_says_so():
    toy = Toy()
    press(toy, 0.3)
    flown, _ = flight(toy)
    outcome = flown.run()
    assert outcome.stop.rule == "emergency stop"
    assert "Ctrl-C twice; the vehicle reports that it is locked" in outcome.stop.reason
    assert times(toy, "emergency stop")[0] < IN_PATH + 0.35
    assert not toy.motors


def test_it_is_repeated_while_the_vehicle_does_not_acknowledge_it():
    toy = Toy()
    toy.deaf = True
    press(toy, 0.3)
    toy.at.append((IN_PATH + 1.3, lambda: setattr(toy, "deaf", False)))
    flown, _ = flight(toy)
    outcome = flown.run()
    assert 40 < len(times(toy, "emergency stop")) < 60
    assert not toy.motors
    assert "reports that it is locked" in outcome.stop.reason


def test_a_vehicle_that_never_acknowledges_it_is_reported_so():
    toy = Toy()
    toy.deaf = True
    press(toy, 0.3)
    outcome = flight(toy)[0].run()
    assert "did not acknowledge it" in outcome.stop.reason
    assert times(toy, "emergency stop")[-1] - times(toy, "emergency stop")[0] > STOP_S - 0.1


def test_one_ctrl_c_and_a_termination_leave_the_landing_to_the_vehicle():
    toy = Toy()
    toy.at.append((IN_PATH, lambda: os.kill(os.getpid(), signal.SIGTERM)))
    toy.at.append((IN_PATH + 0.3, lambda: os.kill(os.getpid(), signal.SIGINT)))
    assert flight(toy)[0].run().left
    assert not times(toy, "emergency stop")


def test_the_space_bar_stops_the_motors():
    from pty import openpty

    toy = Toy()
    flown, _ = flight(toy)
    ours, terminal = openpty()

    def press_space() -> None:
        os.write(ours, b"x ")
        until = time.monotonic() + 600.0
        while time.monotonic() < until:
            time.sleep(0.01)  # the flight's thread is woken here

    toy.at.append((IN_PATH, press_space))
    with space_stops(lambda: flown.interrupts.stop("space bar"), terminal):
        outcome = flown.run()
    assert outcome.stop.rule == "emergency stop"
    assert outcome.stop.reason.startswith("space bar")
    assert not toy.motors


def test_without_a_terminal_there_is_no_key():
    with open(os.devnull) as nowhere, space_stops(lambda: None, nowhere.fileno()):
        pass


@pytest.mark.parametrize("ends_early", [False, True])
def test_the_vehicle_is_disarmed_after_every_end_on_the_ground(ends_early):
    toy = Toy()
    if ends_early:
        toy.at.append((IN_PATH, lambda: os.kill(os.getpid(), signal.SIGINT)))
    outcome = flight(toy)[0].run()
    assert (outcome.stop is not None) == ends_early
    assert toy.told[-1][1] == "arm False"


class Typed:
    """stdin with a line."""

    def __init__(self, text: str, tty: bool) -> None:
        self._lines, self.isatty = iter(text.splitlines(True)), lambda: tty

    def readline(self, *_: object) -> str:
        return next(self._lines, "")


RADIO = "radio://0/80/2M/E7E7E7E7E7"


def test_a_real_vehicle_is_armed_only_after_a_key(monkeypatch):
    monkeypatch.setattr("sys.stdin", Typed("\n", True))
    cli_requests.confirmation(RADIO, False, False)(Toy().ready())
    monkeypatch.setattr("sys.stdin", Typed("", True))
    with pytest.raises(UsageError, match="not armed"):
        cli_requests.confirmation(RADIO, False, False)(Toy().ready())


def test_a_script_needs_yes_for_a_real_vehicle_and_not_for_a_simulated_one(monkeypatch):
    monkeypatch.setattr("sys.stdin", Typed("", False))
    with pytest.raises(UsageError, match="give --yes"):
        cli_requests.confirmation(RADIO, False, False)
    cli_requests.confirmation(RADIO, False, True)(Toy().ready())
    cli_requests.confirmation("udp://127.0.0.1:19850", True, False)(Toy().ready())


def test_nanobench_stop_from_another_terminal_stops_the_motors(capsys):
    toy = Toy()
    flown, _ = flight(toy)

    def other_terminal() -> None:
        threading.Thread(target=lambda: main(["stop", "udp://127.0.0.1:1", "--quiet"]), daemon=True).start()
        until = time.monotonic() + 600.0
        while time.monotonic() < until:
            time.sleep(0.01)  # the flight's thread is woken here

    toy.at.append((IN_PATH, other_terminal))
    with listening("udp://127.0.0.1:1", lambda: flown.interrupts.stop("nanobench stop")):
        outcome = flown.run()
    assert outcome.stop.reason.startswith("nanobench stop; ")
    assert not toy.motors
    assert not request_stop("udp://127.0.0.1:1")


def test_looking_for_a_flight_stops_none_and_removes_only_what_a_killed_one_left():
    uri, stops = "udp://127.0.0.1:2", []
    with listening(uri, lambda: stops.append("stop")):
        remove_stale(uri)
        assert path_of(uri).exists()
        assert request_stop(uri)
    assert stops == ["stop"]
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as killed:
        killed.bind(str(path_of(uri)))
    remove_stale(uri)
    assert not path_of(uri).exists()


def test_a_stop_that_nothing_answers_is_an_error(capsys, monkeypatch):
    monkeypatch.setattr("nanobench_tools.radio.fly.companion.STOP_S", 0.2)
    assert main(["stop", "udp://127.0.0.1:9"]) == 2
    assert "nothing answered" in capsys.readouterr().err
