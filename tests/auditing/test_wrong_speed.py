"""A rotor speed sensor that misses pulses is told from a motor that is asked for less."""

import numpy as np
import pytest

from nanobench_tools.auditing.faults import wrong_speed
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.context import Context

MOTORS = ("m1", "m2", "m3", "m4")


def _flight(change=None, command=None):
    t = np.arange(0.0, 8.0, 0.002)
    rng = np.random.default_rng(3)
    asked = 0.7 + 0.03 * np.sin(4.0 * t)[:, None] * np.array([1.0, -1.0, 1.0, -1.0])
    if command is not None:
        command(t, asked)
    speed = 2900.0 * asked**0.7 + 20.0 * rng.standard_normal(asked.shape)
    if change is not None:
        change(t, speed)
    streams = {"rpm": make_stream("rpm", t, speed, MOTORS), "motor": make_stream("motor", t, asked, MOTORS)}
    return Flight("made", streams, {}, Provenance("made", "", "test"))


def _found(flight):
    return wrong_speed.find(flight, Context(flight))


def test_a_sensor_that_drops_to_zero_or_half_is_found():
    def change(t, speed):
        speed[(t > 2.0) & (t < 3.0), 2] = 0.0
        speed[(t > 5.0) & (t < 6.0), 2] *= 0.5

    (fault,) = _found(_flight(change))
    assert fault.columns == ("m3",)
    assert fault.size == pytest.approx(0.25, abs=0.02)
    assert fault.start_s == pytest.approx(2.0, abs=0.06)
    assert "nothing in 50%" in fault.evidence
    assert "0.50 of" in fault.evidence


def test_motors_that_agree_are_no_fault():
    assert _found(_flight()) == []


def test_a_motor_that_is_asked_for_less_turns_slower():
    def command(t, asked):
        asked[(t > 2.0) & (t < 4.0), 1] *= 0.3

    assert _found(_flight(command=command)) == []


def test_a_weak_motor_is_no_wrong_sensor():
    assert _found(_flight(lambda t, speed: speed.__setitem__((slice(None), 0), 0.8 * speed[:, 0]))) == []


@pytest.mark.real
def test_real_logs_with_one_bad_sensor(real_data):
    from nanobench_tools.sources.discover import load_recordings

    place = real_data / "crazyflie_usd" / "brushed_flights"
    bad, good = (load_recordings([place / name], cache=False).flights[0] for name in ("jana20", "jana00"))
    assert [f.columns for f in _found(bad)] == [("rpm.m1",)]
    assert _found(good) == []
