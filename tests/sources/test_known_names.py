"""The tables of names: what they give exists, and readers and ``nanobench columns`` use the same."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.flight import STREAM_QUANTITIES
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources.axes import frame_of
from nanobench_tools.sources.bag_choice import IMU, KNOWN, POSES
from nanobench_tools.sources.column_map import allowed_units
from nanobench_tools.sources.column_names import known_names, recognised
from nanobench_tools.sources.known import ecosystem, keys
from nanobench_tools.sources.ulog_motors import PX4_QUAD_X
from nanobench_tools.sources.ulog_topics import topics_of


@pytest.mark.parametrize("key", keys())
def test_every_name_gives_what_exists(key):
    for known in ecosystem(key).names:
        if known.stream:
            assert known.quantity in STREAM_QUANTITIES[known.stream], known
            assert known.unit in ("", "rpm", "pulse_us", "pwm16", *allowed_units(known.stream, known.quantity)), known
        else:
            assert known.what or known.quantity == "time", known
        if known.frame:
            assert frame_of(known.frame).name == known.frame


def test_the_readers_orders_are_those_of_the_tables():
    assert POSES[0] == "geometry_msgs/msg/PoseStamped"
    assert {*POSES, IMU, "sensor_msgs/msg/BatteryState"} == KNOWN
    assert PX4_QUAD_X == (0, 3, 1, 2)
    assert topics_of("mocap")[:2] == ("vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")
    assert topics_of("imu")[:2] == ("sensor_combined", "vehicle_imu")


def test_increments_alone_are_no_rates():
    """What needs more of the message than its column: tables say what it is, and leave it out."""
    names = [f"delta_angle[{k}]" for k in range(3)]
    found = known_names(names, recognised(names, "vehicle_imu"))
    assert {known.what for known, _ in found.values()} == {"increment of an angle, rad, over delta_angle_dt"}
    assert not ecosystem("px4").assign(names)


def test_a_stand_needs_no_map(tmp_path):
    path = tmp_path / "stand.csv"
    path.write_text("pwm,vbat[V],rpm1,thrust[g]\n" + "30000,4.0,12000,20\n" * 50)
    with pytest.raises(InputError, match="thrust stand, which has no time and needs no map; nanobench thrust"):
        draft_columns(path)


def test_a_set_point_of_px4_keeps_its_yaw(tmp_path):
    t = np.arange(5e6, 7e6, 2e4)
    rows = np.column_stack([t, np.sin(1e-6 * t), np.cos(1e-6 * t), np.full(len(t), -1.0), np.full(len(t), 0.3)])
    path = tmp_path / "log_vehicle_local_position_setpoint_0.csv"
    np.savetxt(path, rows, delimiter=",", header="timestamp,x,y,z,yaw", comments="")
    draft = draft_columns(path)
    assert draft.mapped["setpoint", "yaw"] == ("yaw", "rad")
    assert 'frame = "NED/FRD"' in draft.text
