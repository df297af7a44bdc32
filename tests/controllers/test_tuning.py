"""Gains: what may be set, the search against a known minimum, and that better is said only when it is shown."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import nanobench_tools as nb
from controllers import gains as of_gains
from controllers.gains import Gain, around, read_gains
from controllers.plants.ensemble import shipped_simulator
from controllers.plants.simulated_flights import made
from controllers.tuning import LOST_M, SHORT, Flown, Trial, compared, logs, objective, search, shortlist
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.physics.simulator import loads
from nanobench_tools.steps import gain_search
from nanobench_tools.steps.options import Options

MODEL = loads(shipped_simulator())
TUNED = ("geometric", "lqr", "lead_pid", "mellinger_full", "mpc_daqp", "mpc_osqp", "nmpc")


@pytest.mark.parametrize("name", TUNED)
@pytest.mark.slow
def test_gains_as_they_are_make_the_same_controller(name):
    plain = made(name, MODEL)
    same = made(name, MODEL, gains={key: gain.value for key, gain in plain.tunable.items()})
    for what in ("parameters", "_gain", "q", "r"):
        if hasattr(plain, what):
            one, other = getattr(plain, what), getattr(same, what)
            for field in one.dtype.names or [...]:
                np.testing.assert_allclose(other[field], one[field])
    assert all(gain.low < gain.value < gain.high for gain in plain.tunable.values())


def test_what_cannot_be_set_is_one_line():
    with pytest.raises(UsageError, match="has no gains to set"):
        made("onboard_pid", MODEL, gains={})
    with pytest.raises(UsageError, match="has no gain 'speed'"):
        made("lqr", MODEL, gains={"speed": 1.0})
    with pytest.raises(UsageError, match="above 0"):
        made("lead_pid", MODEL, gains={"lead_s": -1.0})


def test_gains_are_read_as_they_were_written(tmp_path):
    tunable = {"a": around(2.0, "1/s"), "b": Gain(0.5, 0.1, 0.9)}
    path = tmp_path / "gains.toml"
    path.write_text(of_gains.dumps("mine:Class", {"a": 1.25, "b": 0.3}, tunable, {"better": True, "ci95": [0.8, 0.9],
                                                                               "words": 'a "b" \\'}))
    assert read_gains(path) == ("mine:Class", {"a": 1.25, "b": 0.3})
    for text in ("x =", 'schema = "other"', 'schema = "nanobench-gains/1"\ncontroller = "lqr"\n[gains]\na = "b"'):
        path.write_text(text)
        with pytest.raises(InputError):
            read_gains(path)


def test_the_search_finds_a_known_minimum_and_goes_on_where_it_was():
    tunable, goal = {"a": around(1.0, "1"), "b": around(10.0, "1")}, {"a": 2.0, "b": 6.0}

    def run(many):
        return [float(sum(np.log(gains[key] / goal[key])**2 for key in goal)) for gains in many]

    trials = search(tunable, run, 80, seed=3)
    best = min(trials, key=lambda trial: trial.objective).gains
    assert len(trials) == 80
    assert trials[0].gains == {"a": 1.0, "b": 10.0}
    for key, value in goal.items():
        assert best[key] == pytest.approx(value, rel=0.1)
    again = search(tunable, run, 40, seed=3)
    assert [t.gains for t in again] == [t.gains for t in trials[:40]]  # kept trials are found again


def flown(rmse_m, lost):
    return Flown(rmse_m, rmse_m, lost)


def test_the_worst_quarter_counts_twice_and_a_lost_vehicle_is_among_it():
    kept = flown([[0.1, 0.2], [0.3, 0.4]], [[False, False], [False, False]])
    assert objective(kept) == pytest.approx(0.5 * (np.log(0.1 * 0.2 * 0.3 * 0.4) / 4.0 + np.log(0.4)))
    lost = flown([[0.05, 0.1], [0.15, 9.0]], [[False, False], [False, True]])
    assert logs(lost).mean() < logs(kept).mean() + 0.1  # hardly worse in the mean
    assert objective(lost) > objective(kept) + 1.0


def test_the_gains_as_they_were_are_always_among_those_that_fly_on_other_plants():
    trials = [Trial({"a": float(k)}, value) for k, value in enumerate((2.0, 1.0, 3.0, 0.5, 1.5, 1.2, 1.1, 2.0))]
    assert [gains["a"] for gains in shortlist(trials)] == [0.0, 3.0, 1.0, 6.0, 5.0]
    assert len(shortlist(trials)) == 1 + SHORT
    assert shortlist([trials[1], trials[0], trials[2]]) == [{"a": 1.0}]  # nothing better was found


def judged(factor, spread, lost=0):
    rng = np.random.default_rng(1)
    rmse = 0.1 * np.exp(0.3 * rng.standard_normal((6, 8)))
    after = rmse * factor * np.exp(spread * rng.standard_normal((6, 8)))
    none = np.zeros((6, 8), bool)
    gone = none.copy()
    gone[0, :lost] = True
    return compared(flown(rmse.tolist(), none.tolist()), flown(after.tolist(), gone.tolist()))


def test_better_is_said_only_when_the_interval_says_so():
    assert judged(0.8, 0.1).better
    assert judged(0.8, 0.1).ci95[1] < 0.9
    assert not judged(1.0, 0.3).better
    assert not judged(0.5, 0.1, lost=1).better  # nothing makes up for a lost vehicle
    assert logs(flown([[0.1, 50.0, None]], [[True, False, False]]))[0] == pytest.approx(np.log(LOST_M))


@pytest.mark.slow
def test_tune_writes_gains_that_control_flies(tmp_path, capsys):
    arguments = ["--trajectory", "circle", "--speed", "0.5", "--seconds", "7", "--jobs", "1", "--plants", "2"]
    code = main(["tune", "--controller", "lead_pid", "--judge", "oval", *arguments, "--budget", "2", "--out",
                 str(tmp_path)])
    text = capsys.readouterr()
    assert code == 0, text.err
    result = json.loads((tmp_path / "tune.json").read_text())
    assert len(result["trials"]) == 2
    assert result["verdict"]["judged"] == ["oval"]
    assert result["choices"][0]["gains"] == result["before"] == result["trials"][0]["gains"]
    assert min(result["choices"], key=lambda choice: choice["objective"])["gains"] == result["gains"]
    assert result["verdict"]["as_they_were"] == (result["gains"] == result["before"])
    assert result["verdict"]["better"] == ("tuned is better" in text.out)
    name, gains = read_gains(tmp_path / "gains_lead_pid.toml")
    assert name == "lead_pid"
    assert gains == pytest.approx(result["gains"], rel=1e-4)
    out = tmp_path / "flown"
    code = main(["control", "--plant", "simulated", "--controller", "lead_pid", *arguments, "--gains",
                 str(tmp_path / "gains_lead_pid.toml"), "--radio-delay-s", "0.02", "--wind", "1", "--out", str(out)])
    assert code == 0, capsys.readouterr().err
    found = json.loads((out / "control.json").read_text())
    assert [row["controller"] for row in found["rows"]] == ["lead_pid", "lead_pid tuned"]
    assert [(row["radio_delay_s"], row["wind_m_s"]) for row in found["rows"]] == [(0.02, 1.0)] * 2
    assert len(found["flights"]) == 2


def test_nb_tune_shows_medians_of_the_judging_flights(monkeypatch):
    flights = iter([flown([[0.3, 0.1, 0.2]], [[False] * 3]), flown([[0.2, 0.1, 0.1]], [[False, True, False]])])
    monkeypatch.setattr(Options, "run", lambda self, items, title: SimpleNamespace(values={
        item.key: next(flights) if title == "judge" else flown([[0.1]], [[False]]) for item in items}))
    monkeypatch.setattr(gain_search, "_searched", lambda *_: [Trial({"lead_s": 0.1}, 1.0)])
    found = nb.tune("lead_pid", trajectory=["circle"], judge=["oval"], speed=[0.5])
    row, = found.table.to_dict("records")
    assert row == {"reference": "oval", "speed_m_s": 0.5, "rmse_before_m": 0.2, "rmse_after_m": 0.1, "lost_before": 0,
                   "lost_after": 1}
    assert found.gains == {"lead_s": 0.1}
    assert repr(found) == found.sentence
    assert "1 flights lost before" not in found.sentence


@pytest.mark.parametrize(("call", "words"), [
    (lambda: nb.tune("onboard_pid"), "has no gains to tune"),
    (lambda: nb.tune("lqr", trajectory=["circle"], judge=["circle"]), "judge circle: a family that was searched on"),
    (lambda: nb.tune("lqr", "no_such.toml"), "no_such.toml: cannot be read"),
])
def test_wrong_searches_from_python_are_one_line(call, words):
    with pytest.raises(nb.NanobenchError) as told:
        call()
    assert words in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(("arguments", "words"), [
    (["--controller", "onboard_pid"], "has no gains to tune"),
    (["--controller", "no_such"], "unknown controller 'no_such'"),
    (["--controller", "lqr", "--trajectory", "circle", "--judge", "circle"], "that was searched on cannot judge")])
def test_wrong_searches_are_one_line(arguments, words, capsys):
    assert main(["tune", *arguments]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
