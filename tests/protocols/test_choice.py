"""The best model of Task 1 is chosen on training flights: what test flights say changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight, verdict

from identification.naive import Naive
from nanobench_tools.cli.sysid import sysid_body
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols import choice
from nanobench_tools.protocols.task1 import WindowErrors
from nanobench_tools.steps.options import Options


def score(windows, *sums):
    return WindowErrors(windows, {name: [value] * 2 for name, value in zip(QUANTITIES, sums, strict=True)})


def test_every_flight_is_held_out_once_and_never_fitted_then():
    cases = list("abcdefghijk")
    parts = choice.held_out(cases)
    assert len(parts) == choice.GROUPS
    assert sorted(x for _, out in parts for x in out) == cases
    assert all(sorted([*rest, *out]) == cases for rest, out in parts)
    assert choice.held_out(cases[:2]) == [(["b"], ["a"]), (["a"], ["b"])]
    assert choice.held_out(cases[:1]) == [(["a"], ["a"])]


def test_the_criterion_pools_windows_and_is_a_geometric_mean():
    found = choice.criterion([score(1, 1.0, 2.0, 3.0, 4.0), score(3, 3.0, 2.0, 1.0, 8.0)])
    by_hand = (2 * (1 + 3) / 4 * (2 * (2 + 2) / 4) * (2 * (3 + 1) / 4) * (2 * (4 + 8) / 4)) ** 0.25
    assert found == pytest.approx(by_hand)
    assert choice.criterion([score(0, 0.0, 0.0, 0.0, 0.0)]) is None


def test_a_model_that_could_not_be_scored_is_never_the_best():
    assert choice.best_of({"a": 2.0, "b": 1.0, "c": None}) == "b"
    assert choice.best_of({"c": None}) is None


class Drifts(Naive):
    """Better than standing still on batteries above ``full_V``, worse below."""

    name = "drifts"
    full_V = 0.0

    def predict(self, windows):
        found = super().predict(windows)
        step = 0.01 * np.arange(1, windows.horizon + 1)[None, :, None]
        sign = np.where(windows.battery_V[:, :1, None] > self.full_V, 1.0, -1.0)
        return replace(found, position_m=found.position_m + sign * windows.velocity_m_s[:, None] * step)


@pytest.mark.parametrize(("good_in", "best"), [("train", "drifts"), ("test", "naive")])
def test_the_best_is_the_best_on_training_flights_whatever_test_flights_say(good_in, best, monkeypatch):
    flights = [made_flight(name, epoch_s=k * 1e9, seed=k) for k, name in enumerate("abcd", start=1)]
    for flight in flights[:2]:
        battery = flight["battery"].values
        battery[:] = 3.9 if good_in == "train" else 3.1
    for flight in flights[2:]:
        flight["battery"].values[:] = 3.1 if good_in == "train" else 3.9
    monkeypatch.setattr(Drifts, "full_V", 3.5)
    audits = {f.name: verdict(f) for f in flights}
    found = sysid_body(Options(quiet=True), flights, audits, [Naive(), Drifts()], (flights[:2], flights[2:]), "none")
    errors = {r.model: r.metrics["position_mae_m"]["sum"] for r in found.rows
              if (r.truth, r.group) == ("onboard", "all")}
    assert (errors["drifts"] < errors["naive"]) == (good_in == "test")  # test flights say the opposite
    assert found.models.best == best
    assert found.models.best_chosen_on.flights == found.train == ["a", "b"]
    assert set(found.models.best_chosen_on.criterion) == {"naive", "drifts"}
