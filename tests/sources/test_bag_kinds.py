"""Bags as programs write them, against the motion that is in them: read right, or reported."""

from __future__ import annotations

import numpy as np
import pytest
from bag_samples import bag, inertial, motion, noisy, odometry, poses
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.sources import load_recordings

FRD = np.array([1.0, -1.0, -1.0])


def one(folder):
    loaded = load_recordings([folder], cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    return flight


def faults(flight):
    """(kind, stream) of what is wrong."""
    return {(f.kind, f.stream) for f in audit(flight).faults}


def test_a_flight_without_a_fault_has_none(tmp_path):
    flight = one(bag(tmp_path, vicon__cf__pose=poses(), cf__imu=inertial()))
    assert flight.metadata["topics"] == {"mocap": "/vicon/cf/pose", "imu": "/cf/imu"}
    assert faults(flight) == set()


@pytest.mark.parametrize("in_the_world", [False, True])
@pytest.mark.slow
def test_the_velocity_of_an_odometry_is_what_the_path_moves_by(tmp_path, in_the_world):
    """It belongs in the body, and many write it in the world."""
    m = motion()
    written = m.velocity_m_s if in_the_world else Rotation.from_quat(m.quaternion).inv().apply(m.velocity_m_s)
    flight = one(bag(tmp_path, vins__odometry=odometry(written), vicon__cf__pose=poses()))
    np.testing.assert_allclose(flight["estimator"]["vx", "vy", "vz"], m.velocity_m_s, atol=1e-9)
    assert any("its velocity is in the world" in note for note in flight.provenance.notes) == in_the_world


@pytest.mark.parametrize("scalar", [0.0, 1.0])
@pytest.mark.slow
def test_one_rotation_in_every_message_is_no_attitude(tmp_path, scalar):
    """Zeros, or the identity, of a sender that knows positions only."""
    none = np.tile([0.0, 0.0, 0.0, scalar], (len(motion().time_s), 1))
    flight = one(bag(tmp_path, leica__cf__pose=poses(quaternion=none), cf__imu=inertial()))
    assert ("qw" in flight["mocap"]) == (scalar == 1.0)
    (found,) = [f for f in audit(flight).faults if f.stream == "mocap"]
    assert found.kind == "missing_column"
    assert "none was sent" in found.evidence


@pytest.mark.slow
def test_poses_of_a_camera_on_board_are_no_motion_capture(tmp_path):
    flight = one(bag(tmp_path, mavros__vision_pose__pose=poses(), camera__odom__sample=odometry(motion().velocity_m_s),
                     mavros__local_position__pose=poses(), mavros__imu__data=inertial()))
    assert flight.metadata["topics"]["estimator"] == "/mavros/local_position/pose"
    assert "mocap" not in flight.streams
    assert any("/camera/odom/sample may have made it" in note for note in flight.provenance.notes)


def test_an_inertial_sensor_in_frd_beside_an_estimate_in_our_axes(tmp_path):
    """Without motion capture gravity and the estimated attitude show the turn: one finding, not one negated column."""
    m = motion()
    turned = one(bag(tmp_path, mavros__local_position__pose=poses(), mavros__imu__data=inertial(
        FRD * m.force_m_s2, FRD * m.rate_rad_s)))
    (found,) = [f for f in audit(turned).faults if f.stream == "imu"]
    assert found.kind == "frame"
    assert "FRD" in found.evidence
    assert "gyro_y, gyro_z, acc_y, acc_z" in found.evidence


def test_gravity_alone_offers_whole_frames(tmp_path):
    m = motion()
    (found,) = audit(one(bag(tmp_path, imu=inertial(FRD * m.force_m_s2, FRD * m.rate_rad_s)))).faults
    assert found.kind == "frame"
    assert "most likely in FRD axes" in found.evidence
    assert "acc_z alone negated?" in found.evidence


def test_a_negated_column_beside_an_estimate_stays_one(tmp_path):
    flight = one(bag(tmp_path, mavros__local_position__pose=poses(), mavros__imu__data=inertial(
        motion().force_m_s2 * [1.0, 1.0, -1.0])))
    assert [(f.kind, len(f.columns)) for f in audit(flight).faults if f.stream == "imu"] == [("sign", 1)]


def test_noise_of_the_poses_is_no_unit_of_the_accelerometer(tmp_path):
    """Gravity shows the unit; the second derivative of 5 mm at 100 Hz exceeds every acceleration of the flight."""
    flight = one(bag(tmp_path, vicon__cf__pose=poses(noisy(motion().position_m, 0.005)), cf__imu=inertial()))
    assert ("unit", "imu") not in faults(flight)


def test_a_broken_topic_costs_itself_alone(tmp_path):
    flight = one(bag(tmp_path, cut="cf__imu", vicon__cf__pose=poses(), cf__imu=inertial()))
    assert set(flight.streams) == {"mocap"}
    assert {("bad_cell", ""), ("missing_column", "imu")} <= faults(flight)


def test_streams_that_never_meet(tmp_path):
    assert ("no_common_time", "") in faults(one(bag(tmp_path, vicon__cf__pose=poses(), cf__imu=inertial(late_s=50.0))))
