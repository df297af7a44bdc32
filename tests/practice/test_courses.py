"""The paths for headroom: within their limits, through their points, and as quick or as smooth as can be."""

import numpy as np
import pytest
from scipy.optimize import linprog

from nanobench_tools.practice.courses import _least_snap, _quickest
from nanobench_tools.practice.references import path_spec


@pytest.mark.parametrize("speed", ["slow", "medium", "fast"])
def test_the_quick_eight_lies_on_the_lemniscate_and_uses_its_acceleration_up(speed):
    spec = path_spec("time_optimal_eight", speed)
    most = spec.params["acceleration_m_s2"]
    t = np.linspace(0.0, 12.0, 6001)
    p, _, a, _ = spec.at(t)
    np.testing.assert_allclose(p[:, 1] ** 2, p[:, 0] ** 2 * (1.0 - p[:, 0] ** 2), atol=1e-9)  # y = x cos
    size = np.linalg.norm(a, axis=1)
    assert size.max() < 1.02 * most
    assert np.mean(size) > 0.95 * most
    assert np.all(p[:, 2] == 1.0)


def test_no_quicker_lap_is_found_by_linear_programming():
    """q = (rate of the angle)^2 on a grid, |a| within a polygon; the largest sum of q has the largest q everywhere."""
    n, most = 400, 2.0
    step = 2.0 * np.pi / n
    middle = step * (np.arange(n) + 0.5)
    first = np.stack([np.cos(middle), np.cos(2 * middle)], axis=1)
    second = np.stack([-np.sin(middle), -2.0 * np.sin(2 * middle)], axis=1)
    here, there = np.eye(n), np.roll(np.eye(n), 1, axis=1)
    rows, bound = [], []
    for way in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):  # a = second q + first q' / 2
        u = np.array([np.cos(way), np.sin(way)])
        bend, along = 0.5 * (second @ u)[:, None], (first @ u)[:, None] / (2.0 * step)
        rows.append((bend - along) * here + (bend + along) * there)
        bound.append(np.full(n, most))
    found = linprog(-np.ones(n), np.concatenate(rows), np.concatenate(bound), bounds=(1e-6, None), method="highs")
    lap = np.sum(step / np.sqrt(found.x))
    assert _quickest(1.0, most).x[-1] == pytest.approx(lap, rel=0.02)


def test_the_course_passes_its_points_and_rests_at_home():
    spec = path_spec("minimum_snap", "fast")
    spline = _least_snap(((0.0, 0.0, 1.0), *spec.params["waypoints_m"], (0.0, 0.0, 1.0)), 0.7)
    end = spline.t[-1]
    t = np.linspace(0.0, end, 20001)
    p = spec.at(t).position_m
    for corner in spec.params["waypoints_m"]:
        assert np.linalg.norm(p - corner, axis=1).min() < 1e-3
    for when in (0.0, end + 1.0):
        point = spec.at(np.array([when]))
        np.testing.assert_allclose(point.position_m, [[0.0, 0.0, 1.0]], atol=1e-9)
        np.testing.assert_allclose(np.concatenate(point[1:]), 0.0, atol=1e-7)


def test_any_other_course_through_the_points_has_more_snap():
    corners = ((0.0, 0.0, 1.0), (1.0, 0.3, 1.2), (0.2, 0.8, 0.7), (0.0, 0.0, 1.0))
    spline = _least_snap(corners, 0.5)
    times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))]) / 0.5
    t = np.linspace(0.0, times[-1], 40001)
    snap = spline(t, 4)
    own = np.trapezoid(snap**2, t, axis=0)
    # a change that is zero at the points and flat at the ends: products of the distances to them, to the fourth
    basis = np.poly(times[1:-1])
    basis = np.polymul(basis, np.poly([times[0]] * 4 + [times[-1]] * 4))
    change = np.polyval(np.polyder(basis, 4), t)
    cross = np.trapezoid(snap * change[:, None], t, axis=0)
    scale = np.sqrt(own * np.trapezoid(change**2, t))
    np.testing.assert_allclose(cross / scale, 0.0, atol=1e-5)  # stationary, and the integral is convex


@pytest.mark.parametrize("family", ["time_optimal_eight", "minimum_snap"])
def test_derivatives_are_those_of_the_path(family):
    spec = path_spec(family, "medium")
    t = np.linspace(0.3, 9.0, 200)
    h = 1e-5
    ahead, behind, now = spec.at(t + h), spec.at(t - h), spec.at(t)
    for order in range(3):
        slope = (ahead[order] - behind[order]) / (2.0 * h)
        np.testing.assert_allclose(now[order + 1], slope, atol=5e-3 * max(1.0, np.abs(slope).max()))
