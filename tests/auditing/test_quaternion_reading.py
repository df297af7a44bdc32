"""Inverted quaternions, and scalars in another place, are one finding; what it advises leaves a clean audit."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.auditing.faults import axis_swap, body_frame, frame, quaternion_order, sign
from nanobench_tools.flight import make_stream
from nanobench_tools.signals.context import Context

ROTATION = ("qx", "qy", "qz", "qw")
CHECKS = (frame, sign, axis_swap, quaternion_order, body_frame)
STORED = {"change the sign of qx, qy, qz": so3.conjugate,
          "read qx = qy, qy = qz, qz = qw, qw = qx": lambda q: q[:, [3, 0, 1, 2]],
          "read qx = qw, qy = qx, qz = qy, qw = qz": lambda q: q[:, [1, 2, 3, 0]],
          "read qx = -qy, qy = -qz, qz = -qw, qw = qx": lambda q: so3.conjugate(q)[:, [3, 0, 1, 2]]}


@pytest.fixture(scope="module")
def flight(crowd):
    """Poses and inertial measurements alone."""
    log = crowd.log("fast figure_eight")[0]
    poses = log["mocap"]
    keep = [poses.index(q) for q in ("px", "py", "pz", *ROTATION)]
    poses = make_stream("mocap", poses.time_s, poses.values[:, keep], ("px", "py", "pz", *ROTATION))
    return log.without_streams(*set(log.streams) - {"imu"}).with_streams(mocap=poses)


def with_quaternions(flight, stream, change):
    s = flight[stream]
    values = s.values.copy()
    values[:, [s.index(q) for q in ROTATION]] = change(s[ROTATION])
    return flight.with_streams(**{stream: replace(s, values=values)})


def found_in(flight):
    context = Context(flight)
    return [(f.kind, f.stream, f.evidence.partition(", since ")[0]) for c in CHECKS for f in c.find(flight, context)]


def followed(advice, quaternion):
    """(n, 4) changed as the finding says."""
    if advice.startswith("change"):
        return quaternion * [-1.0, -1.0, -1.0, 1.0]
    moves = dict(part.split(" = ") for part in advice.removeprefix("read ").split(", "))
    return np.stack([(-1.0 if moves[q][0] == "-" else 1.0) * quaternion[:, ROTATION.index(moves[q].lstrip("-"))]
                     for q in ROTATION], axis=1)


@pytest.mark.parametrize("streams", ["imu", "path alone", "imu in other axes"])
@pytest.mark.parametrize("advice", STORED)
def test_another_reading_of_the_tracked_attitude_is_one_finding(flight, advice, streams):
    if streams == "path alone":
        flight = flight.without_streams(*set(flight.streams) - {"mocap"})
    if streams == "imu in other axes":
        imu = flight["imu"]
        down = np.array([-1.0 if q[-1] in "yz" else 1.0 for q in imu.quantities])
        flight = flight.with_streams(imu=replace(imu, values=imu.values * down))
    bad = with_quaternions(flight, "mocap", STORED[advice])
    about = [f for f in found_in(bad) if f[1] == "mocap"]
    assert [kind for kind, *_ in about] == ["quaternion_order"]
    assert about[0][2].endswith(advice)
    assert len(found_in(bad)) == 1 + (streams == "imu in other axes")
    mended = with_quaternions(bad, "mocap", lambda q: followed(advice, q))
    np.testing.assert_allclose(mended["mocap"].values, flight["mocap"].values)
    assert [f for f in found_in(mended) if f[1] == "mocap"] == []


@pytest.mark.parametrize("negated", [("gyro_x",), ("gyro_x", "gyro_y"), ("gyro_x", "gyro_y", "gyro_z")])
def test_a_gyro_that_is_wrong_leaves_an_attitude_that_follows_the_path(flight, negated):
    imu = flight["imu"]
    values = imu.values * [-1.0 if q in negated else 1.0 for q in imu.quantities]
    assert {s for _, s, _ in found_in(flight.with_streams(imu=replace(imu, values=values)))} == {"imu"}
