"""Multi-horizon errors: a perfect predictor scores exactly 0, signs of q do not count, windows keep to their flight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nanobench_tools import so3
from nanobench_tools.methods import Prediction
from nanobench_tools.metrics import prediction


def states(n=7, h=5, seed=0):
    rng = np.random.default_rng(seed)
    return Prediction(rng.normal(size=(n, h, 3)), rng.normal(size=(n, h, 3)), so3.exp(rng.normal(size=(n, h, 3))),
                      rng.normal(size=(n, h, 3)))


def test_a_perfect_predictor_scores_exactly_zero_with_either_sign_of_q():
    true = states()
    for sign in (1.0, -1.0):
        same = Prediction(true.position_m, true.velocity_m_s, sign * true.quaternion, true.rate_rad_s)
        for errors in prediction.window_errors(same, true).values():
            assert prediction.multi_horizon(errors.mean(axis=0), (1, 5)) == {"1": 0.0, "5": 0.0, "sum": 0.0}


def test_by_hand():
    true = states(n=2, h=2)
    off = Prediction(true.position_m + np.array([0.3, 0.4, 0.0]), true.velocity_m_s,
                     so3.multiply(true.quaternion, so3.exp(np.array([0.0, 0.2, 0.0]))), true.rate_rad_s)
    errors = prediction.window_errors(off, true)
    np.testing.assert_allclose(errors["position_mae_m"], 0.5)
    np.testing.assert_allclose(errors["attitude_mae_rad"], 0.2)
    found = prediction.multi_horizon(np.array([1.0, 2.0, 4.0]), (1, 3, 50))
    assert found == {"1": 1.0, "3": 4.0, "sum": 7.0}


def test_shapes_must_agree():
    with pytest.raises(ValueError, match="position_m has shape"):
        prediction.window_errors(states(h=4), states(h=5))


@settings(deadline=None)
@given(st.lists(st.integers(0, 40), max_size=8), st.integers(1, 12), st.integers(1, 7))
def test_no_window_crosses_a_boundary(lengths, horizon, every):
    stretch = np.repeat(np.arange(len(lengths)), lengths)
    starts = prediction.window_starts(lengths, horizon, every)
    for start in starts:
        assert np.all(stretch[start:start + horizon + 1] == stretch[start])
        assert start + horizon < len(stretch)
    expected = sum(len(range(0, n - horizon, every)) for n in lengths if n > horizon)
    assert len(starts) == expected
