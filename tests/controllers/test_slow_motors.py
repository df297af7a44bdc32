"""Controllers on a vehicle whose motors are as slow as measured rotor speed shows for brushed ones."""

import numpy as np
import pytest

from controllers.geometric import LAG_S, Geometric, slowest_lag_s, tunable_for
from controllers.plants.ensemble import shipped_draws, shipped_simulator
from controllers.plants.simulated_flights import fly_controller
from nanobench_tools.physics.simulator import dumps, loads
from nanobench_tools.protocols.simulated import specs_of

SHIPPED = loads(shipped_simulator())
UP_S, DOWN_S = 0.055, 0.119
SLOW = SHIPPED.with_parameters({"motor_lag.tau_up_s": UP_S, "motor_lag.tau_down_s": DOWN_S,
                                **{f"inertia.inertia_kg_m2[{k}]": j for k, j in enumerate((1.7e-5, 1.7e-5, 3.0e-5))}}
                               ).with_term("motor_imbalance", g=(1.0, 1.06, 1.02, 0.92))


def largest_rmse_m(name, path, gains=None):
    names, rows = shipped_draws()
    kept = [k for k, name_ in enumerate(names) if not name_.startswith(("motor_lag", "inertia"))]
    draws = tuple(names[k] for k in kept), rows[:, kept].tolist()
    runs = fly_controller(name, specs_of((path,), (1.0,), 8.0), dumps(SLOW), 4, 0, draws, gains=gains)
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
    assert slowest_lag_s(SLOW) == DOWN_S
    assert slowest_lag_s(SHIPPED) == slowest_lag_s(SHIPPED.without("motor_lag")) == LAG_S
    assert tunable_for(0.01) == tunable_for(LAG_S) == Geometric.tunable
    four = {name: slow.value / tunable_for(LAG_S)[name].value for name, slow in tunable_for(4.0 * LAG_S).items()}
    changed = {"position_level": 0.5, "velocity_level": np.sqrt(0.5), "integral_level": 0.5, "rate_tilt": 2.0,
               "turn_integral": 0.25}
    assert four == pytest.approx({**dict.fromkeys(four, 1.0), **changed})
