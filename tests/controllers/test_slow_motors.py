"""Controllers on a vehicle whose motors are as slow as measured rotor speed shows for brushed ones."""

import numpy as np
import pytest

from controllers.geometric import LAG_S, Geometric, slowest_lag_s, tunable_for
from controllers.mpc.prediction_model import practice_model
from controllers.plants.ensemble import shipped_draws, shipped_simulator
from controllers.plants.simulated_flights import fly_controller
from nanobench_tools.physics.simulator import loads
from nanobench_tools.protocols.simulated import specs_of

VEHICLE = loads(shipped_simulator())


def largest_rmse_m(name, path, gains=None):
    names, rows = shipped_draws()
    runs = fly_controller(name, specs_of((path,), (1.0,), 8.0), shipped_simulator(), 4, 0, (names, rows.tolist()),
                          gains=gains)
    return max(run["rmse_m"] for path in runs.runs for run in path)


@pytest.mark.parametrize(("name", "path"), [
    ("geometric", "star"), pytest.param("lqr", "circle", marks=pytest.mark.slow)])
def test_it_flies_with_the_lag_of_the_simulator(name, path):
    """Sharp corners are too much for the linear one, with any motors."""
    assert largest_rmse_m(name, path) < 0.6


@pytest.mark.slow
def test_gains_for_quick_motors_lose_it():
    quick = {name: gain.value for name, gain in tunable_for(LAG_S).items()}
    assert not largest_rmse_m("geometric", "star", quick) < 1.0


def test_gains_change_for_slower_motors_only():
    assert slowest_lag_s(VEHICLE) == VEHICLE.values_of("motor_lag")["tau_down_s"] > 2.0 * LAG_S
    assert slowest_lag_s(practice_model()) == slowest_lag_s(VEHICLE.without("motor_lag")) == LAG_S
    assert tunable_for(0.01) == tunable_for(LAG_S) == Geometric.tunable
    four = {name: slow.value / tunable_for(LAG_S)[name].value for name, slow in tunable_for(4.0 * LAG_S).items()}
    changed = {"position_level": 0.5, "velocity_level": np.sqrt(0.5), "integral_level": 0.5, "rate_tilt": 2.0,
               "turn_integral": 0.25}
    assert four == pytest.approx({**dict.fromkeys(four, 1.0), **changed})
