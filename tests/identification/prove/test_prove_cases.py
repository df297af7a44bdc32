"""Cases from plan to disk: the same alone and in a crowd, the same read back, sealed, and silent about the truth."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from identification.prove.airframe import Airframe
from identification.prove.case_flights import _place, forget, given, keep, kept
from identification.prove.case_kinds import CaseSpec, DataFault, FlightSpec, Hidden, Nuisance, forbids
from identification.prove.effects import EFFECTS, FOREIGN, KNOWN, SIZES
from identification.prove.make import make_case, make_cases
from identification.prove.plan import QUOTAS, plan_cases
from identification.prove.seal import seal
from identification.prove.truth import TrueFault, TrueParameter
from nanobench_tools.harness import item_key
from nanobench_tools.physics.simulator import read_simulator, write_simulator
from nanobench_tools.practice import flying
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.timeline import Events
from nanobench_tools.results.result import from_json, to_json
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.nanobench import write_nanobench

FLIGHTS = (FlightSpec(path_spec("circle", "medium", duration_s=1.0), "pid", 0.9),)


def case(index, *concealed, **others):
    hidden = tuple(Hidden(n, "medium", EFFECTS[n].draw("medium", np.random.default_rng(index), Airframe()))
                   for n in concealed)
    return CaseSpec(f"case_{index}", others.pop("kind", "single"), 4, index, Airframe(), FLIGHTS, hidden, **others)


SPECS = [
    case(0, "motor_imbalance", nuisance=Nuisance(clock_wander_s=0.02)),
    case(1, "thrust_voltage", "wind", nuisance=Nuisance(imu_tilt_rad=(0.01, -0.02, 0.0))),
    case(2, kind="fault", faults=(DataFault("sign", None, {"stream": "imu", "column": "gyro_x"}, (0,)),))]


@pytest.fixture(scope="module")
def short():
    """Recordings of seven seconds: up, hardly a circle, down."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flying, "draw_events", lambda spec, rng: Events(0.4, 3.9, 4.1, 7.1, 7.6))
        yield


@pytest.fixture(scope="module")
def cases(short):
    return make_cases(SPECS)


@pytest.mark.slow
def test_a_case_is_the_same_alone_and_in_a_crowd(cases, short):
    alone = make_case(SPECS[1])
    assert alone.truth == cases[1].truth
    for name, stream in alone.flights[0].streams.items():
        np.testing.assert_array_equal(stream.values, cases[1].flights[0][name].values)


def test_simulators_lack_what_is_concealed_and_truth_says_it(cases):
    imbalance, pair, fault = cases[:3]
    assert "motor_imbalance" not in imbalance.simulator
    assert list(imbalance.corrected.values_of("motor_imbalance")["g"]) == SPECS[0].concealed[0].parameters["g"]
    assert "thrust_pwm" in pair.simulator
    assert "wind" not in pair.simulator
    flight, c = pair.flights[0], pair.corrected.values_of("thrust_voltage")["c"]
    mean_V = flight["battery"]["vbat"][flight["mocap"]["pz"] > 0.15].mean()
    given = pair.simulator.values_of("thrust_pwm")["c"]
    assert sum(given) == pytest.approx(sum(x * mean_V**k for k, x in enumerate(c)), rel=1e-3)
    assert [e.term for e in pair.truth.effects] == ["thrust_voltage", "wind"]
    assert pair.truth.effects[1].parameters["wind.w_m_s[0]"] == TrueParameter(
        SPECS[1].concealed[1].parameters["w_m_s"][0], "m/s", None)
    assert fault.truth.outcome == "data_fault"
    assert fault.truth.faults[0].kind == "sign"
    assert not any(c.truth.tumbled for c in cases)


def test_what_is_kept_between_making_and_diagnosis_is_the_same_and_whole(cases, tmp_path):
    for made in cases:
        keep(made, tmp_path)
        again, asked = kept(made.spec, tmp_path), given(made)
        assert (again.truth, again.truth) == (asked.truth, seal([made.truth]))
        assert again.simulator.structure == made.simulator.structure
        np.testing.assert_array_equal(again.simulator.values, made.simulator.values)
        assert (again.simulator.vehicle, again.simulator.inputs) == (made.simulator.vehicle, made.simulator.inputs)
        for one, other in zip(made.flights, again.flights, strict=True):
            assert item_key(kept, {"flight": one}) == item_key(kept, {"flight": other})
    place, = (p for p in tmp_path.iterdir() if p.name == _place(SPECS[0], tmp_path).name)
    (place / "flight_1.parquet").write_bytes(b"broken")
    assert kept(SPECS[0], tmp_path) is None
    forget(SPECS[1], tmp_path)
    assert kept(SPECS[1], tmp_path) is None
    assert not any(b"wind" in file.read_bytes() for file in tmp_path.rglob("*.json"))


def test_what_is_read_back_is_what_was_made_and_tells_no_truth(cases, tmp_path):
    made = cases[0]
    folder = tmp_path / made.name
    for flight in made.flights:
        write_nanobench(flight, folder / "flights" / f"{flight.name}.csv.xz")
    write_simulator(made.simulator, folder / "simulator.toml")
    assert read_simulator(folder / "simulator.toml") == made.simulator
    loaded = load_recordings([folder / "flights"], cache=False)
    assert not loaded.failed
    assert len(loaded.flights) == 1
    for name, stream in made.flights[0].streams.items():
        back = loaded.flights[0][name]
        np.testing.assert_allclose(back.time_s, stream.time_s, atol=1e-6)
        np.testing.assert_allclose(back.values, stream.values, atol=1e-8)
        assert back.samples == stream.samples
    assert loaded.flights[0].provenance.synthetic
    text = "".join(p.read_text() for p in folder.rglob("*.yaml")) + (folder / "simulator.toml").read_text()
    assert not any(word in text for word in ("imbalance", "wander", "conceal", "single"))


def fault(kind, stream, *columns, flights=("flight_1", "flight_2")):
    return [TrueFault(name, kind, stream, columns) for name in flights]


@pytest.mark.parametrize(("faults", "forbidden"), [
    (fault("unit", "imu", "imu_gyro_x", "imu_gyro_y", "imu_gyro_z"), True),
    (fault("sign", "imu", "gyro_x"), True),
    (fault("quaternion_order", "mocap", "qx", "qy", "qz", "qw"), True),
    (fault("sign", "imu", "imu_acc_y"), False),  # no term is asked of the accelerometer
    (fault("unit", "attitude", "att_stateEstimate_roll"), False),
    (fault("unit", "imu", "imu_gyro_x", flights=("flight_1",)), False),  # the other flight is left
    (fault("dead_stream", "imu", "imu_gyro_x"), False),  # what comes before is left
    (fault("clock_offset", "imu", "imu_gyro_x"), False),
    ([], False),
])
def test_what_faults_forbid(faults, forbidden):
    assert forbids(faults, ["flight_1", "flight_2"]) is forbidden


def test_the_seal_holds_the_truth(cases):
    truths = [c.truth for c in cases]
    assert seal(truths) == seal([from_json(type(t), to_json(t)) for t in truths])
    (first, *others), rest = truths[0].effects, truths[1:]
    assert seal(truths) != seal([replace(truths[0], effects=(replace(first, size="small"), *others)), *rest])


def test_the_plan_keeps_its_quotas_and_covers_the_grid():
    specs = plan_cases(300, 5)
    assert specs == plan_cases(300, 5)
    assert specs != plan_cases(300, 6)
    count = Counter(s.kind for s in specs)
    assert all(abs(count[kind] - 300 * share) < 1.0 for kind, share in QUOTAS.items())
    singles = {(h.effect, h.size) for s in specs if s.kind == "single" for h in s.concealed}
    assert singles == {(e, s) for e in KNOWN for s in SIZES}
    assert {h.effect for s in specs if s.kind == "foreign" for h in s.concealed} == set(FOREIGN)
    assert all(len(s.concealed) == (2 if s.kind == "pair" else 0 if s.kind in ("null", "fault") else 1) for s in specs)
    wanders = np.mean([s.nuisance.clock_wander_s > 0.0 for s in specs])
    assert 0.4 < wanders < 0.6
    assert all(3 <= len(s.flights) <= 6 for s in specs)
    assert len({s.name for s in specs}) == 300


def test_a_change_acts_in_some_flights_only():
    spec = next(s for s in plan_cases(100, 2) if s.kind == "change")
    hidden = spec.concealed[0]
    assert hidden.flights
    assert len(hidden.flights) < len(spec.flights)
    assert replace(hidden, flights=None) != hidden
