"""The air below a simulated vehicle, against momentum, published readings and free fall."""

import numpy as np
import pytest
from scipy.integrate import quad

from controllers.plants.downwash import AIR_KG_M3, SharedAir, downwash_m_s, downwash_N
from controllers.plants.served_vehicle import served

WEIGHT_N = 0.034 * 9.81


@pytest.mark.parametrize("below_m", [0.1, 0.5, 2.0])
def test_the_jet_carries_the_momentum_of_the_thrust_at_every_height(below_m):
    carried, _ = quad(lambda r: 2.0 * np.pi * r * AIR_KG_M3 * downwash_m_s(WEIGHT_N, below_m, r) ** 2, 0.0, 3.0,
                      points=[0.2])
    assert carried == pytest.approx(WEIGHT_N, rel=1e-6)


@pytest.mark.parametrize(("below_m", "reading_g"), [(0.2, 10.0), (0.3, 8.0), (0.4, 6.0), (0.5, 4.0)])
def test_the_force_on_the_axis_is_about_that_of_neural_swarm(below_m, reading_g):
    """Figure 3 of Shi et al. 2020, for a vehicle of 34 g, as read off by others."""
    found_g = 1e3 / 9.81 * downwash_N(downwash_m_s(WEIGHT_N, below_m, 0.0))
    assert 0.6 < found_g / reading_g < 1.7


def test_above_and_far_aside_is_no_jet():
    assert downwash_m_s(WEIGHT_N, -0.1, 0.0) == 0.0
    assert downwash_N(downwash_m_s(WEIGHT_N, 0.5, 0.4)) < 1e-4


def test_a_vehicle_below_another_one_falls_faster_and_only_while_rotors_turn():
    """In free fall for 50 ms, half a metre below: the difference of speeds is force over mass times time."""
    speeds = {}
    for turning in (True, False):
        upper, lower = served(noise=0.0, air=0.0), served(noise=0.0, air=0.0)
        SharedAir([upper, lower])
        upper.place((0.0, 0.0, 1.5), ground_m=0.0)
        lower.place((0.0, 0.0, 1.0), ground_m=0.0)
        upper._world["motor"] = 0.5 * turning
        for _ in range(50):
            lower.advance(1)
        speeds[turning] = lower.true_pose()[1][2]
        assert upper.air.force_N(upper) == (0.0, 0.0, 0.0)
    expected = downwash_N(downwash_m_s(lower.hover_N, 0.5, 0.0)) / lower.hover_N * 9.81 * 0.05
    assert speeds[False] - speeds[True] == pytest.approx(expected, rel=0.1)
    assert expected > 0.05


def test_a_push_from_outside_adds_to_it():
    upper, lower = served(), served()
    SharedAir([upper, lower])
    upper.place((0.0, 0.0, 1.5), ground_m=0.0)
    lower.place((0.0, 0.0, 1.0), ground_m=0.0)
    upper._world["motor"] = 0.5
    lower.push((0.1, 0.0, 0.2))
    lower.advance(1)
    assert lower._world["push_N"][0][:2] == pytest.approx([0.1, 0.0])
    assert lower._world["push_N"][0][2] == pytest.approx(0.2 + lower.air.force_N(lower)[2], abs=1e-3)
