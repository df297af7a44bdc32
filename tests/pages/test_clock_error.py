"""A flight's clock error and the position error it makes, against a flight whose clock error is known."""

import re
from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.flight import make_stream
from nanobench_tools.pages.clock_error import clock_error, typical

OWN_S = 0.02


def late(flight):
    """The flight with an estimate 20 ms behind, stamped late by a saw-tooth of up to 40 ms; and that saw-tooth."""
    truth = flight["mocap"]
    t = truth.time_s
    points = [[float(k), 0.04 * (k % 2), 0.001] for k in range(21)]
    d = np.interp(t, *np.array(points)[:, :2].T)
    path = np.column_stack([np.interp(t - d - OWN_S, t, truth["px", "py", "pz"][:, i]) for i in range(3)])
    streams = {**flight.streams, "estimator": make_stream("estimator", t, path, ("x", "y", "z"), rate_hz=100.0)}
    return replace(flight, streams=streams), points


def entry_of(make, flight):
    return {**make.entry(flight), "faults": []}


def test_what_the_clock_makes_is_found_and_the_estimators_own_delay_with_it(make):
    flight, points = late(make.flight())
    found = clock_error(flight, entry_of(make, flight), {"moving": True, "warp": points, "wander_sd_s": 0.02})
    own, rms, constant, before, left = map(float, re.findall(r"(-?[\d.]+) m[ms]", found.note))
    assert own == pytest.approx(1e3 * OWN_S, abs=0.5)
    assert constant == pytest.approx(40.0, abs=2.0)
    assert left < 0.1 * before
    assert before < rms
    clock, track = found.panels
    assert clock.marks[0].y == pytest.approx([0.0, 40.0] * 10 + [0.0])
    assert [mark.name for mark in track.marks] == ["estimate behind the vehicle, measured",
                                                   "d(t) and the estimator's own delay, times speed"]


def test_a_clock_that_the_position_set_makes_no_picture(make):
    flight, points = late(make.flight())
    entry = entry_of(make, flight)
    entry["clock"]["imu"] = {**entry["clock"]["imu"], "warp": points}
    assert clock_error(flight, entry, None) is None


@pytest.mark.parametrize("streams", [("mocap",), ("estimator", "motor"), ("mocap", "motor", "battery")])
def test_without_position_or_truth_there_is_no_picture(make, streams):
    flight = make.flight(streams=streams)
    assert clock_error(flight, {}, {"moving": True, "warp": [[0.0, 0.0, 0.01], [9.0, 0.03, 0.01]]}) is None


def test_no_moving_error_makes_no_picture(make):
    flight = make.flight()
    assert clock_error(flight, make.entry(flight), {"moving": False, "warp": [], "reason": "not confirmed"}) is None


def test_the_flight_shown_is_of_the_longer_half_the_one_with_median_wander():
    lengths = {"a": 30.0, "b": 31.0, "c": 32.0, "d": 5.0, "e": 6.0, "f": 90.0}
    wander = {"a": 0.05, "b": 0.03, "c": 0.01, "d": 0.02, "e": 0.03, "f": 0.04}
    entries = {name: {"airborne": [[0.0, s]]} for name, s in lengths.items()}
    taken = {name: {"moving": name != "f", "warp": [[0, 0, 0]], "wander_sd_s": w} for name, w in wander.items()}
    assert typical(entries, taken) == "b"
    assert typical(entries, {"f": taken["f"], "gone": taken["a"], "none": None}) is None
