"""Rotor speed hidden from a diagnosis: which flights make the simulator, and that the speed is really gone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from identification.prove import hidden_speed
from identification.prove.hidden_speed import speed_cases, with_speed
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.harness import run_items
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps

SIMULATOR = Model(Vehicle(mass_kg=0.037), {"thrust_voltage": {"c": (0.0, 0.01, 0.01)},
                                           "motor_lag": {"tau_up_s": 0.04, "tau_down_s": 0.05}})


def flight(name):
    time_s = np.arange(0.0, 2.0, 0.002)
    motors = make_stream("rpm", time_s, np.full((len(time_s), 4), 1500.0), ("m1", "m2", "m3", "m4"), rate_hz=500.0)
    return Flight(name, {"rpm": motors}, {}, Provenance(f"{name}.log", f"{int(name[1:]):064d}", "test"))


def run(items, title):
    return run_items(items, title=title)


@pytest.fixture
def known(monkeypatch):
    seen = {}

    def item(flights, mass_kg, seed):
        seen["train"] = [f.name for f in flights]
        return {"simulator": dumps(SIMULATOR)}

    monkeypatch.setattr(hidden_speed, "simulator_item", item)
    monkeypatch.setattr(hidden_speed, "measured_lag", lambda flights, mass_kg: {
        "motor_lag.tau_up_s": 0.041, "motor_lag.tau_down_s": 0.052})
    return seen


def test_every_other_flight_is_diagnosed_without_speed_and_lag(known):
    whole, blind = speed_cases([flight(f"f{k}") for k in range(5)], 0.037, run, 0, 7)
    assert known["train"] == ["f0", "f2", "f4"]
    assert [f.name for f in blind.flights] == ["f1", "f3"]
    assert all("rpm" not in f for f in (*whole.flights, *blind.flights))
    assert whole.simulator.parameters == SIMULATOR.parameters
    assert "motor_lag" not in blind.simulator
    effect, = blind.truth.effects
    assert {n: p.value for n, p in effect.parameters.items()} == {
        "motor_lag.tau_up_s": 0.041, "motor_lag.tau_down_s": 0.052}
    assert [c.truth.case for c in (whole, blind)] == ["real_007", "real_008"]


def test_one_flight_is_too_few(known):
    with pytest.raises(InputError, match="one flight with rotor speed; two are needed"):
        speed_cases([flight("f0")], 0.037, run, 0, 0)


def test_flights_without_rotor_speed_are_none(monkeypatch):
    monkeypatch.setattr(hidden_speed, "read_logs", lambda flights: (
        [SimpleNamespace(name=f.name) for f in flights if f.name != "f1"], {}))
    bare = flight("f2").without_streams("rpm")
    assert [f.name for f in with_speed([flight("f0"), flight("f1"), bare])] == ["f0"]
