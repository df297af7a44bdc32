"""Truth at an estimator's own stamps: exact on rows, linear and slerp between, nothing outside."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from nanobench_tools.metrics.association import associate


def truth(n=200):
    t = np.arange(n) * 0.01
    p = np.stack([np.sin(t), t, t**2], axis=1)
    q = Rotation.from_euler("ZYX", np.stack([3 * t, 0.3 * np.sin(t), t], 1)).as_quat()
    return t, p, q, np.gradient(p, t, axis=0)


def test_the_same_stamps_give_the_rows_themselves():
    t, p, q, v = truth()
    found = associate(t, t, p, q, v)
    assert found.dropped == 0
    for ours, theirs in ((found.position_m, p), (found.quaternion, q), (found.velocity_m_s, v)):
        assert np.array_equal(ours, theirs)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0, 1.99), min_size=1, max_size=30))
def test_between_rows_as_scipy_has_it(stamps):
    t, p, q, _ = truth()
    at = np.sort(np.array(stamps))
    found = associate(at, t, p, q)
    assert found.velocity_m_s is None
    kept = at[found.kept]
    np.testing.assert_allclose(found.position_m[:, 0], np.interp(kept, t, p[:, 0]), atol=1e-12)
    expected = Slerp(t, Rotation.from_quat(q))(kept)
    assert (expected.inv() * Rotation.from_quat(found.quaternion)).magnitude().max() < 1e-9


def test_stamps_outside_the_truth_are_dropped_and_counted():
    t, p, q, _ = truth()
    found = associate(np.array([-0.001, 0.0, 1.0, t[-1], t[-1] + 1e-6, np.nan]), t, p, q)
    assert found.kept.tolist() == [False, True, True, True, False, False]
    assert found.dropped == 3
    assert len(found.position_m) == 3


def test_no_interpolation_across_a_hole():
    t, p, q, _ = truth()
    keep = (t < 0.5) | (t > 0.9)
    found = associate(np.array([0.45, 0.49, 0.6, 0.7, t[keep][50], 1.2]), t[keep], p[keep], q[keep])
    assert found.kept.tolist() == [True, True, False, False, True, True]


def test_a_quaternion_sign_change_does_not_matter():
    t, p, q, _ = truth()
    flipped = q * np.where(np.arange(len(q)) % 3, 1.0, -1.0)[:, None]
    at = t[:-1] + 0.004
    a, b = associate(at, t, p, q).quaternion, associate(at, t, p, flipped).quaternion
    assert (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude().max() < 1e-12


def test_stamps_that_do_not_rise_raise():
    t, p, q, _ = truth()
    t[5] = t[4]
    with pytest.raises(ValueError, match="strictly rising"):
        associate(t, t, p, q)
