"""Frames by the names of their axes: worked by hand, and through rotations that know nothing of the names."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.flight import make_stream
from nanobench_tools.sources.axes import frame_of, in_our_axes


def stream(name, **columns):
    n = len(next(iter(columns.values())))
    return make_stream(name, np.arange(n) / 100.0, np.stack(list(columns.values()), axis=1), list(columns))


def test_north_east_down_is_worked_by_hand():
    found = in_our_axes(stream("estimator", x=[1.0], y=[2.0], z=[-3.0], vx=[4.0], vy=[5.0], vz=[6.0]), frame_of("NED"))
    assert found.quantities == ("x", "y", "z", "vx", "vy", "vz")
    np.testing.assert_allclose(found.values, [[2.0, 1.0, 3.0, 5.0, 4.0, -6.0]])


def test_forward_right_down_at_rest_measures_gravity_upward():
    found = in_our_axes(stream("imu", acc_x=[0.1], acc_y=[0.2], acc_z=[-9.81], gyro_y=[1.0]), frame_of("FRD"))
    np.testing.assert_allclose(found["acc_x", "acc_y", "acc_z"], [[0.1, -0.2, 9.81]])
    np.testing.assert_allclose(found["gyro_y"], [-1.0])


@pytest.mark.parametrize(("heading_deg", "yaw_deg"), [(0.0, 90.0), (90.0, 0.0), (-90.0, 180.0)])
def test_a_level_vehicle_that_faces_north_has_yaw_90(heading_deg, yaw_deg):
    q = Rotation.from_euler("z", heading_deg, degrees=True).as_quat()  # FRD to NED
    parts = dict(zip(("qx", "qy", "qz", "qw"), np.atleast_2d(q).T, strict=True))
    found = in_our_axes(stream("attitude_qw", **parts), frame_of("NED/FRD"))
    roll, pitch, yaw = np.degrees(so3.euler_zyx(found.values[0]))
    np.testing.assert_allclose([roll, pitch], 0.0, atol=1e-9)
    assert abs((yaw - yaw_deg + 180.0) % 360.0 - 180.0) < 1e-9
    alone = in_our_axes(stream("setpoint", yaw=[np.radians(heading_deg)]), frame_of("NED/FRD"))
    assert abs((np.degrees(alone["yaw"][0]) - yaw_deg + 180.0) % 360.0 - 180.0) < 1e-9


@pytest.mark.parametrize("name", ["NED/FRD", "EUS/FUR", "NWU/RFU", "ENU/URF", "ENU/RDF"])
def test_body_vectors_point_the_same_way_in_the_world(name):
    """A body vector turned into the world and then into ours is the same as both turned first."""
    frame = frame_of(name)
    rng = np.random.default_rng(1)
    turns = Rotation.random(20, rng=rng)
    body = rng.normal(size=(20, 3))
    world = turns.apply(body)
    parts = dict(zip(("qx", "qy", "qz", "qw"), turns.as_quat().T, strict=True))
    q = in_our_axes(stream("attitude_qw", **parts), frame).values
    ours = in_our_axes(stream("imu", **dict(zip(("gyro_x", "gyro_y", "gyro_z"), body.T, strict=True))), frame)
    there = in_our_axes(stream("mocap", **dict(zip(("px", "py", "pz"), world.T, strict=True))), frame)
    np.testing.assert_allclose(so3.rotate(q, ours["gyro_x", "gyro_y", "gyro_z"]), there["px", "py", "pz"], atol=1e-12)


def test_y_up_becomes_z_up():
    found = in_our_axes(stream("mocap", px=[1.0], py=[2.0], pz=[3.0]), frame_of("EUS/FUR"))
    np.testing.assert_allclose(found["px", "py", "pz"], [[1.0, -3.0, 2.0]])


def test_euler_angles_follow_their_quaternion():
    angles = np.radians([[10.0, -20.0, 30.0], [-5.0, 15.0, 170.0]])
    q = so3.from_euler_zyx(*angles.T)
    parts = dict(zip(("qx", "qy", "qz", "qw"), q.T, strict=True))
    euler = dict(zip(("roll", "pitch", "yaw"), angles.T, strict=True))
    found = in_our_axes(stream("mocap", **parts, **euler), frame_of("NED/FRD"))
    np.testing.assert_allclose(so3.euler_zyx(found["qx", "qy", "qz", "qw"]), found["roll", "pitch", "yaw"])


def test_a_row_without_a_rotation_stays_without_one():
    q = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0], [np.nan] * 4])
    parts = dict(zip(("qx", "qy", "qz", "qw"), q.T, strict=True))
    found = in_our_axes(stream("attitude_qw", **parts), frame_of("NED/FRD"))
    assert np.isfinite(found.values).all(axis=1).tolist() == [True, False, False]


@pytest.mark.parametrize("name", ["NEU", "FLD", "NED/", "XYZ", "NE", "", "NED/FRD/FLU", "NNU"])
def test_left_handed_and_unknown_axes_are_refused(name):
    with pytest.raises(UsageError, match="right-handed"):
        frame_of(name)


def test_what_cannot_be_turned_alone_is_refused():
    with pytest.raises(UsageError, match="without qx, qy, qz"):
        in_our_axes(stream("attitude_qw", qw=[1.0]), frame_of("NED/FRD"))
    with pytest.raises(UsageError, match="without yaw"):
        in_our_axes(stream("attitude", roll=[0.1], pitch=[0.2]), frame_of("NED/FRD"))
