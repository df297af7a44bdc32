"""A radio that is silent at times: how much, what waits, and that vehicles bear it."""

import json

import numpy as np
import pytest

from controllers.plants.ensemble import draw, shipped_simulator
from controllers.plants.radio_silence import LONGER_S, SHORTEST_S, Waiting, heard, silence
from controllers.plants.simulated_flights import flown, made
from nanobench_tools.cli.main import main
from nanobench_tools.methods import Reference
from nanobench_tools.physics.simulator import loads
from nanobench_tools.protocols.simulated import HOVER_S, Paths, specs_of

TICKS = 100_000


def rngs(n):
    return [np.random.default_rng(i) for i in range(n)]


@pytest.mark.parametrize("share", [0.0, 0.02, 0.08, 0.4])
def test_it_is_silent_for_the_share_asked_for_in_gaps_as_recorded(share):
    found = silence(rngs(4), TICKS, share)
    assert found.mean() == pytest.approx(share, rel=0.1)
    if share:
        begins = np.diff(found[:, 0].astype(int)) == 1
        assert found[:, 0].sum() / begins.sum() * 0.01 == pytest.approx(SHORTEST_S + LONGER_S, rel=0.15)
        assert np.array_equal(silence(rngs(3), TICKS, share), found[:, :3])  # each the same in any company


@pytest.mark.parametrize("share", [-0.1, 1.0, np.nan])
def test_no_radio_is_silent_for_less_than_none_or_all_of_the_time(share):
    with pytest.raises(ValueError, match="silent for"):
        silence(rngs(1), 10, share)


class Counting:
    name, information, period_s = "counting", "preview", 0.01

    def reset(self, n):
        self.n = n

    def command(self, time_s, state, reference):
        return np.full((self.n, 4), time_s)


def test_commands_wait_and_the_last_that_was_heard_goes_on():
    silent = np.zeros((6, 2), bool)
    silent[2:4, 1] = True
    waiting = Waiting(Counting(), silent)
    waiting.reset(2)
    given = np.array([waiting.command(0.01 * k, None, None)[:, 0] for k in range(8)])
    assert np.allclose(given[:, 0], 0.01 * np.arange(8))
    assert np.allclose(given[:, 1], 0.01 * np.array([0, 1, 1, 1, 4, 5, 6, 7]))


def test_what_a_vehicle_is_told_waits_but_not_what_it_knows_of_the_future():
    def told(tick):
        where = np.full((2, 3), float(tick))
        return Reference(where, where[:, 0], where, where, ahead=lambda s: tick)

    silent = np.zeros((5, 2), bool)
    silent[1:3, 0] = True
    at = heard(told, silent)
    found = [at(k) for k in range(5)]
    assert [r.position_m[0, 2] for r in found] == [0, 0, 0, 3, 4]
    assert [r.yaw_rad[1] for r in found] == [0, 1, 2, 3, 4]
    assert [r.ahead(None) for r in found] == [0, 1, 2, 3, 4]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mpc_daqp", "onboard_pid"])
def test_a_vehicle_flies_on_over_the_worst_recorded_radio(name):
    """Silent for 11 % of the time: further from its path than over a good radio, and not lost."""
    paths = Paths(tuple(specs_of(["circle"], [0.5], 6.0)))
    ensemble = draw(shipped_simulator(), 2, 3)
    off = []
    for share in (0.0, 0.11):
        flight = flown(made(name, loads(shipped_simulator())), paths, ensemble, silent=share)
        asked = paths.all[0][:len(flight.time_s), 0]
        off.append(np.linalg.norm(flight.position_m - asked[:, None], axis=2)[round((HOVER_S + 2) / 0.01):])
    assert off[1].max() < 0.6
    assert not np.allclose(off[0], off[1])
    if name == "mpc_daqp":
        assert np.sqrt((off[0]**2).mean()) < 0.02
        assert np.sqrt((off[1]**2).mean()) < 0.08


@pytest.mark.slow
def test_the_verb_says_how_silent_the_radio_was(tmp_path, capsys):
    out = tmp_path / "r.json"
    flight = ["--controller", "onboard_pid", "--trajectory", "hover_until_landing", "--seconds", "7.5", "--plants", "1"]
    radio = ["--radio-silent", "8"]
    assert main(["control", "--plant", "simulated", *flight, *radio, "--json", str(out), "--jobs", "1"]) == 0
    assert "radio silent 8 %" in " ".join(capsys.readouterr().out.split())
    assert json.loads(out.read_text())["rows"][0]["radio_silent_percent"] == 8.0
    assert main(["control", "--plant", "simulated", "--radio-silent", "80"]) == 2
    assert "0.0<=x<=50.0" in capsys.readouterr().err
