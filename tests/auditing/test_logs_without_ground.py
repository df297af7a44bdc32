"""A log that is switched on in the air never shows the ground; motors that carry a moving vehicle are the evidence."""

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, Span, make_stream


def _flight(position, command, seconds=9.0, extra=None):
    t = np.arange(0.0, seconds, 0.01)
    p = np.broadcast_to(np.stack(position(t), axis=1), (len(t), 3))
    m = np.repeat(command(t)[:, None], 4, axis=1)
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))
    streams = {"mocap": make_stream("mocap", t, np.column_stack([p, level]), ("px", "py", "pz", "qx", "qy", "qz", "qw"),
                                    rate_hz=100.0),
               "motor": make_stream("motor", t, m, ("m1", "m2", "m3", "m4"), rate_hz=100.0), **(extra or {})}
    return Flight("made", streams, {}, Provenance("made", "", "test"))


def _noise(t, size=1e-3):
    return size * np.random.default_rng(5).standard_normal(t.shape)


def _still(t):
    return _noise(t), _noise(t + 1.0), 0.44 + _noise(t)


def _eight(t):
    return np.sin(t), 0.5 * np.sin(2.0 * t), 0.44 + 0.02 * np.sin(0.7 * t) + _noise(t)


def _carrying(t):
    return 0.41 + 0.01 * np.sin(9.0 * t)


def _kinds(flight):
    found = audit(flight)
    return {f.kind for f in found.faults}, found.airborne


def test_a_figure_eight_at_one_height_flew_from_the_first_row_to_the_last():
    kinds, airborne = _kinds(_flight(_eight, _carrying))
    assert "never_flew" not in kinds
    assert airborne == (Span(0.0, pytest.approx(8.99)),)


def test_motors_that_carry_on_a_vehicle_that_stands_are_a_test_on_the_ground():
    kinds, airborne = _kinds(_flight(_still, _carrying))
    assert "never_flew" in kinds
    assert airborne == ()


def test_a_vehicle_carried_about_with_its_motors_off_never_flew():
    kinds, _ = _kinds(_flight(_eight, lambda t: np.zeros_like(t)))
    assert "never_flew" in kinds


def test_where_motors_stop_the_ground_was_seen_and_height_alone_tells():
    """Slid along the floor for a while: no more than 2 cm high, motors off before and after."""
    kinds, _ = _kinds(_flight(_eight, lambda t: np.where((t > 1.0) & (t < 8.0), _carrying(t), 0.0)))
    assert "never_flew" in kinds


def test_a_take_off_is_no_log_without_the_ground():
    def position(t):
        x, y, _ = _eight(t)
        rise = np.clip(t - 0.6, 0.0, 1.0)
        return rise * x, rise * y, 0.5 * rise + _noise(t)

    _, airborne = _kinds(_flight(position, _carrying))
    assert len(airborne) == 1
    assert airborne[0].start_s == pytest.approx(0.72, abs=0.02)


def test_a_log_that_sinks_below_where_it_began_is_whole():
    def position(t):
        x, y, z = _eight(t)
        return x, y, z - 0.02 * np.sin(np.pi * t / 9.0) + 0.1 * np.exp(-((t - 4.0) ** 2))

    kinds, airborne = _kinds(_flight(position, _carrying))
    assert "never_flew" not in kinds
    assert airborne[0].duration_s == pytest.approx(8.99)


@pytest.mark.real
def test_real_logs_that_begin_in_the_air(real_data):
    from nanobench_tools.sources.discover import load_recordings

    place = real_data / "crazyflie_usd"
    flights = load_recordings([place / "brushless_flights" / "eckart01", place / "brushed_flights" / "jana10"],
                              cache=False).flights
    for flight in flights:
        kinds, airborne = _kinds(flight)
        assert "never_flew" not in kinds
        assert airborne[0].duration_s > 0.98 * flight.span.duration_s
