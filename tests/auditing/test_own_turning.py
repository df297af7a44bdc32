"""A gyro without motion capture is judged by the estimated attitude, axis by axis."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults import axis_swap, unit
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.context import Context

GYRO = ("gyro_x", "gyro_y", "gyro_z")


@pytest.fixture(scope="module")
def own(crowd):
    return crowd.log("fast figure_eight")[0].without_streams("mocap", "attitude_qw")


def _with_gyro(flight, change):
    imu = flight["imu"]
    values = imu.values.copy()
    at = [imu.index(q) for q in GYRO]
    values[:, at] = change(imu[GYRO])
    return flight.with_streams(imu=replace(imu, values=values))


def test_a_right_gyro_is_no_finding(own):
    assert unit.find(own, Context(own)) == axis_swap.find(own, Context(own)) == []


def test_one_axis_in_degrees(own):
    bad = _with_gyro(own, lambda w: w * [1.0, np.rad2deg(1.0), 1.0])
    (fault,) = unit.find(bad, Context(bad))
    assert fault.columns == ("imu_gyro_y",)
    assert "57.3 times" in fault.evidence


def test_two_axes_that_changed_places(own):
    bad = _with_gyro(own, lambda w: w[:, [1, 0, 2]])
    (fault,) = axis_swap.find(bad, Context(bad))
    assert fault.columns == ("imu_gyro_x", "imu_gyro_y")


def test_a_table_with_motors_that_do_not_begin_with_the_first_is_audited():
    t = np.arange(0.0, 3.0, 0.01)
    motors = make_stream("motor", t, np.full((len(t), 2), 0.5), ("m2", "m3"))
    assert audit(Flight("made", {"motor": motors}, {}, Provenance("made", "", "test"))).faults is not None


@pytest.mark.parametrize(("angle", "gyro"), [(a, g) for a in ("roll", "pitch") for g in GYRO])
def test_an_angle_and_a_rate_that_changed_places(own, angle, gyro):
    attitude, imu = own["attitude"], own["imu"]
    rate = np.interp(attitude.time_s, imu.time_s, imu[gyro])
    turned = np.interp(imu.time_s, attitude.time_s, attitude[angle])
    angles, rates = attitude.values.copy(), imu.values.copy()
    angles[:, attitude.index(angle)], rates[:, imu.index(gyro)] = rate, turned
    bad = own.with_streams(attitude=replace(attitude, values=angles), imu=replace(imu, values=rates))
    assert {f.kind for f in audit(bad).faults} & {"axis_swap", "unit", "frame", "sign"}
