"""The smallest size that predictions show, and flights that a force of time moved."""

import numpy as np
import pytest

from identification.prove.corrupted.disturbed import disturbed
from identification.prove.corrupted.sizes import RISES, errors, rise, smallest_shown, thinned


@pytest.mark.parametrize(("rises", "most", "found"), [
    (lambda x: x, 10.0, 0.1), (lambda x: x**2, 10.0, np.sqrt(0.1)), (lambda x: 1e3 * x, 10.0, 1e-4),
    (lambda x: 0.09 * x / (1.0 + x), 10.0, None), (lambda x: x, 0.05, None)])
def test_the_size_at_which_an_error_rises_by_a_tenth(rises, most, found):
    got = smallest_shown(rises, 1e-2, most)
    if found is None:
        assert got is None
        return
    assert got == pytest.approx(found, rel=0.1)
    assert rises(got) >= RISES


def test_a_change_of_one_size_ends_the_search():
    assert 0.0 < smallest_shown(lambda x: 1.0, 1.0, 1.0) < 1e-3


def test_the_error_of_the_right_simulator_rises_by_nothing(nominal, tracks):
    usual = errors(nominal, tracks)
    assert rise(usual, usual) == 0.0
    assert rise(errors(nominal.on(mass_kg=0.03), tracks), usual) > 0.25


def test_thinned_tracks_judge_the_first_seconds_of_each_flight(tracks):
    found = thinned(tracks, 2.0)
    assert [int(t.counts.sum()) for t in found] == [200, 200]
    assert not found[0].counts[~tracks[0].counts].any()


def test_a_force_of_time_obeys_newton_beside_drag(nominal, tracks):
    size, period = 0.7, 2.0
    moved = disturbed(tracks, nominal, size, period)[1]
    before = tracks[1]
    z, v = (moved.position_m - before.position_m)[:, 2], (moved.velocity_m_s - before.velocity_m_s)[:, 2]
    np.testing.assert_allclose(np.gradient(z, 0.01)[1:-1], v[1:-1], atol=1e-3)
    drag = nominal.values_of("drag_linear")["d"][2] / nominal.vehicle.mass_kg
    push = np.gradient(v, 0.01) + drag * v
    assert np.abs(push[1:-1]).max() == pytest.approx(size, rel=1e-3)
    assert np.argmax(np.abs(np.fft.rfft(push[:800]))) == 4  # periods of 2 s in 8 s
    for name in ("quaternion", "rate_rad_s", "motor"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(before, name))
    np.testing.assert_array_equal(moved.position_m[:, :2], before.position_m[:, :2])
