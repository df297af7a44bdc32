"""Which faults of the data forbid an answer: what is left to compare decides, by hand and on made-up flights."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.diagnosis import diagnose, recorded
from identification.mismatch.taking_part import cutting, taking_part
from identification.prove.airframe import Airframe
from identification.prove.case_kinds import CaseSpec, FlightSpec, Hidden, Nuisance
from identification.prove.effects import EFFECTS
from identification.prove.make import make_case
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.auditing.verb_needs import WRENCH
from nanobench_tools.flight import Fault, Flight, Provenance, Span, make_stream
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.practice.references import path_spec

pytestmark = pytest.mark.slow

FLIGHTS = tuple(FlightSpec(path_spec(family, speed, duration_s=6.0), "pid", charge)
                for family, speed, charge in (("figure_eight", "medium", 0.9), ("trefoil", "fast", 0.7)))
IMBALANCE = Hidden("motor_imbalance", "large",
                   EFFECTS["motor_imbalance"].draw("large", np.random.default_rng(0), Airframe()))


def made(concealed=(), nuisance=None):
    return make_case(CaseSpec("case", "single", 11, 0, Airframe(), FLIGHTS, tuple(concealed),
                              nuisance=nuisance or Nuisance()))


@pytest.fixture(scope="module")
def nothing():
    return made()


def with_fault(flights, kind, size=None, which=(0, 1), **how):
    flown = list(flights)
    for j in which:
        sized = {} if size is None else {"size": size}
        flown[j], _ = INJECTIONS[kind].function(flown[j], np.random.default_rng([3, j]), **sized, **how)
    return flown


def scaled(flights, stream, factor):
    return [f.with_streams(**{stream: replace(f[stream], values=f[stream].values * factor)}) for f in flights]


def aside(flights):
    """Faults of what no comparison is made from."""
    flights = with_fault(scaled(scaled(flights, "pid", 180.0 / np.pi), "setpoint", 1000.0), "unit", case=5)
    return with_fault(flights, "spike", 1.0, stream="attitude")


def harmless(flights):
    """The same, and faults that are left out or corrected."""
    return with_fault(with_fault(aside(flights), "clock_offset", 0.05), "gap", 0.3, stream="imu")


def verdict(case, flights):
    recordings = recorded(flights, "thrust_voltage" in case.simulator, case.simulator.vehicle)
    return diagnose(recordings, case.simulator).body


def kinds(body):
    return {(f["kind"], f["stream"]) for f in body["data_faults"]}


@pytest.mark.parametrize(("spoil", "stated"), [
    (harmless, {("unit", "pid"), ("unit", "setpoint"), ("unit", "imu"), ("spike", "attitude"),
                ("gap", "imu"), ("clock_offset", "imu")}),
    (lambda flights: with_fault(flights, "unit", which=(0,), case=2), {("unit", "imu")}),
], ids=["of no part of it, left out or corrected", "one flight in deg/s"])
def test_a_fault_that_leaves_enough_to_compare_is_stated_and_no_answer(nothing, spoil, stated):
    body = verdict(nothing, spoil(nothing.flights))
    assert (body["outcome"], body["findings"]) == ("none", [])
    assert stated <= kinds(body)


@pytest.mark.slow
@pytest.mark.parametrize(("concealed", "outcome", "terms"), [((), "none", []),
                                                             ((IMBALANCE,), "named", ["motor_imbalance"])])
def test_a_wandering_clock_is_no_answer(concealed, outcome, terms):
    case = made(concealed, Nuisance(clock_wander_s=0.03, clock_offset_s=0.02))
    body = verdict(case, case.flights)
    assert (body["outcome"], [f["term"] for f in body["findings"]]) == (outcome, terms)
    assert ("clock_wander", "imu") in kinds(body)


def dead(flights):
    return [f.with_streams(imu=replace(f["imu"], values=np.tile(f["imu"].values[:1], (len(f["imu"]), 1))))
            for f in flights]


@pytest.mark.parametrize("spoil", [
    pytest.param(dead, marks=pytest.mark.slow),
    lambda flights: with_fault(flights, "unit", case=2),
    pytest.param(lambda flights: with_fault(flights, "quaternion_order", stream="mocap"), marks=pytest.mark.slow),
], ids=["imu dead from the first row", "gyro in deg/s", "w before x"])
def test_a_fault_in_every_row_of_what_is_compared_forbids_an_answer(nothing, spoil):
    body = verdict(nothing, spoil(nothing.flights))
    assert (body["outcome"], body["findings"]) == ("data_fault", [])
    assert body["paragraph"].startswith("The data are at fault")


def _flight(**streams):
    t = np.arange(0.0, 10.0, 0.01)
    columns = {"mocap": WRENCH["mocap"], "imu": (*WRENCH["imu"], "acc_x"), **streams}
    made_up = {n: make_stream(n, t, np.ones((len(t), len(q))), q, [f"log_{x}" for x in q]) for n, q in columns.items()}
    return Flight("a", made_up, {}, Provenance("a", "", "test"))


IN_THE_AIR = (Span(2.0, 8.0),)


def _audit(*faults, airborne=IN_THE_AIR):
    return Audit("a", "a", "", "pid", airborne, (), faults, {}, {}, Span(0.0, 10.0))


def _fault(kind, stream, columns=(), start_s=0.0, end_s=10.0):
    return Fault(kind, stream, columns, start_s, end_s, 1.0, "1", "")


@pytest.mark.parametrize(("fault", "part"), [
    (_fault("spike", "imu", ("log_gyro_y",)), True),
    (_fault("spike", "imu", ("gyro_y",)), True),
    (_fault("spike", "imu", ("log_acc_x",)), False),
    (_fault("spike", "imu", ("log_acc_x", "log_gyro_x")), True),
    (_fault("gap", "imu"), True),
    (_fault("checksum", ""), True),
    (_fault("spike", "attitude"), False),
    (_fault("unit", "setpoint"), False),
])
def test_streams_and_columns_that_take_part(fault, part):
    assert (taking_part(_audit(fault), _flight(), WRENCH).faults == (fault,)) is part


def test_an_attitude_that_stands_in_for_the_motion_captures_takes_part():
    needed = {"mocap": WRENCH["mocap"], "command": ("thrust",)}
    flight = _flight(mocap=("px", "py", "pz"))
    (found,) = taking_part(_audit(_fault("sign", "attitude", ("log_roll",))), flight, needed).faults
    assert found.stream == "mocap"
    assert taking_part(_audit(_fault("sign", "attitude", ("log_roll",))), _flight(), needed).faults == ()


def test_what_cuts_rows_in_the_air():
    ground, air = _fault("gap", "imu", end_s=1.0), _fault("gap", "imu", start_s=3.0, end_s=4.0)
    late = _fault("clock_offset", "imu")
    assert cutting(_audit(ground, air, late)) == (air,)
    assert cutting(_audit(ground, late, airborne=())) == (ground,)
