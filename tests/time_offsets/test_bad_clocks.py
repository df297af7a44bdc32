"""Recordings whose clock cannot be followed: the constant, or not identifiable, and never a wrong warp."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Span
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.moving.apply import retimed
from nanobench_tools.time_offsets.moving.confirm import believed

FIRMWARE = ("imu", "estimator", "attitude_qw", "attitude", "motor", "setpoint", "pid", "battery", "estimator_acc")


@pytest.fixture(scope="module")
def wandering(crowd):
    return crowd.log("fast figure_eight", wander_sd_s=0.03)


def on_firmware(flight, change):
    return flight.with_streams(**{n: change(flight[n]) for n in FIRMWARE if n in flight})


def lateness(clock, stamps_s):
    sent = np.arange(stamps_s[0] - 1.0, stamps_s[-1] + 1.0, 0.001)
    return stamps_s - np.interp(stamps_s, sent + clock.late_s(sent), sent)


def test_without_motion_capture_nothing_is_said(wandering):
    flight = wandering[0].without_streams("mocap")
    assert believed(Context(flight)) is None
    with pytest.raises(InputError, match=r"log.*cannot be identified"):
        retimed(flight)


def test_without_gyro_the_estimate_alone_confirms_nothing_it_set_itself(wandering):
    flight = wandering[0].without_streams("imu")
    time_offset = believed(Context(flight))
    assert time_offset is None or not time_offset.moving
    with pytest.raises(InputError, match="no imu stream"):
        retimed(flight)


def test_a_dead_stream_is_followed_until_it_died(wandering):
    flight, clock = wandering

    def dies(stream):
        values = stream.values.copy()
        late = stream.time_s > 14.0
        values[late] = values[np.flatnonzero(late)[0]]
        return replace(stream, values=values)

    time_offset = believed(Context(on_firmware(flight, dies)))
    assert time_offset.moving
    assert time_offset.time_s[-1] < 14.2
    inside = (time_offset.time_s > 7.0) & (time_offset.time_s < 13.5)
    error = (time_offset.offset_s - lateness(clock, time_offset.time_s))[inside]
    assert np.sqrt(np.mean((error - np.median(error)) ** 2)) < 0.006


@pytest.mark.slow
def test_a_gap_of_a_second_widens_the_interval_and_bends_nothing(wandering):
    flight, clock = wandering
    cut = on_firmware(flight, lambda s: s.rows((s.time_s < 11.0) | (s.time_s > 12.0)))
    time_offset = believed(Context(cut))
    assert time_offset.moving
    t = time_offset.time_s
    outside = (t > 7.0) & (t < 18.0) & ((t < 10.8) | (t > 12.2))
    hole = (t > 11.4) & (t < 11.6)
    error = (time_offset.offset_s - lateness(clock, time_offset.time_s))[outside]
    assert np.sqrt(np.mean((error - np.median(error)) ** 2)) < 0.006
    assert np.median(time_offset.sd_s[hole]) > 3.0 * np.median(time_offset.sd_s[outside])


@pytest.mark.parametrize("step_s", [2.0, -2.0])
def test_a_clock_that_steps_by_seconds_gets_no_warp(wandering, step_s):
    flight, _ = wandering
    stepped = on_firmware(flight, lambda s: replace(s, time_s=np.maximum.accumulate(
        s.time_s + step_s * (s.time_s > 12.0))))
    time_offset = believed(Context(stepped))
    assert time_offset is None or not time_offset.moving or np.all(time_offset.sd_s[time_offset.time_s > 14.5] > 0.03)


def test_a_vehicle_that_never_moves_has_no_clock(wandering):
    ground = wandering[0].during(Span(0.0, 1.5))
    assert believed(Context(ground)) is None
    with pytest.raises(InputError, match="cannot be identified"):
        retimed(ground)


@pytest.mark.slow
def test_slow_rows_say_that_they_know_less(wandering):
    flight, _ = wandering
    time_offset = believed(Context(flight))
    truth = flight["mocap"]
    speed = np.linalg.norm(np.gradient(truth["px", "py", "pz"], truth.time_s, axis=0), axis=1)
    at = np.interp(time_offset.time_s, truth.time_s, np.convolve(speed, np.ones(30) / 30, "same"))
    slow, fast = at < np.quantile(at, 0.03), at > np.quantile(at, 0.7)
    assert np.median(time_offset.sd_s[slow]) > 2.0 * np.median(time_offset.sd_s[fast])


def test_the_former_name_on_a_flight_warns_and_does_the_same(wandering):
    flight = wandering[0].without_streams("imu")
    with (pytest.warns(FutureWarning, match=r"time_offsets\.moving\.apply\.retimed"),
          pytest.raises(InputError, match="no imu")):
        flight.retimed()
