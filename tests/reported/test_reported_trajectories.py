"""Reported trajectories and logs: the right value of each, as its expect.md states it."""

import pytest

from nanobench_tools.auditing.audit_verdict import verdict_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.sources import load_recordings


def the_flight(path):
    loaded = load_recordings([path], cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    return flight


@pytest.mark.real
def test_thirty_rows_of_one_timestamp_are_unusable(reported):
    found = audit(the_flight(reported / "stamps_of_whole_seconds/estimate.tum"))
    assert verdict_of(found).severity == "unusable"
    assert [(f.kind, f.size) for f in found.faults] == [("coarse_time", 30.0)]


@pytest.mark.real
def test_two_hops_are_two_spans(reported):
    found = audit(the_flight(reported / "two_hops/mocap.tum"))
    (a, b), (c, d) = [(s.start_s, s.end_s) for s in found.airborne]
    assert (a, b, c, d) == pytest.approx((1.6, 8.9, 14.1, 21.9), abs=0.2)
    assert verdict_of(found).usable == found.airborne


@pytest.mark.real
def test_zeros_are_one_occlusion(reported):
    found = audit(the_flight(reported / "zeros_while_occluded/mocap.tum"))
    (fault,) = found.faults
    assert fault.kind == "mocap_occlusion"
    assert (fault.start_s, fault.end_s) == pytest.approx((3.33, 3.73), abs=0.04)
    assert verdict_of(found).usable_s == pytest.approx(5.4, abs=0.1)


@pytest.mark.real
def test_states_of_the_filter_are_an_estimate(reported):
    flight = the_flight(reported / "usd_log_kalman_states/log00")
    assert flight["estimator"].quantities == ("x", "y", "z")
    (span,) = audit(flight).airborne
    assert (span.start_s, span.end_s) == pytest.approx((1.1, 6.9), abs=0.2)


@pytest.mark.real
def test_the_group_that_drives_motors_is_read(reported):
    folder = reported / "ulog_idle_output_group"
    motor, bench = the_flight(folder / "flight.ulg")["motor"], the_flight(folder / "on_the_bench.ulg")
    flown = (motor.time_s > 1.5) & (motor.time_s < 4.5)
    assert motor.values[flown].mean(axis=0) == pytest.approx([0.6] * 4, abs=0.05)
    assert {"imu", "attitude"} <= set(bench.streams)
    assert "motor" not in bench
