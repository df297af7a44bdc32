"""The residual wrench against what must come out."""

from __future__ import annotations

import numpy as np
import pytest
from carried_tracks import wrench_of
from scipy.ndimage import convolve1d

from identification.mismatch.space import space_around
from identification.mismatch.wrench import TORQUE_ROWS, Wrench, kernel
from nanobench_tools import so3


@pytest.mark.parametrize("sigma_s", [0.02, 0.03, 0.05])
def test_derivative_kernels_are_exact_for_polynomials(sigma_s):
    t = 0.01 * np.arange(400)
    inside = slice(60, -60)
    path = 3.0 * t**2 - 4.0 * t + 7.0
    np.testing.assert_allclose(convolve1d(path, kernel(sigma_s, 2))[inside], 6.0, atol=1e-8)
    np.testing.assert_allclose(convolve1d(path, kernel(sigma_s, 1))[inside], (6.0 * t - 4.0)[inside], atol=1e-9)
    assert kernel(sigma_s, 0).sum() == pytest.approx(1.0)
    assert abs(kernel(sigma_s, 2).sum()) < 1e-9


def test_the_right_model_leaves_the_noise_alone(model):
    force, torque = wrench_of(model, flights=1, noise=0.0).residual(model)
    assert np.abs(force).max() < 0.02
    assert np.sqrt(np.mean(torque**2)) < 0.05


def test_a_heavier_vehicle_shows_as_a_force_along_thrust(model):
    wrench = wrench_of(model, flights=1, noise=0.0)
    force, _ = wrench.residual(model.on(mass_kg=0.044))
    # by hand: thrust / 0.04 was flown, thrust / 0.044 is predicted; the difference is a tenth of 9.81 / 1.1
    assert force[:, 2].mean() == pytest.approx(9.81 * (1.0 - 0.04 / 0.044), rel=0.02)
    assert abs(force[:, :2].mean()) < 0.05


def test_a_push_in_the_world_is_seen_in_the_body(model):
    push = np.array([0.2, -0.1, 0.05])
    wrench = wrench_of(model, flights=1, seconds=15.0, push=lambda position, time: push, noise=0.0)
    force, _ = wrench.residual(model)
    expected = so3.rotate_inverse(wrench.quaternion[wrench.force_at], push)
    np.testing.assert_allclose(force, expected, atol=0.02)


def test_turning_the_room_changes_nothing(model):
    from dataclasses import replace

    wrench = wrench_of(model, flights=1)
    turn = so3.from_euler_zyx(0.0, 0.0, 1.1)
    track = wrench.tracks[0]
    turned = replace(track, position_m=so3.rotate(turn, track.position_m),
                     velocity_m_s=so3.rotate(turn, track.velocity_m_s),
                     quaternion=so3.multiply(turn, track.quaternion))
    for a, b in zip(wrench.residual(model), Wrench([turned]).residual(model), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_stretches_of_torque_stay_on_one_track(model):
    wrench = wrench_of(model, flights=2, seconds=8.0)
    assert np.array_equal(wrench.track[wrench.torque_at], wrench.track[wrench.torque_at + TORQUE_ROWS])


def test_thrusts_are_kept_only_while_nothing_that_makes_them_changes(model):
    wrench, around = wrench_of(model, flights=1, seconds=8.0), space_around(model).model
    by = 0.01 * np.maximum(np.abs(around.values), 0.1)
    moved = [around.values + by * (np.arange(len(by)) == k) for k in range(len(by))]
    for values in (around.values, *moved, *moved):
        fresh = Wrench(wrench.tracks).thrust(around, values)
        for one, other in zip(wrench.thrust(around, values), fresh, strict=True):
            np.testing.assert_array_equal(one, other)
