"""Tracked positions without attitude join a log by their speeds."""

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.time_offsets.moving.pairing import with_mocap

YAW = 0.7
TURN = np.array([[np.cos(YAW), -np.sin(YAW), 0.0], [np.sin(YAW), np.cos(YAW), 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def flight(crowd):
    return crowd.log("fast figure_eight")[0]


def tracked(flight, late_s=-321.7):
    mocap = flight["mocap"]
    values = mocap["px", "py", "pz"] @ TURN.T + [1.0, 2.0, 0.1]
    values[50:80] = np.nan
    stream = make_stream("mocap", mocap.time_s + late_s, values, ("px", "py", "pz"))
    return Flight("mocap01", {"mocap": stream}, {}, Provenance("mocap01.npy", "", "npy_mocap"))


def test_positions_get_the_clock_and_the_heading_of_the_log(flight):
    both = with_mocap(flight.without_streams("mocap"), tracked(flight))
    error_s = both["mocap"].time_s - flight["mocap"].time_s
    assert np.ptp(error_s) < 1e-9
    assert -0.005 < error_s[0] < 0.05  # the estimate's own delay is in it
    apart = both["mocap"]["px", "py", "pz"] - flight["mocap"]["px", "py", "pz"]
    assert np.nanmax(np.abs(apart - np.nanmean(apart, axis=0))) < 0.1
    assert "The delay of the estimate is part of this offset" in both.provenance.notes[-1]


def test_positions_of_another_flight_do_not_meet(flight, crowd):
    other = crowd.log("star")[0]
    with pytest.raises(InputError, match=r"mocap01\.npy"):
        with_mocap(flight.without_streams("mocap"), tracked(other))


def test_a_log_without_estimated_positions_is_refused(flight):
    with pytest.raises(InputError, match="no estimated position"):
        with_mocap(flight.without_streams("mocap", "estimator"), tracked(flight))
