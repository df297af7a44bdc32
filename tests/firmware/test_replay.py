"""The control code against what real flights logged of it."""

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.firmware import motor_output
from nanobench_tools.firmware.records import CONTROL
from nanobench_tools.firmware.replay import MOTORS, build_of, flown_command, replay
from nanobench_tools.flight import Flight, Provenance, intersect_spans, make_stream, mask_of
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.units import PWM_FULL_SCALE

STREAMS = ("estimator", "attitude_qw", "imu", "setpoint", "motor", "battery", "pid")


@pytest.fixture
def steady():
    """A made recording of a hover at 3.6 V behind the released build."""
    t = np.arange(0.0, 8.0, 0.01)
    n, still = len(t), np.zeros((len(t), 3))
    counts = np.zeros((1, 4), np.int32)
    motor_output.drive_legacy(1000, np.array([(40000.0, 300, -200, 100)], CONTROL), np.float32([3.6]),
                        np.float32([3.6]), motor_output.BUILD, counts)
    ones = np.ones((n, 1))
    return Flight("steady", {
        "estimator": make_stream("estimator", t, np.hstack([still, still]), ("x", "y", "z", "vx", "vy", "vz")),
        "attitude_qw": make_stream("attitude_qw", t, np.hstack([still, ones]), ("qx", "qy", "qz", "qw")),
        "imu": make_stream("imu", t, still, ("gyro_x", "gyro_y", "gyro_z")),
        "setpoint": make_stream("setpoint", t, still, ("x", "y", "z")),
        "motor": make_stream("motor", t, ones * counts / PWM_FULL_SCALE, MOTORS),
        "battery": make_stream("battery", t, 3.6 * ones, ("vbat",)),
        "pid": make_stream("pid", t, ones * [0.0, 0.0, 0.0, 40000.0 / PWM_FULL_SCALE],
                           ("roll", "pitch", "yaw", "cmd_thrust"))}, {}, Provenance("steady.csv", "", "made"))


def flown(folder, name):
    flight = load_recordings([folder / "nanobench" / "datasets" / "dataset" / f"{name}.csv.xz"]).flights[0]
    verdict = audit(flight)
    spans = intersect_spans(verdict.airborne, verdict.clean_for(STREAMS))
    return flight, verdict.controller, lambda t: mask_of(spans, t) & (t > verdict.airborne[0].start_s + 2.0)


@pytest.mark.real
@pytest.mark.parametrize(("name", "build"), [("B2_circle_fast_rep3", motor_output.BUILD),
                                             ("B2_circle_fast_rep2", motor_output.EARLIER_BUILD)])
def test_pid_flights_logged_what_the_code_commands(real_data, name, build):
    flight, controller, judged = flown(real_data, name)
    assert controller == "pid"
    np.testing.assert_array_equal(build_of(flight), build)
    found = replay(flight, "pid", build)
    rows = judged(found.time_s)
    assert rows.sum() > 2000
    for k, axis in enumerate(("roll", "pitch")):
        logged = flight["pid"].interpolate(axis, found.time_s)
        assert np.corrcoef(found.attitude_rad[rows, k], logged[rows])[0, 1] > 0.99
    command = PWM_FULL_SCALE * flight["pid"].interpolate("cmd_thrust", found.time_s)
    volt = flight["battery"].interpolate("vbat", found.time_s).astype(np.float32)
    flown_pwm, pwm = (motor_output.compensated(x.astype(np.float32), volt, *build[0])
                      for x in (flown_command(flight, found.time_s, build), command))
    free = rows & (flight["motor"].interpolate(MOTORS, found.time_s).max(axis=1) < 0.97)
    assert abs(np.median((flown_pwm - pwm)[free])) < 40.0  # of about 55,000


@pytest.mark.real
def test_a_mellinger_flight_logged_what_the_code_commands(real_data):
    flight, controller, judged = flown(real_data, "B8_star_medium_rep2")
    assert controller == "mellinger"
    found = replay(flight, "mellinger")
    rows = judged(found.time_s)
    logged = flight["motor"].interpolate(MOTORS, found.time_s)
    away = PWM_FULL_SCALE * (found.motor - logged)[rows]
    assert rows.sum() > 2000
    assert abs(np.mean(away)) < 1500.0
    assert np.isnan(found.attitude_rad).all()


def test_incomplete_flights_are_refused(steady):
    np.testing.assert_array_equal(build_of(steady), motor_output.BUILD)
    assert build_of(steady.without_streams("pid")) is None
    with pytest.raises(InputError, match="has no stream battery"):
        replay(steady.without_streams("battery"), "pid")
