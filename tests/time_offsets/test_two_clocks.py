"""Clocks that were never compared: ticks, an onboard log with a tracker's file, any two streams."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.moving.apply import retimed
from nanobench_tools.time_offsets.moving.pairing import between, with_mocap
from nanobench_tools.time_offsets.moving.sender_timestamps import link_delay, time_offset_from_ticks, unwrapped


@pytest.fixture(scope="module")
def flight(crowd):
    return crowd.log("fast trefoil")[0]


def sawtooth(time_s, height_s=0.08, period_s=0.6):
    return height_s * (1.0 - (time_s % period_s) / period_s)


def test_delay_and_skew_of_a_hand_made_link():
    sent = np.arange(0.0, 30.0, 0.013)
    delay = sawtooth(sent)
    stamps = 5.0 + sent * (1.0 + 40e-6) + delay
    found, skew = link_delay(stamps, sent)
    assert skew == pytest.approx(40e-6, abs=2e-5)
    assert np.abs(found - (delay - delay.min())).max() < 0.002


def test_ticks_of_24_bits_go_on_after_the_wrap():
    tick = (np.arange(16770.0, 16790.0, 0.01)) % (2**24 / 1000.0)
    assert np.allclose(np.diff(unwrapped(tick)), 0.01)


def test_ticks_give_the_delay_without_inference(flight):
    imu = flight["imu"]
    late = sawtooth(imu.time_s)
    tick = np.round(imu.time_s + 812.3, 3)  # whole milliseconds since boot
    with_ticks = make_stream("imu", imu.time_s + late, np.column_stack([imu.values, tick]), (*imu.quantities, "tick"))
    time_offset = time_offset_from_ticks(Context(flight.with_streams(imu=with_ticks)))
    assert time_offset.moving
    assert "measured" in time_offset.reason
    error = time_offset.at(with_ticks.time_s) - late
    assert np.std(error) < 0.001
    assert abs(np.median(error)) < 0.006
    moved = retimed(flight.with_streams(imu=with_ticks))
    assert np.std(moved["imu"].time_s - imu.time_s) < 0.001
    assert len(moved["imu"].time_sd_s) == len(imu)


def test_ticks_that_run_backward_are_no_clock(flight):
    imu = flight["imu"]
    tick = imu.time_s.copy()
    tick[200:] -= 3.0
    bad = make_stream("imu", imu.time_s, np.column_stack([imu.values, tick]), (*imu.quantities, "tick"))
    assert time_offset_from_ticks(Context(flight.with_streams(imu=bad))) is None


@pytest.mark.parametrize("turned", [False, True])
def test_a_log_and_a_trackers_file_meet(flight, turned):
    """Another epoch and, for one of them, another body frame: both are found."""
    mocap = flight["mocap"]
    values = mocap.values.copy()
    if turned:
        where = [mocap.index(q) for q in ("qx", "qy", "qz", "qw")]
        values[:, where] = so3.multiply(values[:, where], np.array([0.0, 0.0, np.sin(0.4), np.cos(0.4)]))
    tracked = Flight("tum", {"mocap": replace(mocap, time_s=mocap.time_s - 321.7, values=values)}, {},
                     Provenance("traj.tum", "", "tum"))
    both = with_mocap(flight.without_streams("mocap"), tracked)
    assert np.allclose(both["mocap"].time_s, mocap.time_s, atol=0.011)
    angle = so3.geodesic_angle(both["mocap"]["qx", "qy", "qz", "qw"], mocap["qx", "qy", "qz", "qw"])
    assert np.max(angle) < np.deg2rad(3.0)
    assert "traj.tum" in both.provenance.notes[-1]


def test_recordings_of_two_flights_do_not_meet(flight, crowd):
    other, _ = crowd.log("star")
    tracked = Flight("other", {"mocap": other["mocap"]}, {}, Provenance("other.tum", "", "tum"))
    with pytest.raises(InputError, match=r"other\.tum"):
        with_mocap(flight.without_streams("mocap"), tracked)


@pytest.mark.slow
def test_any_two_streams(flight):
    """The gyro against itself on another clock that moves: the movement is found; without one, nothing is claimed."""
    imu = flight["imu"]
    names = ("gyro_x", "gyro_y")
    late = 0.05 + sawtooth(imu.time_s, 0.06)
    moving = between(replace(imu, time_s=imu.time_s + late), imu, names)
    flying = (imu.time_s > 6.0) & (imu.time_s < 16.0)
    error = (moving.at(imu.time_s + late) - late)[flying]
    assert moving.moving
    assert np.sqrt(np.mean(error**2)) < 0.008
    still = between(replace(imu, time_s=imu.time_s + 0.05), imu, names)
    assert not still.moving
    assert still.constant_s == pytest.approx(0.05, abs=0.002)
    assert between(imu.rows(slice(0, 20)), imu, names) is None
