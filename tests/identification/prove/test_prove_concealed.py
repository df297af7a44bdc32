"""Knowledge taken from a fitted simulator: what is missing, what it is missing on, and what counts as found."""

from functools import partial
from inspect import signature
from types import SimpleNamespace

import numpy as np
import pytest

from identification.greybox.ladder import FULL
from identification.prove import concealed
from identification.prove.concealed import Learnt, RealProof, dead_logs, diagnose_real, fit_simulators, real_cases
from identification.prove.summary import summarise
from nanobench_tools.cli.prove import show_real
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Fault, Flight, Provenance
from nanobench_tools.harness import run_items
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps
from nanobench_tools.steps.options import Options

FAMILIES = ("circle", "star", "trefoil")


def flights(n):
    return [Flight(f"f{i:02d}", {}, {"family": FAMILIES[i % 3]}, Provenance(f"f{i:02d}.csv", f"{i:064d}", "test"))
            for i in range(n)]


def split(n):
    return SimpleNamespace(train=[SimpleNamespace(flight=f) for f in flights(1)],
                           test=[SimpleNamespace(flight=f) for f in flights(n)])


def fitted(cases, seed, mass_kg) -> Learnt:
    assert mass_kg == 0.041
    return Learnt(dumps(Model(Vehicle(mass_kg=mass_kg), FULL)), 3.8)


def test_the_stand_in_takes_what_the_function_takes():
    assert list(signature(concealed.vehicle_item).parameters) == list(signature(fitted).parameters)


def run(items, title):
    return run_items(items, title=title)


@pytest.fixture
def simulators(monkeypatch):
    monkeypatch.setattr(concealed, "vehicle_item", fitted)
    return fit_simulators(split(1), run, 0, 0.041)


def test_what_each_simulator_lacks(simulators):
    cases = {c.truth.kind: c for c in real_cases(split(6), simulators, 6, 0)}
    known = {kind: case.simulator for kind, case in cases.items()}
    whole = set(FULL)
    assert {kind: whole - {t.name for t in model.terms} for kind, model in known.items()} == {
        "control": set(), "no voltage": {"thrust_voltage"}, "stock mass": set(), "mass x 0.9": set(),
        "no drag": {"drag_linear"}, "no motor lag": {"motor_lag"}}
    assert {kind: model.vehicle.mass_kg for kind, model in known.items()} == pytest.approx({
        "control": 0.041, "no voltage": 0.041, "stock mass": 0.027, "mass x 0.9": 0.0369, "no drag": 0.041,
        "no motor lag": 0.041})
    assert cases["control"].truth.effects == ()
    mass = cases["stock mass"].truth.effects[0]
    assert (mass.term, mass.twins, mass.parameters["mass.m"].value) == ("mass", ("thrust_scale",), 0.041)
    lag = cases["no motor lag"].truth.effects[0].parameters
    assert {name: p.value for name, p in lag.items()} == {
        "motor_lag.tau_up_s": 0.03, "motor_lag.tau_down_s": 0.03}


def test_groups_share_no_flight_and_hold_every_family(simulators):
    cases = real_cases(split(20), simulators, 18, 4)
    assert len(cases) == 18
    groups = [{f.name for f in cases[k].flights} for k in (0, 6, 12)]
    assert [len(g) for g in groups] == [6, 6, 6]
    assert len(set.union(*groups)) == 18
    for k in (0, 6, 12):
        assert {f.metadata["family"] for f in cases[k].flights} == set(FAMILIES)
        assert all(cases[k + i].flights == cases[k].flights for i in range(6))
    with pytest.raises(InputError, match="5 test flights; 6 are needed"):
        real_cases(split(5), simulators, 6, 0)


def stubborn(flights, simulator, *, seed):
    """Says inertia whatever it is given; mass too where the vehicle is light; gusts where there is no drag."""
    terms = ["inertia", *(["thrust_scale"] if simulator.vehicle.mass_kg < 0.04 else []),
             *(["wind"] if "drag_linear" not in simulator else [])]
    return {"outcome": "named", "findings": [{"term": t, "equivalent": [], "confidence": 0.9, "parameters": {}}
                                             for t in terms],
            "unknown": None, "data_faults": [], "power": {}, "improvement": None, "elapsed_s": 1.0}


def test_what_is_found_and_what_stands_beside_it(simulators):
    scored = {c.kind: c for c in diagnose_real(real_cases(split(6), simulators, 6, 0), run, stubborn)}
    assert {kind: c.right for kind, c in scored.items()} == {
        "control": False, "no voltage": False, "stock mass": True, "mass x 0.9": True, "no drag": False,
        "no motor lag": False}
    assert all(c.false_name for c in scored.values())
    assert scored["stock mass"].beside == ()
    assert scored["no drag"].beside == ("wind",)


def test_the_table_says_real_and_leaves_nothing_out(simulators, capsys):
    cases = diagnose_real(real_cases(split(6), simulators, 6, 0), run, stubborn)
    show_real(Options(verbose=True), RealProof(tuple(cases), summarise(cases), {}, ("f00",)))
    shown = capsys.readouterr().out
    assert "real recordings, 1 flights train" in shown
    lines = {line.split("  ")[0].strip(): line for line in shown.splitlines()}
    assert "1 of 1, 100%" in lines["stock mass"]
    assert "1 (1 not in the control)" in lines["no drag"]
    assert "inertia, wind" in lines["no drag"]


def test_a_fit_that_fails_is_one_line(monkeypatch):
    def no_fit(cases, seed, mass_kg):
        raise InputError("training flights", "PWM of m1 never changes")

    monkeypatch.setattr(concealed, "vehicle_item", no_fit)
    with pytest.raises(InputError, match="no simulator can be fitted: training flights: PWM of m1"):
        fit_simulators(split(1), run, 0, 0.041)


def dead(stream):
    return Fault("dead_stream", stream, (), 1.0, 2.0, 1.0, "s", 0.1, "made up")


def test_dead_logs_are_a_case_of_their_own(simulators):
    flown = split(8)
    audits = {c.flight.name: SimpleNamespace(faults=()) for c in flown.test}
    assert dead_logs(flown, audits, simulators, 3) == []
    audits["f02"] = SimpleNamespace(faults=(dead("estimator"), dead("motor")))
    case, = dead_logs(flown, audits, simulators, 3)
    assert [f.name for f in case.flights] == ["f02"]
    assert [(f.kind, f.flight, f.stream) for f in case.truth.faults] == [
        ("dead_stream", "f02", "estimator"), ("dead_stream", "f02", "motor")]
    assert (case.truth.case, case.truth.kind, case.truth.effects) == ("real_003", "dead log", ())


@pytest.mark.parametrize(("stated", "named", "right"), [([("f02", "dead_stream")], [], True), ([], [], False),
                                                        ([("f02", "dead_stream")], ["wind"], False)])
def test_a_dead_log_is_right_when_it_is_stated_and_nothing_is_named(simulators, stated, named, right):
    audits = {f"f{i:02d}": SimpleNamespace(faults=()) for i in range(8)}
    audits["f02"] = SimpleNamespace(faults=(dead("estimator"),))
    # physics that nobody took away may be left beside the fault
    monkey = {"outcome": "named" if named else "unknown", "unknown": {"hint": "gusts"}, "power": {}, "elapsed_s": 1.0,
              "data_faults": [{"flight": flight, "kind": kind} for flight, kind in stated], "improvement": None,
              "findings": [{"term": t, "equivalent": [], "confidence": 0.5, "parameters": {}} for t in named]}
    scored, = diagnose_real(dead_logs(split(8), audits, simulators, 0), run, partial(verdict_of, monkey))
    assert scored.right is right


def verdict_of(verdict, flights, simulator, *, seed):
    return verdict


def test_the_simulator_without_voltage_is_right_at_one(simulators):
    whole, blind = simulators
    u = np.linspace(0.3, 1.0, 5)
    c, there = (np.array(m.values_of(t)["c"]) for m, t in ((whole, "thrust_voltage"), (blind, "thrust_pwm")))
    np.testing.assert_allclose(np.polyval(there[::-1], u), np.polyval(c[::-1], 3.8 * u), rtol=1e-12)
    assert {t.name for t in whole.terms} ^ {t.name for t in blind.terms} == {"thrust_voltage", "thrust_pwm"}
