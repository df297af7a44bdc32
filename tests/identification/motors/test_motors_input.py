"""What cannot be used is said in one line; what a radio does to a command, by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from made_logs import MASS, ROW_S, flight, usd

from identification.motors import identify
from identification.motors.radio import averaged_rows, coarse_rows, sampled, thinned
from identification.motors.rotor_rows import read_log, read_logs
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError


def changed(log, **values):
    return {**log, **values}


BROKEN = {
    "no rpm stream": lambda log: flight(log).without_streams("rpm"),
    "no battery stream": lambda log: flight(log).without_streams("battery"),
    "and its PWM is off; the motor is dead": lambda log: flight(changed(
        log, u=log["u"] * [1, 0, 1, 1], speed=log["speed"] * [1, 0, 1, 1])),
    "its rotor speed was not measured": lambda log: flight(changed(log, speed=log["speed"] * [0.01, 1, 1, 1])),
    "is at rest on the ground": lambda log: flight(changed(log, rate=0.01 * log["rate"] / np.abs(log["rate"]).max(),
                                                       velocity=0.0 * log["velocity"])),
    "no rotor ever spins": lambda log: flight(changed(log, speed=0.0 * log["speed"])),
    "PWM never changes": lambda log: flight(changed(log, u=0.0 * log["u"] + 0.6)),
    "the battery voltage never changes (3.700 V)": lambda log: flight(changed(
        log, battery_V=0.0 * log["battery_V"] + 3.7)),
    "PWM logged at 100 Hz": lambda log: flight(log, row_s=0.01),
}


@pytest.mark.parametrize("says", BROKEN)
def test_one_line_for_each(logs, says):
    with pytest.raises(InputError) as error:
        read_log(BROKEN[says](logs[0]))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_one_flight_alone_and_copies(logs):
    with pytest.raises(InputError, match="one flight only"):
        identify([flight(logs[0])])
    _, reasons = read_logs([flight(logs[0], "a"), flight(logs[0], "b")])
    assert reasons == {"b": "copy of a"}


def test_two_vehicles_are_not_one(logs):
    other = flight(changed(logs[1], speed=0.8 * logs[1]["speed"]), "other")
    with pytest.raises(InputError, match="another vehicle"):
        identify([flight(logs[0], "one"), other])


def test_mass_in_grams(logs):
    with pytest.raises(InputError, match="grams"):
        identify([flight(log, str(i)) for i, log in enumerate(logs)], mass_kg=35.0)


def test_a_gap_ends_a_stretch(logs):
    made = flight(logs[0])
    late = {name: replace(s, time_s=s.time_s + 0.05 * (np.arange(len(s)) >= 1000)) for name, s in made.streams.items()}
    log = read_log(made.with_streams(**late))
    assert [b - a for a, b in log.stretches] == [1000, len(made["motor"]) - 1000]
    first = log.windows(100, 50, before=30)
    assert all(any(a <= f - 30 and f + 100 <= b for a, b in log.stretches) for f in first)


def test_radio_by_hand(logs):
    log = read_log(flight(logs[0]))
    assert coarse_rows(ROW_S) == 5
    first, rng = np.arange(100, 1500, 5), np.random.default_rng(1)
    assert np.array_equal(sampled(log, first, rng), log.u[first])
    assert np.allclose(averaged_rows(log, first, rng)[0], log.u[100:105].mean(axis=0))
    ramp = replace(log, u=np.repeat(np.linspace(0.2, 0.8, len(log.u))[:, None], 4, axis=1))
    assert np.abs(thinned(ramp, first, rng) - ramp.u[first]).max() < 2.0 * np.diff(ramp.u[:2, 0])[0]  # lines stay lines
    late = thinned(log, first, np.random.default_rng(1))
    assert np.array_equal(late, thinned(log, first, np.random.default_rng(1)))
    assert 0.001 < np.abs(late - log.u[first]).mean() < log.u.std()


@pytest.mark.slow
def test_the_verb(logs, few_inputs, tmp_path, capsys):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i, log in enumerate(logs[:2]):
        (folder / f"log{i}").write_bytes(usd(log))
    code = main(["motors", "--data", str(folder), "--mass", str(MASS), "--out", str(tmp_path / "out"), "--json",
                 str(tmp_path / "m.json")])
    said = capsys.readouterr()
    assert (code, "Traceback" in said.err) == (0, False)
    assert said.out.startswith("Motors: ")
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["schema"] == "nanobench-motors/1"
    assert {row["input"] for row in content["rows"]} == {"still", "radio", "logged", "rpm"}
    assert content["lag"]["tau_up_s"] == pytest.approx(0.05, abs=0.002)
    page = (tmp_path / "out" / "motors.html").read_text()
    assert "Motors from measured rotor speed" in page
    assert 'name = "motor_lag"' in (tmp_path / "out" / "simulator.toml").read_text()


@pytest.mark.parametrize(("arguments", "says"), [
    (["--mass", "35"], "is it in grams?"), (["--train", "x"], "--train and --test go together")])
def test_bad_usage(arguments, says, capsys):
    assert main(["motors", *arguments]) == 2
    found = capsys.readouterr().err
    assert says in found
    assert found.count("\n") == 1


def test_a_single_log_is_one_line(logs, tmp_path, capsys):
    (tmp_path / "log").write_bytes(usd(logs[0]))
    assert main(["motors", "--data", str(tmp_path), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "one flight only" in said
    assert said.count("\n") == 1


@pytest.mark.slow
def test_progress_counts_the_fits(study, reported):
    assert [done for done, _ in reported] == list(range(1, len(reported) + 1))
    assert {total for _, total in reported} == {len(reported)}
