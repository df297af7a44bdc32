"""Steps towards the size of an effect."""

from __future__ import annotations

import numpy as np

from identification.mismatch.posterior.sizing import _shortened


def test_a_step_that_overshoots_is_shortened():
    """Of x^2 from 1: a step to -3 is worse, half of it ends at the same cost, a quarter at 0; from 0 none is better."""
    def square(x):
        return float(x[0] ** 2)

    assert _shortened(square, np.array([1.0]), np.array([-3.0]), 1.0) == (0.25, 0.0)
    assert _shortened(square, np.array([1.0]), np.array([0.5]), 1.0) == (1.0, 0.25)
    assert _shortened(square, np.array([0.0]), np.array([1.0]), 0.0) == (0.0, 0.0)
