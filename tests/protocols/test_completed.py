"""What recordings lack and Task 1 needs: added from the poses, or assumed and said."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.flight import Flight
from nanobench_tools.protocols.completed import additions, completed


@pytest.fixture(scope="module")
def flight(crowd) -> Flight:
    return crowd.flight("short circle")


def only_poses(flight: Flight) -> Flight:
    mocap = flight["mocap"]
    keep = [mocap.index(name) for name in ("px", "py", "pz", "qx", "qy", "qz", "qw")]
    bare = replace(mocap, values=mocap.values[:, keep], columns=tuple(mocap.columns[i] for i in keep),
                   quantities=tuple(mocap.quantities[i] for i in keep), unit=tuple(mocap.unit[i] for i in keep))
    return replace(flight.without_streams("attitude_qw"), streams={
        **flight.without_streams("attitude_qw").streams, "mocap": bare})


def test_a_whole_recording_is_left_alone(flight):
    assert completed([flight])[0] is flight


def test_velocity_and_attitude_follow_from_the_poses(flight):
    found = completed([only_poses(flight)])[0]
    off = found["mocap"]["vx", "vy", "vz"] - flight["mocap"]["vx", "vy", "vz"]
    assert np.sqrt(np.mean(off[20:-20] ** 2)) < 0.005
    np.testing.assert_array_equal(found["attitude_qw"].values, flight["mocap"]["qx", "qy", "qz", "qw"])
    assert [text.split()[0] for text in additions([found, found])] == ["onboard", "velocity"]


def test_a_gap_gives_finite_velocity_on_both_sides(flight):
    bare = only_poses(flight)
    t = bare["mocap"].time_s
    holed = replace(bare, streams={**bare.streams, "mocap": bare["mocap"].rows((t < t[300]) | (t > t[330]))})
    assert np.isfinite(completed([holed])[0]["mocap"].values).all()


def test_a_battery_voltage_is_assumed_only_where_no_flight_has_one(flight):
    without = flight.without_streams("battery")
    both = completed([flight, without])
    assert "battery" not in both[1]
    alone = completed([without])[0]
    assert set(alone["battery"]["vbat"]) == {3.7}
    assert alone["battery"].time_s[[0, -1]] == pytest.approx(without["motor"].time_s[[0, -1]])
    assert "3.7 V is assumed" in additions([alone])[0]


def test_without_motion_capture_nothing_can_be_added(flight):
    without = flight.without_streams("mocap")
    assert completed([without])[0] is without
