"""Paths of a point that is not the centre of mass, and frames stamped on arrival: from made motions with an answer."""

import numpy as np
import pytest

from identification.mismatch.track import Track, _over_row, framed
from identification.mismatch.tracked_point import arm_of, centred
from nanobench_tools import so3
from nanobench_tools.flight import make_stream

GRAVITY = np.array([0.0, 0.0, -9.81])


def _track(number: int, arm: np.ndarray, seed: int, n: int = 1500) -> Track:
    """A rotor that pushes along its own axis only and drags; its centre's path by integration, then a point off it."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.01
    tilt = sum(0.2 * np.stack([np.sin(f * t + a), np.cos(1.3 * f * t + b), 0.0 * t], axis=1)
               for f, a, b in zip((3.1, 5.3), rng.uniform(0, 6, 2), rng.uniform(0, 6, 2), strict=True))
    q = so3.exp(tilt)
    rate = np.gradient(tilt, 0.01, axis=0)
    step = so3.log(so3.multiply(so3.conjugate(q[:-1]), q[1:])) / 0.01  # body rate in the middle of a row
    rate[1:-1] = 0.5 * (step[:-1] + step[1:])
    v, p = np.zeros((n, 3)), np.zeros((n, 3))
    up = so3.rotate(q, np.array([0.0, 0.0, 1.0]))
    for k in range(n - 1):
        a = 9.81 / up[k, 2] * up[k] + GRAVITY - 0.35 * v[k]
        v[k + 1] = v[k] + 0.01 * a
        p[k + 1] = p[k] + 0.005 * (v[k] + v[k + 1])
    p = np.concatenate([0.5 * (p[1:] + p[:-1]), p[-1:]])  # a path by halves of a row lags behind by one
    p = p + so3.rotate(q, np.broadcast_to(arm, (n, 3))) + 1e-4 * rng.standard_normal((n, 3))
    v = v + so3.rotate(q, np.cross(rate, arm))
    counts = (t > 0.3) & (t < t[-1] - 0.3)
    return Track(f"f{number}", number, t, p, v, q, rate, np.full((n, 3), np.nan), np.full((n, 4), 0.6), np.full(n, 3.8),
                 counts, t, np.zeros((n, 2)))


@pytest.mark.parametrize("arm", [np.zeros(3), np.array([0.004, -0.003, 0.024])])
def test_the_arm_of_the_markers_is_found(arm):
    tracks = [_track(k, arm, k) for k in range(3)]
    found = arm_of(tracks)
    assert found.r_m[2] == pytest.approx(arm[2], abs=1.5e-3)
    assert found.counts == (arm[2] > 0.0)


def test_taken_out_it_is_no_longer_there():
    arm = np.array([0.0, 0.0, 0.03])
    tracks = centred([_track(k, arm, k) for k in range(3)], arm)
    assert np.linalg.norm(arm_of(tracks).r_m) < 1.5e-3


def test_two_flights_hold_nothing_out():
    assert arm_of([_track(k, np.array([0.0, 0.0, 0.03]), k) for k in range(2)]) is None


def test_frames_stamped_on_arrival_go_back_on_the_beat():
    rng = np.random.default_rng(1)
    true = np.arange(600) * 0.00988
    path = np.stack([np.sin(2.0 * true), np.cos(3.0 * true), 0.1 * true], axis=1) + 1e-4 * rng.standard_normal((600, 3))
    arrived = true + rng.exponential(6e-4, 600)
    there = np.abs(arrived - true).mean()
    found = framed(arrived, path)
    away = (found - true) - (found - true).mean()
    assert np.abs(away).max() < 0.2 * there
    np.testing.assert_array_equal(framed(true, path), true)


def test_frames_that_were_lost_leave_the_beat():
    rng = np.random.default_rng(2)
    true = np.delete(np.arange(600) * 0.01, [100, 101, 102, 300])
    path = np.stack([np.sin(2.0 * true), np.cos(3.0 * true), 0.1 * true], axis=1)
    found = framed(true + rng.exponential(6e-4, len(true)), path)
    assert np.ptp(found - true) < 3e-4


def test_a_path_without_noise_on_stamps_that_wander_slowly_stays():
    true = np.arange(600) * 0.01
    stamps = true + 1e-3 * np.sin(0.5 * true)
    path = np.stack([np.sin(2.0 * stamps), np.cos(3.0 * stamps), 0.1 * stamps], axis=1)
    np.testing.assert_array_equal(framed(stamps, path), stamps)


def test_commands_logged_faster_than_rows_count_with_their_mean():
    t = np.arange(0.0, 1.0, 0.002)
    values = 0.5 + 0.1 * np.sign(np.sin(2.0 * np.pi * 100.0 * t + 0.1))[:, None] * np.ones(4)
    rows = np.arange(0.1, 0.9, 0.01)
    found = _over_row(make_stream("motor", t, values, ("m1", "m2", "m3", "m4")), ("m1", "m2", "m3", "m4"), rows)
    by_hand = [values[(t >= r - 1e-9) & (t < r + 0.01 - 1e-9)].mean(axis=0) for r in rows]
    np.testing.assert_allclose(found, by_hand, atol=1e-9)
    slow = make_stream("motor", t[::5], values[::5], ("m1", "m2", "m3", "m4"))
    np.testing.assert_allclose(_over_row(slow, ("m1",), rows)[:, 0], np.interp(rows + 0.005, t[::5], values[::5, 0]))
