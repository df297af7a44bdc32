"""Steps towards the size of an effect."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.posterior.sizing import Refined, _shortened


def test_a_step_that_overshoots_is_shortened():
    """Of x^2 from 1: a step to -3 is worse, half of it ends at the same cost, a quarter at 0; from 0 none is better."""
    def square(x):
        return float(x[0] ** 2)

    assert _shortened(square, np.array([1.0]), np.array([-3.0]), 1.0) == (0.25, 0.0)
    assert _shortened(square, np.array([1.0]), np.array([0.5]), 1.0) == (1.0, 0.25)
    assert _shortened(square, np.array([0.0]), np.array([1.0]), 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(("flights", "far", "variance"), [(3, False, 0.01 + 4.0 / 3.0), (3, True, 0.01),
                                                          (2, False, 0.01)])
def test_the_scatter_between_flights_widens_a_size(monkeypatch, flights, far, variance):
    """Without one of three flights: 1, 2, 3; by the jackknife 2/3 of the sum of squares, 2. Two flights show no
    scatter."""
    case = SimpleNamespace(flights=np.arange(flights), effects=[SimpleNamespace(far=far, width=1)])
    found = Refined((0,), np.array([2.0]), np.array([[0.01]]), None, None, object(), None, None, 0.0)
    monkeypatch.setattr(Refined, "without", lambda self, case, gone: np.array([gone[0] + 1.0]))
    assert found.spread(case) == pytest.approx(np.array([[variance]]))
