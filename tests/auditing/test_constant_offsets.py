"""Constant offsets of velocity, tilt and accelerometer, with and without motion capture."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.faults import constant_offset
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.stream_frames import IMU


@pytest.fixture(scope="module", params=["tracked", "alone"])
def flown(request, crowd):
    flight = crowd.log("fast figure_eight")[0].without_streams("attitude_qw")
    return flight if request.param == "tracked" else flight.without_streams("mocap")


def _found(flight, stream, quantity, by):
    values = flight[stream].values.copy()
    values[:, flight[stream].index(quantity)] += by
    bad = flight.with_streams(**{stream: replace(flight[stream], values=values)})
    return constant_offset.find(bad, Context(bad))


def test_a_right_recording_is_no_finding(flown):
    assert constant_offset.find(flown, Context(flown)) == []


@pytest.mark.parametrize(("stream", "quantity"), [("estimator", "vx"), ("estimator", "vz"), ("attitude", "roll"),
                                                  ("attitude", "pitch"), ("imu", "acc_x"), ("imu", "acc_z")])
def test_half_a_unit_is_found_with_its_size(flown, stream, quantity):
    (fault,) = _found(flown, stream, quantity, 0.5)
    assert fault.columns == (flown[stream].columns[flown[stream].index(quantity)],)
    assert fault.size == pytest.approx(0.5, abs=0.1)


def test_a_vehicle_that_leans_into_a_wind_has_no_offset(flown):
    """It rolls by 0.2 rad more, and its sensors with it: gravity and turning are felt in the leaning axes."""
    lean = Rotation.from_euler("x", 0.2)
    attitude, imu = flown["attitude"].values.copy(), flown["imu"].values.copy()
    attitude[:, flown["attitude"].index("roll")] += 0.2
    for axes in IMU:
        at = [flown["imu"].index(q) for q in axes]
        imu[:, at] = lean.inv().apply(imu[:, at])
    leaning = flown.with_streams(attitude=replace(flown["attitude"], values=attitude),
                                 imu=replace(flown["imu"], values=imu))
    found = constant_offset.find(leaning, Context(leaning))
    assert [fault.stream for fault in found if fault.stream == "attitude"] == []


def test_the_next_offset_is_judged_after_axes_and_units(flown):
    imu = flown["imu"]
    bad = flown.with_streams(imu=replace(imu, values=np.where(np.array(imu.quantities) == "acc_z", -1.0, 1.0)
                                         * imu.values + 0.5 * (np.array(imu.quantities) == "acc_x")))
    assert constant_offset.find(bad, Context(bad)) == []
