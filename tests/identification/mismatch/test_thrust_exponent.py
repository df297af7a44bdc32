"""How far a thrust map may bend."""

from __future__ import annotations

import numpy as np
import pytest

from identification.mismatch.posterior.thrust_exponent import Curve


@pytest.mark.parametrize(("exponent", "down", "up"), [(2.0, 1.65, 2.6), (2.9, 1.65, 2.91), (1.2, 1.19, 2.6)])
def test_a_thrust_map_keeps_the_exponent_of_a_rotor(exponent, down, up):
    """thrust = t + u + (a - t) u^3 at u = 1 has the exponent (1 + 3 (a - t)) / (1 + a). The present one may stay."""
    a = (exponent - 1.0) / (3.0 - exponent)
    room = Curve(np.array([0.0, 1.0, 0.0, a]), 1.0, (1.65, 2.6)).room(np.array([1.0, 0.0, 0.0, -1.0]))
    assert [(1.0 + 3.0 * (a - t)) / (1.0 + a) for t in room] == pytest.approx([up, down])
