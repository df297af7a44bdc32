"""Rotations against SciPy, finite differences and identities."""

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation, Slerp

from nanobench_tools import so3

vectors = arrays(float, 3, elements=st.floats(-3.0, 3.0, allow_nan=False))


def random_quaternions(n: int, seed: int = 0) -> np.ndarray:
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_quat()


def test_product_and_rotation_agree_with_scipy():
    a, b = random_quaternions(50, 1), random_quaternions(50, 2)
    v = np.random.default_rng(3).normal(size=(50, 3))
    ra, rb = Rotation.from_quat(a), Rotation.from_quat(b)
    np.testing.assert_allclose(so3.matrix(so3.multiply(a, b)), (ra * rb).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(so3.rotate(a, v), ra.apply(v), atol=1e-14)
    np.testing.assert_allclose(so3.rotate_inverse(a, v), ra.inv().apply(v), atol=1e-14)


def test_euler_angles_are_zyx_and_pitch_positive_is_nose_down():
    q = random_quaternions(200)
    yaw, pitch, roll = Rotation.from_quat(q).as_euler("ZYX").T
    np.testing.assert_allclose(so3.euler_zyx(q), np.stack([roll, pitch, yaw], 1), atol=1e-12)
    back = so3.from_euler_zyx(*so3.euler_zyx(q).T)
    np.testing.assert_allclose(so3.geodesic_angle(back, q), 0.0, atol=1e-7)
    nose = so3.rotate(so3.from_euler_zyx(0.0, 0.2, 0.0), np.array([1.0, 0.0, 0.0]))
    assert nose[2] < 0.0


def test_geodesic_angle_knows_that_q_and_minus_q_are_one_rotation():
    q = random_quaternions(20)
    assert np.all(so3.geodesic_angle(q, -q) < 1e-7)
    turned = so3.multiply(q, so3.exp(np.array([0.0, 0.0, 1e-9])))
    np.testing.assert_allclose(so3.geodesic_angle(q, turned), 1e-9, rtol=1e-3)


def test_interpolation_equals_slerp_and_holds_its_ends():
    t = np.array([0.0, 0.1, 0.35, 1.0])
    q = random_quaternions(4, 7)
    at = np.linspace(0.0, 1.0, 41)
    expected = Slerp(t, Rotation.from_quat(q))(at).as_quat()
    np.testing.assert_allclose(so3.geodesic_angle(so3.interpolate(t, q, at), expected), 0.0, atol=1e-7)
    outside = so3.interpolate(t, q, np.array([-1.0, 2.0]))
    np.testing.assert_allclose(so3.geodesic_angle(outside, q[[0, -1]]), 0.0, atol=1e-7)


def test_make_continuous_never_jumps_and_keeps_rotations():
    q = so3.exp(np.linspace(0, 12, 300)[:, None] * np.array([0.0, 0.0, 1.0]))
    q *= np.random.default_rng(0).choice([-1.0, 1.0], size=(300, 1))
    smooth = so3.make_continuous(q)
    assert np.all(np.sum(smooth[1:] * smooth[:-1], axis=1) > 0.99)
    assert np.all(so3.geodesic_angle(smooth, q) < 1e-7)


@pytest.mark.parametrize(("angle", "wrapped"), [(np.pi, -np.pi), (3.5 * np.pi, -0.5 * np.pi), (-0.1, -0.1)])
def test_wrap_angle(angle, wrapped):
    assert so3.wrap_angle(angle) == pytest.approx(wrapped)
