"""An audit names the signs, axes and offsets that no other column of the recording shows."""

import pytest

from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.flight import Flight, Provenance, make_stream


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd.log("fast figure_eight")[0].without_streams("mocap", "attitude_qw")


def test_what_the_estimate_shows_is_not_listed(flown):
    found = audit(flown)
    assert not any(entry.startswith(("sign and axis of x", "order")) for entry in found.unchecked)
    assert "sign, axis and scale of acc_x, acc_y (imu)" in found.unchecked
    assert "constant offset of yaw (attitude)" in found.unchecked
    assert Audit.from_json(found.to_json()).unchecked == found.unchecked


def test_a_gyro_without_attitude_and_motors_is_open(flown):
    found = audit(flown.without_streams("attitude", "pid", "motor")).unchecked
    assert any("gyro_x, gyro_y, gyro_z" in entry for entry in found)


def test_velocities_without_a_position_are_open(flown):
    estimator = flown["estimator"]
    keep = [estimator.quantities.index(q) for q in ("vx", "vy", "vz")]
    lone = type(estimator)(estimator.time_s, estimator.values[:, keep], tuple(estimator.columns[k] for k in keep),
                           ("vx", "vy", "vz"), tuple(estimator.unit[k] for k in keep))
    found = audit(flown.with_streams(estimator=lone)).unchecked
    assert "sign, axis and scale of vx, vy, vz (estimator)" in found
    assert "constant offset of vx, vy, vz (estimator)" in found


def test_poses_alone_leave_their_axes_open(crowd):
    """Unless the vehicle tilts towards its accelerations."""
    poses = crowd.log("fast figure_eight")[0]["mocap"]
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    mocap = make_stream("mocap", poses.time_s, poses[names], names)
    entry, scale = audit(Flight("poses", {"mocap": mocap}, {}, Provenance("made", "", "test"))).unchecked
    assert scale == "scale of pz (mocap)"  # its tilt shows the others
    assert entry.startswith("sign and axis of")
    assert "px" not in entry
    assert "qz" in entry
