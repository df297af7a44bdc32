"""A constant offset of the gyro is one finding with the value of each axis, and the advice mends it."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults import gyro_bias
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.stream_frames import IMU

OFFSET = np.array([0.5, 0.0, -0.3])


def _found(flight):
    return gyro_bias.find(flight, Context(flight))


def _with_offset(flight, offset):
    imu = flight["imu"]
    values = imu.values.copy()
    values[:, [imu.index(q) for q in IMU[0]]] += offset
    return flight.with_streams(imu=replace(imu, values=values))


@pytest.mark.parametrize("without", [(), ("mocap",), ("mocap", "attitude_qw")])
@pytest.mark.parametrize("name", ["fast figure_eight", "circle"])
def test_an_offset_is_found_with_its_value_by_any_attitude(crowd, name, without):
    flight = crowd.log(name)[0].without_streams(*without)
    assert _found(flight) == []
    (fault,) = _found(_with_offset(flight, OFFSET))
    assert fault.columns == ("imu_gyro_x", "imu_gyro_z")
    assert fault.size == pytest.approx(0.5, abs=0.03)
    assert "offset = -0.5" in fault.evidence


def test_the_uncalibrated_gyro_of_a_data_sheet_is_no_finding(crowd):
    flight = crowd.log("fast figure_eight")[0]
    assert _found(_with_offset(flight, np.array([0.08, -0.05, 0.02]))) == []


def _imu_at_rest(rate, motors=0.0):
    t = np.arange(0.0, 6.0, 0.01)
    rng = np.random.default_rng(2)
    values = np.column_stack([0.002 * rng.standard_normal((len(t), 3)) + rate,
                              0.02 * rng.standard_normal((len(t), 3)) + (0.0, 0.0, 9.81)])
    streams = {"imu": make_stream("imu", t, values, (*IMU[0], *IMU[1])),
               "motor": make_stream("motor", t, np.full((len(t), 4), motors), ("m1", "m2", "m3", "m4"))}
    return Flight("made", streams, {}, Provenance("made", "", "test"))


def test_gravity_at_rest_shows_an_offset_without_an_attitude():
    (fault,) = _found(_imu_at_rest((0.0, 0.4, 0.3)))
    assert fault.columns == ("gyro_y", "gyro_z")


def test_a_steady_spin_with_running_motors_is_no_offset():
    assert _found(_imu_at_rest((0.0, 0.0, 0.3), motors=0.5)) == []


@pytest.mark.parametrize("known", [True, False])
def test_a_steady_spin_does_not_separate_scale_and_offset(known):
    """A gyro that reads a quarter too much while the vehicle spins: only a spin that changes shows which it is."""
    t = np.arange(0.0, 20.0, 0.01)
    spin = 2.0 + known * np.sin(t)
    yaw = np.cumsum(spin) * 0.01
    q = np.column_stack([np.zeros((len(t), 2)), np.sin(0.5 * yaw), np.cos(0.5 * yaw)])
    gyro = np.column_stack([np.zeros((len(t), 2)), 1.25 * spin])
    streams = {"imu": make_stream("imu", t, np.column_stack([gyro, np.tile([0.0, 0.0, 9.81], (len(t), 1))]),
                                  (*IMU[0], *IMU[1])),
               "attitude_qw": make_stream("attitude_qw", t, q, ("qx", "qy", "qz", "qw"))}
    assert _found(Flight("made", streams, {}, Provenance("made", "", "test"))) == []
