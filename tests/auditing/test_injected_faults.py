"""Every injected fault is found, on the stream and at the time where it was put, and described by what it is."""

from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of

from nanobench_tools.auditing.faults import saturated_sensor, spike
from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.auditing.recording_audit import audit, find_copies
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.spikes import LIMITS, least_height

PLAIN = {  # size that is above the stated minimum for every flight
    "dead_stream": 5.0,
    "frozen_stream": 0.5,
    "gap": 0.5,
    "duplicate_time": 3,
    "backward_time": 0.05,
    "clock_offset": 0.05,
    "clock_drift": 0.005,
    "clock_wander": 0.03,
    "spike": 1.0,
    "saturated_sensor": 0.2,
    "mocap_occlusion": 0.5,
    "mocap_jump": 0.1,
    "estimator_reset": 0.5,
    "crash": 1.0,
}
CASES = [(kind, case) for kind, x in INJECTIONS.items() for case in x.cases if kind not in ("copy",)]
CASES = [(k, c if c or k != "gap" else {"stream": "attitude"}) for k, c in CASES]


def lively(flights):
    """A Lissajous figure: every axis but yaw moves."""
    return next(
        f for f in flights if f.metadata["family"] == "lissajous" and f.metadata["practice"]["controller"] == "pid"
    )


def injected(flights, kind, case):
    """The lively flight with the fault, and the fault."""
    function, rng = INJECTIONS[kind].function, np.random.default_rng(7)
    size = (PLAIN[kind],) if kind in PLAIN else ()
    return function(lively(flights), rng, *size, **case)


@pytest.mark.parametrize("kind", [kind if kind in ("clock_wander", "sign", "gap") else
                                  pytest.param(kind, marks=pytest.mark.slow) for kind in dict(CASES)])
def test_an_audit_has_what_the_detectors_find(flights, kind):
    bad, _ = injected(flights, kind, next(c for k, c in CASES if k == kind))
    found, expected = list(audit(bad).faults), faults_of(bad, *kinds())
    if kind in ("sign", "axis_swap"):  # an audit compares gyro and attitude before all others, with more evidence
        found, expected = ([(f.kind, f.stream, f.columns) for f in faults] for faults in (found, expected))
    assert found == expected


@pytest.mark.parametrize(("kind", "case"), [
    pytest.param(kind, case, id="-".join([kind, *map(str, case.values())]),
                 marks=[pytest.mark.slow] if CASES[i - 1][0] == kind else [])  # one case of a kind is quick
    for i, (kind, case) in enumerate(CASES)])
def test_found(flights, kind, case):
    bad, truth = injected(flights, kind, case)
    faults = faults_of(bad, kind)
    found = [
        f
        for f in faults
        if f.kind == kind
        and (not truth.stream or not f.stream or f.stream == truth.stream)
        and f.start_s <= truth.end_s + 0.1
        and f.end_s >= truth.start_s - 0.1
    ]
    assert found, [(f.kind, f.stream, f.start_s, f.end_s) for f in faults if f.kind != "interpolated"]
    best = min(found, key=lambda f: abs(f.start_s - truth.start_s))
    assert best.evidence
    if truth.columns and best.columns != ("t",):
        assert set(best.columns) & set(truth.columns)
    if kind in ("dead_stream", "gap", "frozen_stream", "mocap_occlusion"):
        assert abs(best.start_s - truth.start_s) < 0.1
        assert abs(best.end_s - truth.end_s) < 0.1
        assert best.size == pytest.approx(truth.size, abs=0.1)
    if kind in ("spike", "mocap_jump", "unit", "clock_offset", "clock_drift"):
        assert best.size == pytest.approx(truth.size, rel=0.25)
    if kind in ("clock_wander", "estimator_reset"):
        assert best.size == pytest.approx(truth.size, rel=0.5)
    if kind in ("saturated_sensor", "crash"):
        assert best.size == pytest.approx(truth.size, rel=0.05)
    stated = min(f.minimum_detectable for f in found)  # by one of the streams, in what the fault is measured in
    if np.isfinite(stated) and np.isfinite(truth.size):
        size = max(truth.size, 1.0 / truth.size) if kind == "unit" else abs(truth.size)
        assert stated <= size
    if kind not in ("unit", "sign", "axis_swap", "quaternion_order", "never_flew", "missing_column"):
        assert best.unit == truth.unit


def clipped(flight, column, rows):
    """The ``rows`` largest readings of a gyro's column before the continued end stand at the least of them."""
    imu = flight["imu"]
    values = imu.values.copy()
    read = np.flatnonzero(imu.time_s < imu.span.end_s - 0.5)
    x = values[read, imu.index(column)]
    values[read, imu.index(column)] = np.minimum(x, np.sort(x)[-rows])
    return flight.with_streams(imu=replace(imu, values=values))


@pytest.mark.parametrize("column", ["gyro_x", "gyro_y", "acc_x", "acc_z"])
def test_three_clipped_rows_are_found_and_two_are_not(flights, column):
    for flight in flights[::5]:
        for rows in (1, 2, 3, 4, 30):
            bad = clipped(flight, column, rows)
            found = [f for f in saturated_sensor.find(bad, Context(bad)) if "_".join(f.columns).endswith(column)]
            assert [f.size for f in found] == ([rows] if rows >= 3 else [])
            assert all((f.minimum_detectable, f.unit) == (3.0, "rows") for f in found)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.4, 0.8])
def test_a_clip_is_found_by_its_rows_at_one_end_of_the_range(flights, share):
    """Rows of both ends, or of the straight line after the last packet, are no measure of it."""
    for i, flight in enumerate(flights[::3]):
        bad, truth = INJECTIONS["saturated_sensor"].function(flight, np.random.default_rng(i), share)
        found = [f.size for f in saturated_sensor.find(bad, Context(bad)) if f.columns == truth.columns]
        assert max(found, default=0.0) == (truth.size if truth.size >= 3 else 0.0)


@pytest.mark.parametrize(("stream", "column"), [("mocap", "pz"), ("imu", "gyro_x"), ("battery", "vbat"), *(
    pytest.param(*given, marks=pytest.mark.slow)
    for given in (("mocap", "px"), ("imu", "acc_y"), ("estimator", "y"), ("attitude", "roll")))])
@pytest.mark.slow
def test_a_spike_of_the_stated_height_is_found_wherever_the_vehicle_moves(flights, stream, column):
    rng = np.random.default_rng(3)
    for flight in flights[::6]:
        s, k = flight[stream], flight[stream].index(column)
        rows = np.searchsorted(s.time_s, np.arange(6.0, 16.0, 2.5) + rng.uniform(0.0, 1.8, 4))  # none sees another
        least = [least_height(s.values[:, [k]], row, row + 1, np.array([LIMITS[stream][column]]))[0] for row in rows]
        for sign in (-1.0, 1.0):
            values = s.values.copy()
            values[rows, k] += sign * 1.05 * np.array(least)
            bad = flight.with_streams(**{stream: replace(s, values=values)})
            found = [f for f in spike.find(bad, Context(bad)) if f.columns == (s.columns[k],)]
            assert [f.start_s <= s.time_s[row] <= f.end_s for f, row in zip(found, rows, strict=True)] == [True] * 4
            assert all(f.minimum_detectable >= LIMITS[stream][column] for f in found)


def test_a_step_back_of_any_length_is_found(flights):
    for i, size in enumerate((0.0005, 0.005, 0.05, 1.0)):
        bad, truth = INJECTIONS["backward_time"].function(flights[i], np.random.default_rng(i), size)
        assert [f.size for f in faults_of(bad, "backward_time")] == pytest.approx([truth.size])


@pytest.mark.parametrize("how", ["extrapolate", "hold"])
@pytest.mark.parametrize("at_s", [6.3, 11.111, 17.0])
def test_end_of_a_dead_log_to_a_tenth_of_a_second(flights, how, at_s):
    for flight in flights[::7]:
        bad, truth = INJECTIONS["dead_stream"].function(flight, np.random.default_rng(0), at_s=at_s, how=how)
        dead = {f.stream: f for f in faults_of(bad, "dead_stream")}
        for name in ("imu", "estimator", "estimator_acc", "attitude", "attitude_qw", "motor"):
            assert abs(dead[name].start_s - truth.start_s) < 0.1, (name, dead[name])


def test_commands_that_stand_still_by_right_are_innocent(audited_flights):
    """Held setpoints, motors at rest, a Mellinger flight's silent pid: none is frozen or dead before the log ends."""
    for flight, verdict in audited_flights:
        stopped = flight.span.end_s - flight.metadata["practice"]["tail_s"]
        for fault in verdict.faults:
            if fault.stream in ("setpoint", "motor", "pid") and fault.kind in ("dead_stream", "frozen_stream"):
                assert fault.start_s > stopped - 0.15


@pytest.mark.slow
def test_one_wrong_stream_does_not_accuse_the_others(flights):
    flight = lively(flights)
    for kind, case in (
        ("sign", {"stream": "imu", "column": "gyro_x"}),
        ("unit", {"case": 6}),
        ("unit", {"case": 7}),
        ("axis_swap", {"stream": "estimator", "pair": ("x", "y")}),
        ("quaternion_order", {"stream": "mocap"}),
    ):
        bad, truth = INJECTIONS[kind].function(flight, np.random.default_rng(1), **case)
        accused = {(f.kind, f.stream) for f in audit(bad).faults if f.kind not in ("interpolated", "dead_stream")}
        assert accused == {(kind, truth.stream)}


def test_the_motion_capture_is_blamed_when_the_vehicle_agrees_with_itself(flights):
    flight = lively(flights)
    mocap = flight["mocap"]
    values = mocap.values.copy()
    for column in ("px", "vx"):
        values[:, mocap.index(column)] *= -1.0
    accused = {
        (f.kind, f.stream, f.columns)
        for f in faults_of(flight.with_streams(mocap=replace(mocap, values=values)), "sign")
    }
    assert ("sign", "mocap", ("px",)) in accused
    assert not {stream for _, stream, _ in accused} & {"estimator", "setpoint"}


def test_copies(flights):
    twin, _ = INJECTIONS["copy"].function(flights[2], np.random.default_rng(0))
    assert find_copies([*flights[:5], twin]) == [[flights[2].name, twin.name]]
