"""Which topics of a bag make which stream of which vehicle, from names and types; a doubt is asked."""

from __future__ import annotations

import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.sources.bag_choice import IMU, POSES, choose, vehicles_in
from nanobench_tools.sources.bag_topics import Role, Topic

POSE, TRANSFORM, _, ODOMETRY, _ = POSES


@pytest.mark.parametrize(("name", "kind", "role"), [
    ("/vrpn_client_node/uav1/pose", POSE, Role.TRACKER), ("/vicon/cf/cf", TRANSFORM, Role.TRACKER),
    ("/mavros/vision_pose/pose", POSE, Role.FORWARDED), ("/mavros/mocap/pose", POSE, Role.FORWARDED),
    ("/mavros/local_position/pose", POSE, Role.ESTIMATE), ("/vins_estimator/odometry", ODOMETRY, Role.ESTIMATE),
    ("/hummingbird/ground_truth/odometry", ODOMETRY, Role.TRACKER), ("/uav1/pose", POSE, Role.UNKNOWN),
    ("/mavros/setpoint_position/local", POSE, Role.SETPOINT), ("/uav1/reference", POSE, Role.SETPOINT),
    ("/planner/desired_pose", POSE, Role.SETPOINT), ("/move_base_simple/goal", POSE, Role.SETPOINT),
    ("/blackbird/state", POSE, Role.TRACKER),
    ("/cf1/cmd_pose", POSE, Role.SETPOINT), ("/vicon/target/pose", POSE, Role.NONE),
    ("/carrot/pose", POSE, Role.SETPOINT), ("/mpc/horizon", POSE, Role.SETPOINT),
])
def test_roles(name, kind, role):
    assert Topic(name, kind).role is role


def streams(*topics, chosen=None, moved=None):
    """label -> {stream: topic}."""
    found = [Topic(*t) for t in topics]
    return {v.label: {s: t.name for s, t in choose(found, v, chosen or {}, "bag", moved or {}).streams.items()}
            for v in vehicles_in(found, moved or {})}


def test_the_tracker_is_the_truth_and_the_filter_the_estimate():
    assert streams(("/mavros/setpoint_position/local", POSE), ("/optitrack/drone/pose", POSE),
                   ("/mavros/local_position/pose", POSE), ("/mavros/local_position/odom", ODOMETRY),
                   ("/mavros/global_position/local", ODOMETRY), ("/mavros/imu/data", IMU),
                   ("/mavros/imu/data_raw", IMU), ("/camera/imu", IMU)) == {
        "": {"mocap": "/optitrack/drone/pose", "estimator": "/mavros/local_position/odom", "imu": "/mavros/imu/data",
             "setpoint": "/mavros/setpoint_position/local"}}


def test_an_estimate_alone_is_no_motion_capture():
    assert streams(("/mavros/local_position/pose", POSE)) == {"": {"estimator": "/mavros/local_position/pose"}}


def test_two_vehicles_by_namespace_and_by_body():
    by_name = streams(("/vicon/uav1/pose", POSE), ("/vicon/uav2/pose", POSE), ("/uav1/mavros/imu/data", IMU),
                      ("/uav2/mavros/imu/data", IMU))
    assert by_name == {"uav1": {"mocap": "/vicon/uav1/pose", "imu": "/uav1/mavros/imu/data"},
                       "uav2": {"mocap": "/vicon/uav2/pose", "imu": "/uav2/mavros/imu/data"}}
    bodies = [(f"/{topic}:{body}", kind, body, "world") for body in ("cf1", "cf2")
              for topic, kind in (("poses", POSE), ("tf", TRANSFORM))]
    assert streams(*bodies) == {"cf1": {"mocap": "/poses:cf1"}, "cf2": {"mocap": "/poses:cf2"}}


def test_a_place_is_no_estimate():
    """A pose without a known word is one only if it moves, and the choice states it."""
    topics = (("/vicon/uav1/pose", POSE), ("/landing_pad/pose", POSE))
    moved = {"/vicon/uav1/pose": 2.0, "/landing_pad/pose": 0.001}
    assert streams(*topics, moved=moved) == {"": {"mocap": "/vicon/uav1/pose"}}
    moved["/landing_pad/pose"] = 2.0
    assert streams(*topics, moved=moved)[""]["estimator"] == "/landing_pad/pose"
    found = [Topic(*t) for t in topics]
    left = choose(found, vehicles_in(found, moved)[0], {}, "bag", moved).left
    assert any("is taken for the vehicle's estimate" in sentence for sentence in left)


def test_furniture_is_no_vehicle():
    found = streams(("/vrpn/uav1/pose", POSE), ("/vrpn/gate/pose", POSE), ("/mavros/imu/data", IMU),
                    moved={"/vrpn/uav1/pose": 2.0, "/vrpn/gate/pose": 0.001})
    assert found == {"": {"mocap": "/vrpn/uav1/pose", "imu": "/mavros/imu/data"}}


def test_a_doubt_lists_the_topics_and_a_map_settles_it():
    topics = (("/vicon/cf1/pose", POSE), ("/optitrack/cf1/pose", POSE))
    with pytest.raises(InputError) as refused:
        streams(*topics)
    assert "/vicon/cf1/pose" in str(refused.value)
    assert "/optitrack/cf1/pose" in str(refused.value)
    assert "[streams] mocap = " in str(refused.value)
    assert streams(*topics, chosen={"mocap": "/vicon/cf1/pose"}) == {"": {"mocap": "/vicon/cf1/pose"}}


def test_the_imu_of_a_lidar_is_not_the_vehicles():
    """NTU VIRAL: the inertial sensors of two lidars beside the vehicle's, and a prism as truth."""
    found = streams(("/imu/imu", IMU), ("/os1_cloud_node1/imu", IMU), ("/os1_cloud_node2/imu", IMU),
                    ("/leica/pose/relative", POSE), moved={"/leica/pose/relative": 5.0})
    assert found == {"": {"imu": "/imu/imu", "mocap": "/leica/pose/relative"}}


def test_several_imus_on_board_are_one_vehicle():
    """INSANE: the autopilot's inertial sensor, one on a board of its own, and a camera's."""
    found = streams(("/mavros/imu/data_raw", IMU), ("/imu_lsm9ds1/data_raw", IMU), ("/realsense/imu", IMU),
                    ("/vrpn_client/raw_transform", POSE), ("/realsense/odom/sample", POSE),
                    moved={"/vrpn_client/raw_transform": 5.0, "/realsense/odom/sample": 5.0})
    assert found == {"": {"imu": "/mavros/imu/data_raw", "mocap": "/vrpn_client/raw_transform",
                          "estimator": "/realsense/odom/sample"}}
