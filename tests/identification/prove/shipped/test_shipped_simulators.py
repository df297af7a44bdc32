"""Simulators that shipped wrong: cases, their two simulators, and what counts as right for each kind of answer."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "mismatch"))

from carried_tracks import MODEL, track_of

from identification.mismatch.recordings import Recordings
from identification.prove.corrupted.engines import Engine, engine_of
from identification.prove.corrupted.groups import Group
from identification.prove.corrupted.nominal import as_json
from identification.prove.shipped import ShippedCase, ShippedJudge, ShippedProof, prove_shipped, shipped_cases
from identification.prove.shipped.shipped_cases import ANOTHER, EFFECT, GEOMETRY, NOT_ASKED, changed
from identification.prove.shipped.shipped_score import REFUSED, ShippedAnswer, score_shipped
from nanobench_tools.cli.prove_shipped import HEADS, row
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.physics import Vehicle
from nanobench_tools.results.result import from_json, to_json

NOMINAL = MODEL.with_term("thrust_scale", s=1.0)
CLEAN = ShippedAnswer("none", "Nothing is identified.")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Nothing is kept from other tests."""
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def group():
    """Two flights of 8 s of a vehicle that is the nominal one."""
    tracks = tuple(track_of(NOMINAL, 20 + k, k, seconds=8.0) for k in range(2))
    flights = tuple(Flight(t.name, {}, {}, Provenance(f"{t.name}.csv", f"{k:064d}", "test"))
                    for k, t in enumerate(tracks))
    return Group("nanobench", 0, Recordings(flights, {}, tracks, (), {}), NOMINAL, "a key of its own")


def case(answer=EFFECT, known=(("drag_linear", "drag_quadratic"),), **changes):
    shipped = {"terms": {"drag_linear": {"d": [0.16, 0.16, 0.06]}}}
    return replace(ShippedCase("made_up", 1, "S", ("https://x.org/1",), "drag", "10 d", "d", "Story.", answer,
                               vehicle="nanobench", known=known, shipped=shipped), **changes)


def finding(term, *equivalent, believed=1.0, **ends):
    parameters = {name.replace("__", ".").replace("_0_", "[0]"):
                  {"value": (a + b) / 2.0, "ci95": [a, b], "unit": "1", "believed": believed}
                  for name, (a, b) in ends.items()}
    return {"term": term, "equivalent": list(equivalent), "confidence": 0.99, "parameters": parameters}


def answered(*findings, outcome="named", paragraph="Something."):
    return ShippedAnswer(outcome, paragraph, tuple(findings))


def scored(before, after=CLEAN, usual=CLEAN, of=None, lift=None, shown=1.0):
    of = of or case()
    return score_shipped(of, of.simulators(NOMINAL), (before, after), usual, lift, shown)


def drag(low, high):
    return finding("drag_linear", "drag_rotor", **{"drag_linear__d_0_": (low, high)})


def test_the_cases_are_21_with_a_thread_each():
    cases = shipped_cases()
    assert [c.number for c in cases] == list(range(1, 22))
    assert all(c.threads and all(t.startswith("https://") for t in c.threads) for c in cases)
    assert {c.answer for c in cases} == {EFFECT, ANOTHER, GEOMETRY, NOT_ASKED}
    assert all(bool(c.reason) == (c.answer == NOT_ASKED) for c in cases)
    assert all(bool(c.known) == (c.answer == EFFECT) for c in cases)
    with pytest.raises(UsageError, match="omnisim_thrust"):
        shipped_cases(["omnisim_trust"])


@pytest.mark.parametrize("name", [c.name for c in shipped_cases() if c.answer != NOT_ASKED])
def test_every_case_differs_from_its_correction(name):
    (one,) = shipped_cases([name])
    kind = {"nanobench": "pwm", "brushed_commands": "pwm", "lee_upgraded": "thrust"}.get(one.vehicle, "rpm")
    nominal = replace_input(kind)
    corrected = one.as_corrected(nominal)
    if name == "pyrobolearn_yaw":  # 6 m of lever
        with pytest.raises((InputError, UsageError), match="yaw_torque"):
            one.as_shipped(nominal)
    else:
        assert one.as_shipped(nominal) != corrected
    assert corrected.vehicle.input == kind


def replace_input(kind):
    terms = {"pwm": MODEL.as_dict(), "rpm": {"thrust_rpm": {"k_f": 3.7e-8}, "yaw_torque": {"k_m": 0.004}},
             "thrust": {}}[kind]
    return type(MODEL)(Vehicle(input=kind), {**terms, "thrust_scale": {"s": 1.49}})


def test_changes_replace_scale_and_remove():
    made = changed(NOMINAL.with_term("inertia", inertia_kg_m2=(2e-5, 2e-5, 3e-5)), {
        "mass_kg": 1.5, "inertia_kg_m2": [1e-5, 1e-5, 2e-5], "without": ["drag_linear"],
        "scale": {"yaw_torque.k_m": 2.0}, "terms": {"motor_lag": {"tau_up_s": 0.1}}})
    assert made.vehicle.mass_kg == 1.5
    assert made.vehicle.inertia_kg_m2 == (1e-5, 1e-5, 2e-5)
    assert not {"inertia", "drag_linear"} & set(made.as_dict())
    assert made.values_of("yaw_torque")["k_m"] == pytest.approx(0.012)
    assert made.values_of("motor_lag") == {"tau_up_s": 0.1, "tau_down_s": 0.04}


def test_an_effect_is_right_with_its_size_in_the_interval():
    assert scored(answered(drag(0.014, 0.018))).right
    missed = scored(answered(drag(0.05, 0.06)))
    assert (missed.right, missed.identified, missed.sized) == (False, True, False)
    assert "size" in missed.why
    unnamed = scored(answered(outcome="unknown"))
    assert (unnamed.right, unnamed.why) == (False, "not identified: drag_linear or drag_quadratic")


def test_an_error_that_predictions_hardly_show_may_stay_unidentified():
    quiet = scored(answered(outcome="none"), shown=0.1)
    assert (quiet.right, quiet.identified, quiet.visible) == (True, False, False)


def test_what_is_not_there_is_false_before_and_after():
    false = scored(answered(drag(0.014, 0.018), finding("wind")))
    assert (false.right, false.false) == (False, ("wind",))
    usual = answered(finding("wind"))
    assert scored(answered(drag(0.014, 0.018), finding("wind")), usual, usual).right
    again = scored(answered(drag(0.014, 0.018)), answered(drag(0.001, 0.002)))
    assert (again.right, again.again) == (False, ("drag_linear",))
    whole = scored(answered(drag(0.014, 0.018)), answered(finding("wind")), usual=None)
    assert whole.right  # what else the simulator of others leaves out is true of it


def test_mass_and_thrust_are_compared_as_one_factor():
    heavy = case(known=(("mass", "thrust_scale"),), shipped={"mass_kg": 0.08})
    for found in (finding("thrust_scale", "mass", thrust_scale__s=(1.9, 2.1)),
                  finding("mass", believed=0.08, mass__m=(0.038, 0.042))):
        got = scored(answered(found), of=heavy, lift=2.0)
        assert got.right
        assert got.known[0].value == pytest.approx(2.0, rel=0.01)
    assert not scored(answered(finding("mass", believed=0.08, mass__m=(0.05, 0.06))), of=heavy, lift=2.0).right


def test_another_vehicle_is_an_answer():
    other = ShippedAnswer("insufficient", "The simulator is of another vehicle: it lifts 0.027 times what flew.")
    assert scored(other, of=case(ANOTHER, ())).right
    assert not scored(answered(drag(0.0, 1.0)), of=case(ANOTHER, ())).right
    assert not scored(other).right  # the effect is asked for
    both = case(ANOTHER, (), after=ANOTHER)
    assert scored(other, other, of=both).right
    assert not scored(other, of=both).right


def test_an_impossible_geometry_is_an_answer():
    refused = ShippedAnswer(GEOMETRY, "spin: motors 1 and 2 are neighbours")
    assert scored(refused, of=case(GEOMETRY, ())).right
    assert not scored(answered(finding("inertia")), of=case(GEOMETRY, ())).right
    assert not scored(refused, refused, of=case(GEOMETRY, ())).right


def test_a_refused_value_names_its_term():
    of = case(known=(("yaw_torque",),))
    named = score_shipped(of, (None, NOMINAL), (ShippedAnswer(REFUSED, "yaw_torque: k_m = 6.8"), CLEAN), CLEAN, None,
                          None)
    assert (named.right, named.known[0].by, named.sized) == (True, "yaw_torque", None)
    other = ShippedAnswer(REFUSED, "mass_kg: 80")
    assert not score_shipped(of, (None, NOMINAL), (other, CLEAN), CLEAN, None, None).right


def test_a_run_keeps_its_answers_and_checks_geometry_first(group):
    asked = []

    def engine(recordings, simulator, seed):
        asked.append(simulator)
        wrong = simulator != NOMINAL
        return {"outcome": "named" if wrong else "none", "paragraph": "Text.",
                "findings": [drag(0.014, 0.018)] if wrong else [], "corrected": as_json(NOMINAL) if wrong else None}

    spin = case(GEOMETRY, (), name="spin", shipped={"spin": [-1.0, -1.0, 1.0, 1.0]})
    closed = ShippedCase("closed", 3, "S", ("https://x.org/3",), "gain", "-", "-", "Story.", NOT_ASKED, reason="loop")
    absent = case(vehicle="payload", name="absent")
    cases = [case(), spin, closed, absent]
    first = prove_shipped(ShippedJudge(Engine("mine", engine, "code"), [], groups={"nanobench": group}), cases)
    again = prove_shipped(ShippedJudge(Engine("mine", engine, "code"), [], groups={"nanobench": group}), cases)
    assert len(asked) == 2  # as shipped and nominal
    assert [c.score.right if c.score else None for c in first.cases] == [True, True, None, None]
    assert (first.right.right, first.right.n, first.not_applicable, first.absent) == (2, 2, 1, 1)
    worst = first.cases[0].worst
    assert worst.shipped > worst.corrected == pytest.approx(worst.identified)
    assert from_json(ShippedProof, to_json(first)) == again
    assert [len(row(c)) for c in first.cases] == [len(HEADS)] * 4
    assert np.isfinite([e.shipped for e in first.cases[0].half_second]).all()


@pytest.mark.real
@pytest.mark.slow
def test_a_real_case_from_files_to_its_score(real_data):
    judge = ShippedJudge(engine_of("posterior"), [real_data])
    result = judge.result(shipped_cases(["agileflight_thrust"])[0])
    assert result.score.identified
    assert len(result.flights) == 4


@pytest.mark.real
def test_absent_recordings_are_reported(real_data, tmp_path):
    judge = ShippedJudge(engine_of("posterior"), [tmp_path])
    assert judge.result(shipped_cases(["omnisim_thrust"])[0]).reason.startswith("no recordings in crazyflie_usd")
