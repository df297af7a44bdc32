"""A flight's clock error and the position error it makes, against a flight whose clock error is known."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.flight import make_stream
from nanobench_tools.report.clock_error import clock_error, typical

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
    body = clock_error(flight, entry_of(make, flight), {"moving": True, "warp": points, "wander_sd_s": 0.02})
    assert body["own_ms"] == pytest.approx(1e3 * OWN_S, abs=0.5)
    assert body["rms_left_mm"] < 0.1 * body["rms_constant_mm"]
    assert body["rms_constant_mm"] < body["rms_mm"]
    assert body["constant_ms"] == pytest.approx(40.0, abs=2.0)


def test_a_clock_that_the_position_set_is_drawn_without_the_position_error(make):
    flight, points = late(make.flight())
    entry = entry_of(make, flight)
    entry["clock"]["imu"] = {**entry["clock"]["imu"], "warp": points}
    body = clock_error(flight, entry, None)
    assert body["apart"] is False
    assert "measured" not in body
    assert "rms_mm" not in body


@pytest.mark.parametrize("streams", [("mocap",), ("estimator", "motor"), ("mocap", "motor", "battery")])
def test_without_position_or_truth_the_clock_alone_is_drawn(make, streams):
    flight = make.flight(streams=streams)
    body = clock_error(flight, {}, {"moving": True, "warp": [[0.0, 0.0, 0.01], [9.0, 0.03, 0.01]]})
    assert "d" in body
    assert "measured" not in body


def test_no_moving_error_is_said_with_its_reason(make):
    flight = make.flight()
    constant = {"moving": False, "warp": [], "reason": "no moving error confirmed; the constant is used"}
    assert "no moving error confirmed" in clock_error(flight, make.entry(flight), constant)["absent"]
    assert clock_error(flight, {}, None)["absent"].startswith("No moving clock error")


def test_the_flight_shown_is_of_the_longer_half_the_one_with_median_wander():
    lengths = {"a": 30.0, "b": 31.0, "c": 32.0, "d": 5.0, "e": 6.0, "f": 90.0}
    wander = {"a": 0.05, "b": 0.03, "c": 0.01, "d": 0.02, "e": 0.03, "f": 0.04}
    entries = {name: {"airborne": [[0.0, s]]} for name, s in lengths.items()}
    taken = {name: {"moving": name != "f", "warp": [[0, 0, 0]], "wander_sd_s": w} for name, w in wander.items()}
    assert typical(entries, taken) == "b"
    assert typical(entries, {"f": taken["f"], "gone": taken["a"], "none": None}) is None
