"""Reported bags: the right value of each, as its expect.md states it."""

import numpy as np
import pytest

from nanobench_tools.sources import load_recordings


@pytest.mark.real
def test_two_clocks_are_put_on_that_of_the_recorder(reported):
    (flight,) = load_recordings([reported / "bag_clocks_do_not_overlap/flight.mcap"], cache=False).flights
    imu, mocap = flight["imu"].span, flight["mocap"].span
    assert abs(imu.start_s - mocap.start_s) < 0.1
    assert abs(imu.end_s - mocap.end_s) < 0.1
    assert any("/mavros/imu/data" in note and "received" in note for note in flight.provenance.notes)


@pytest.mark.real
def test_the_tracker_and_not_the_set_point(reported):
    (flight,) = load_recordings([reported / "bag_setpoint_as_truth/flight.mcap"], cache=False).flights
    assert flight["mocap"]["pz"].max() == pytest.approx(1.0, abs=0.01)
    assert flight.metadata["topics"]["mocap"] == "/vrpn_client_node/uav1/pose"


@pytest.mark.real
@pytest.mark.parametrize("columns", [None, "map.toml"])
def test_two_crazyflies_are_two_flights(reported, columns):
    folder = reported / "crazyswarm2_bag"
    loaded = load_recordings([folder / "flight.mcap"], columns=columns and folder / columns, cache=False)
    first, second = (flight["mocap"]["px", "py", "pz"] for flight in loaded.flights)
    assert [f.name for f in loaded.flights] == ["flight.cf1", "flight.cf2"]
    assert np.abs(first[0, 0]) < 0.01
    assert second[0, 0] == pytest.approx(1.5, abs=0.01)
    assert max(np.linalg.norm(np.diff(p, axis=0), axis=1).max() for p in (first, second)) < 0.3


@pytest.mark.real
def test_a_known_type_needs_no_definition(reported):
    folder = reported / "db3_without_definitions"
    (flight,) = load_recordings([folder / "flight.db3"], columns=folder / "map.toml", cache=False).flights
    assert flight["imu"]["acc_z"].mean() == pytest.approx(9.81, abs=0.1)
