"""Attitudes that were made from Euler angles of another order or sign, found by the path."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.faults import quaternion_order
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.tilt_heading import mirrored

POSES = ("px", "py", "pz", "qx", "qy", "qz", "qw")
SIGNS = {"roll": (-1, 1, 1), "pitch": (1, -1, 1)}


def turning(order, signs=(1, 1, 1), read="ZYX"):
    """A flight that turns to and fro; its angles in ``order``, with other signs, are read in the order ``read``."""
    t = np.arange(0.0, 30.0, 0.01)
    position = np.stack([np.sin(1.5 * t), 0.8 * np.sin(2.1 * t), 1.0 + 0.05 * np.sin(t)], axis=1)
    force = np.stack([-2.25 * position[:, 0], -0.8 * 4.41 * np.sin(2.1 * t), 9.81 + 0.0 * t], axis=1)
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    yaw = 1.3 * np.sin(0.7 * t)
    left = np.cross(up, np.stack([np.cos(yaw), np.sin(yaw), 0.0 * t], axis=1))
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    attitude = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    angles = attitude.as_euler(order)[:, [order.index(a) for a in "XYZ"]] * signs
    turn = Rotation.from_euler(read, angles[:, ["XYZ".index(a) for a in read]]).as_quat()
    return Flight("f", {"mocap": make_stream("mocap", t, np.hstack([position, turn]), POSES)}, {}, None)


def found(flight):
    return [f.evidence for f in quaternion_order.find(flight, Context(flight))]


@pytest.mark.parametrize("order", ["XYZ", "ZYX"])
def test_the_right_order_is_no_fault(order):
    assert found(turning(order, read=order)) == []


@pytest.mark.parametrize("angle", SIGNS)
def test_an_angle_of_the_other_sign_is_named(angle):
    evidence, = found(turning("ZYX", SIGNS[angle]))
    assert f"negate {angle}" in evidence
    assert "+0.9" in evidence


@pytest.mark.parametrize(("order", "read", "right"), [("XYZ", "ZYX", "x, y, z"), ("ZYX", "XYZ", "z, y, x")])
def test_another_order_is_named(order, read, right):
    evidence, = found(turning(order, read=read))
    assert f"turn about {right} in this order" in evidence


@pytest.mark.parametrize(("columns", "mended"), [({0: (0, 1), 1: (1, -1)}, ("py",)), ({0: (0, -1), 1: (1, 1)}, ("px",)),
                                                 ({0: (1, 1), 1: (0, 1)}, ("px", "py"))])
def test_the_mirror_image_of_a_path_that_is_longer_than_wide(columns, mended):
    """Turned by half a turn it correlates by 0.7 or more with the tilt as well."""
    flight = turning("ZYX")
    values = flight["mocap"].values
    mirrored_path = values.copy()
    for to, (of, sign) in columns.items():
        mirrored_path[:, to] = sign * values[:, of]
    other = make_stream("mocap", flight["mocap"].time_s, mirrored_path, POSES)
    assert mirrored(Context(flight)) is None
    assert mirrored(Context(flight.with_streams(mocap=other))).quantities == mended
