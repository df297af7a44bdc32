"""Starts that look back only: nothing after the start can change them, and what they hold is known by hand."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight

from identification.naive import Naive
from nanobench_tools import UsageError, so3
from nanobench_tools.flight import Span
from nanobench_tools.protocols import backward, task1
from nanobench_tools.protocols.windows import cut_windows

SPANS = (Span(6.0, 12.0),)


def bent(flight, start_s, how):
    """All streams but the inputs changed after ``start_s``."""
    streams = {}
    for name, stream in flight.streams.items():
        values = stream.values.copy()
        if name not in ("motor", "battery"):
            values[stream.time_s > start_s + 1e-6] *= how
        streams[name] = replace(stream, values=values)
    return replace(flight, streams=streams)


@pytest.mark.parametrize("truth", ["onboard", "mocap"])
@pytest.mark.parametrize("past", [True, False])
def test_nothing_after_the_start_changes_it(truth, past):
    flight = made_flight()
    windows, _ = cut_windows(flight, SPANS, truth, past=past, start="past")
    k = 20
    start_s = 6.0 + k * 0.1
    again, came = cut_windows(bent(flight, start_s, -1.7), SPANS, truth, past=past, start="past")
    for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s", "motor", "battery_V"):
        assert np.array_equal(getattr(windows, name)[:k + 1], getattr(again, name)[:k + 1]), name
    if past:
        for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s", "specific_force_m_s2"):
            assert np.array_equal(getattr(windows.past, name)[:k + 1], getattr(again.past, name)[:k + 1]), name
    assert not np.array_equal(came.position_m[k], cut_windows(flight, SPANS, truth)[1].position_m[k])


def test_the_published_start_knows_what_comes():
    """The test above can fail: it does for stored velocities that are smoothed over what follows."""
    flight = made_flight()
    mocap = flight["mocap"]
    values = mocap.values.copy()
    at = [mocap.index(q) for q in ("vx", "vy", "vz")]
    values[2:-2, at] = (mocap["px", "py", "pz"][4:] - mocap["px", "py", "pz"][:-4]) / 0.04
    stored = flight.with_streams(mocap=replace(mocap, values=values))
    assert np.abs(cut_windows(stored, SPANS, "mocap")[0].velocity_m_s
                  - cut_windows(stored, SPANS, "mocap", start="past")[0].velocity_m_s).max() > 1e-4


@pytest.mark.parametrize("lost", [(), (3,), (2, 5, 6)])
def test_the_velocity_of_a_parabola_is_exact_whatever_rows_are_lost(lost):
    t = np.delete(5.0 + 0.01 * np.arange(40), [30 - k for k in lost])
    start, speed, acceleration = np.array([1.0, -2.0, 0.5]), np.array([0.3, 2.0, -1.0]), np.array([4.0, -3.0, 9.8])
    position = start + speed * t[:, None] + 0.5 * acceleration * t[:, None] ** 2
    rows = np.array([20, len(t) - 1])
    found = backward.velocity(t, position, rows, back=4)
    for i, row in enumerate(rows):
        np.testing.assert_allclose(found[i], speed + acceleration * t[row - 4:row + 1, None], atol=1e-9)


def test_the_first_rows_of_a_recording_give_what_they_can():
    t = 0.01 * np.arange(5)
    position = np.array([1.0, 2.0, 3.0]) + np.array([0.5, 0.0, -1.0]) * t[:, None]
    found = backward.velocity(t, position, np.array([0, 1, 4]))
    assert np.array_equal(found[0, 0], np.zeros(3))  # one pose tells no velocity
    np.testing.assert_allclose(found[2, 0], [0.5, 0.0, -1.0], atol=1e-9)


def test_a_row_counts_when_the_packet_after_it_has_surely_come():
    """Packets at 0, 40 and 70 ms, drawn onto rows of 10 ms: rows 4 and 7 bend."""
    flight = made_flight()
    rows = np.arange(12) * 0.01
    drawn = np.interp(rows, [0.0, 0.04, 0.07, 0.12], [0.0, 4.0, 1.0, 9.0])
    imu = replace(flight["imu"], time_s=rows, values=np.outer(drawn, np.ones(6)))
    mocap = flight["mocap"].rows(slice(0, 12))
    given = flight.with_streams(imu=imu, mocap=replace(mocap, time_s=rows))
    found = backward.newest(given, imu, np.array([0.0, 0.04, 0.05, 0.07, 0.08, 0.1]))
    assert found.tolist() == [0, 0, 3, 3, 6, 6]
    own = replace(imu, time_s=rows + 0.002)  # stamps of its own: what has a stamp has come
    assert backward.newest(given.with_streams(imu=own), own, np.array([0.021, 0.032])).tolist() == [1, 3]


def test_another_clock_does_not_reach_the_start():
    """Streams moved by a clock of the whole flight: the start takes them as they were recorded, what came is moved."""
    flight = made_flight()
    shifted = {name: s if name == "mocap" else replace(s, values=np.roll(s.values, -4, axis=0))
               for name, s in flight.streams.items()}
    moved = replace(flight, streams=shifted)
    plain, _ = cut_windows(flight, SPANS, "onboard", past=True, start="past")
    windows, came = cut_windows(moved, SPANS, "onboard", past=True, start="past", recorded=flight)
    assert np.array_equal(windows.rate_rad_s, plain.rate_rad_s)
    assert np.array_equal(windows.quaternion, plain.quaternion)
    assert np.array_equal(windows.past.rate_rad_s, plain.past.rate_rad_s)
    assert np.array_equal(came.rate_rad_s, cut_windows(moved, SPANS, "onboard")[1].rate_rad_s)


def test_attitude_is_carried_to_the_start_by_the_newest_rate():
    flight = made_flight()
    windows, _ = cut_windows(flight, SPANS, "onboard", start="past")
    centred, _ = cut_windows(flight, SPANS, "onboard")
    assert so3.geodesic_angle(windows.quaternion, centred.quaternion).max() < 1e-4
    assert np.array_equal(windows.position_m, centred.position_m)


def test_both_starts_judge_the_same_windows_and_unknown_ones_are_refused():
    case = task1.Case(made_flight(), SPANS, ("all",))
    counts = {start: task1.score(case, Naive(), "onboard", start).windows for start in ("centred", "past")}
    assert len(set(counts.values())) == 1
    with pytest.raises(UsageError, match="start is 'future'"):
        task1.score(case, Naive(), "onboard", "future")


@pytest.mark.slow
@pytest.mark.real
def test_on_real_flights_a_look_back_is_nearly_as_good_as_the_stored_velocity(real):
    """Mean difference of .007 m/s on training flights, the more the faster it accelerates."""
    flights, audits = real
    split = task1.split([f for f in flights if f.metadata.get("family") in ("circle", "star")], audits)
    apart = []
    for case in split.train:
        centred, past = (cut_windows(case.flight, case.spans, "onboard", start=start)[0].velocity_m_s
                         for start in ("centred", "past"))
        apart.append(np.linalg.norm(centred - past, axis=1))
    assert 0.002 < np.concatenate(apart).mean() < 0.012
