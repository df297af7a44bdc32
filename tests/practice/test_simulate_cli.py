"""``nanobench simulate`` in process."""

import json

import numpy as np
import pytest

from nanobench_tools import InputError
from nanobench_tools.cli.main import main
from nanobench_tools.cli.new import STARTERS
from nanobench_tools.practice import fly, path_spec
from nanobench_tools.practice.timeline import Events
from nanobench_tools.sources.discover import load_recordings


def test_it_writes_recordings_marked_synthetic(tmp_path, capsys):
    out = tmp_path / "practice"
    assert main(["simulate", "--out", str(out), "--flights", "1", "--seed", "4", "--trajectory", "oval", "--speed",
                 "fast", "--controller", "onboard_mellinger", "--seconds", "1", "--wander-ms", "20", "--suffix",
                 ".csv.gz", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["synthetic"] is True
    assert [(out / name).exists() for name in result["files"]] == [True]
    sheet = result["files"][0].removesuffix(".csv.gz") + "_metadata.yaml"
    assert "synthetic: true" in (out / sheet).read_text()
    loaded = load_recordings([out], cache=False)
    assert not loaded.failed
    flight = loaded.flights[0]
    assert flight.provenance.synthetic
    assert (flight.metadata["family"], flight.metadata["speed"]) == ("oval", "fast")
    assert flight.metadata["practice"]["clock_wander_sd_s"] == 0.02
    assert flight.metadata["practice"]["controller"] == "mellinger"


@pytest.mark.slow
def test_flights_of_an_own_controller_are_scored_under_its_name(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))
    (tmp_path / "own_controller.py").write_text((STARTERS / "own_controller.py.txt").read_text())
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / "flown"
    assert main(["simulate", "--controller", "own_controller:TiltAndTurn", "--flights", "1", "--trajectory", "trefoil",
                 "--speed", "medium", "--seconds", "8", "--out", str(out)]) == 0
    flight = load_recordings([out], cache=False).flights[0]
    assert flight.metadata["controller"] == "tilt_and_turn"
    assert "pid" not in flight
    assert main(["control", "--data", str(out), "--json", str(tmp_path / "c.json"), "--jobs", "1"]) == 0
    rows = json.loads((tmp_path / "c.json").read_text())["rows"]
    assert [(row["protocol"], row["controller"]) for row in rows] == [("clean", "tilt_and_turn")]
    assert "tilt_and_turn" in capsys.readouterr().out
    assert main(["control", "--data", str(out), "--controller", "tilt_and_turn", "--jobs", "1", "--json",
                 str(tmp_path / "d.json")]) == 0
    assert json.loads((tmp_path / "d.json").read_text())["rows"] == rows
    capsys.readouterr()
    assert main(["control", "--data", str(out), "--controller", "onboard_pid", "--jobs", "1", "--quiet"]) == 2
    assert capsys.readouterr().err.endswith("of these recordings: 'onboard_pid'; known: tilt_and_turn\n")


@pytest.mark.parametrize("name", ["pid", "mellinger", "none", "unknown"])
def test_an_own_controller_is_not_called_like_what_the_audit_says(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / f"mine_{name}.py").write_text(
        "from nanobench_tools.practice.onboard_crowd import PidCascade\n\n\n"
        f"class Mine(PidCascade):\n    name = {name!r}\n")
    assert main(["simulate", "--controller", f"mine_{name}:Mine", "--flights", "1", "--out", "flown"]) == 2
    err = capsys.readouterr().err
    assert f"mine_{name}:Mine is called {name!r}" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "flown").exists()


class Odd:
    """Asks for ``value`` from 0.1 s on."""

    name, information, period_s = "odd", "as flown", 0.01

    def __init__(self, value):
        self.value = value

    def reset(self, n):
        self.n = n

    def command(self, time_s, state, reference):
        command = np.full((self.n, 4), 0.25)
        command[-1, 2] = self.value if time_s > 0.099 else 0.25
        return command


@pytest.mark.parametrize(("value", "shown"), [(np.nan, "nan"), (-np.inf, "-inf"), (1e9, "1e+09"), (-1e-3, "-0.001")])
def test_a_command_that_motors_cannot_obey_is_refused(value, shown):
    specs = [path_spec("circle", "slow", duration_s=1.0)] * 2
    with pytest.raises(InputError) as error:
        fly(Odd(value), specs)
    assert str(error.value).startswith(f"controller 'odd': commanded 0.25, 0.25, {shown}, 0.25 at 0.100 s for vehicle "
                                       "1; ")


def test_rounding_beyond_the_range_is_cut_off():
    specs, short = [path_spec("circle", "slow", duration_s=1.0)], [Events(0.4, 1.6, 2.6, 3.0, 3.4)]
    flown = fly(Odd(1.0 + 1e-9), specs, events=short)
    assert flown.truth["motor"].max() <= 1.0


@pytest.mark.parametrize(("arguments", "says"), [
    (["--flights", "1"], "--out DIR is needed"),
    (["--out", "x", "--trajectory", "spiral"], "unknown trajectory 'spiral'; known: circle"),
    (["--out", "x", "--controller", "indi"], "unknown controller 'indi'; known: geometric"),
    (["--out", "x", "--flights", "0"], "--flights")])
def test_bad_usage_is_one_line_and_exit_2(arguments, says, capsys):
    assert main(["simulate", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
