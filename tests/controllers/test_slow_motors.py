"""Controllers on a vehicle whose motors are as slow as measured rotor speed shows for brushed ones."""

import numpy as np
import pytest

from controllers.geometric import LAG_S, Geometric, slowest_lag_s
from controllers.mpc.prediction_model import practice_model
from controllers.plants.ensemble import shipped_draws, shipped_simulator
from controllers.plants.simulated_flights import fly_controller, made
from nanobench_tools.firmware.motor_output import MotorOutput
from nanobench_tools.firmware.records import WRENCH
from nanobench_tools.physics.simulator import loads
from nanobench_tools.protocols.simulated import specs_of

VEHICLE = loads(shipped_simulator())


def largest_rmse_m(name, path):
    names, rows = shipped_draws()
    runs = fly_controller(name, specs_of((path,), (1.0,), 8.0), shipped_simulator(), 4, 0, (names, rows.tolist()))
    return max(run["rmse_m"] for path in runs.runs for run in path)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "path", "most_m"), [
    ("geometric", "circle", 0.4), ("geometric", "star", 1.2), ("lqr", "circle", 0.4)])
def test_it_flies_with_the_lag_of_the_simulator(name, path, most_m):
    """Sharp corners are too much for the linear one, with any motors."""
    assert largest_rmse_m(name, path) < most_m


@pytest.mark.slow
def test_without_the_lead_it_loses_the_vehicle(monkeypatch):
    monkeypatch.setattr("controllers.plants.simulated_flights.slowest_lag_s", lambda model: LAG_S)
    assert not largest_rmse_m("geometric", "star") < 1.5


def test_the_lag_of_the_slowest_motor_counts():
    assert made("geometric", VEHICLE).lead == slowest_lag_s(VEHICLE) / LAG_S
    assert slowest_lag_s(VEHICLE) == VEHICLE.values_of("motor_lag")["tau_down_s"] > 2.0 * LAG_S
    assert slowest_lag_s(practice_model()) == slowest_lag_s(VEHICLE.without("motor_lag")) == LAG_S


@pytest.mark.parametrize("lag_s", [0.02, LAG_S, 0.119])
def test_behind_the_lead_a_slow_motor_follows_as_a_quick_one(lag_s):
    """Torque of a step, then a first-order lag in steps of 2 ms, against that of motors with LAG_S."""
    asked = []

    class Motors(MotorOutput):
        def __call__(self, command, battery_V):
            asked.append(command["torque_N_m"][0, 0] * controller.thrust_scale)

    controller = Geometric(lag_s=lag_s)
    controller.reset(1)
    controller.drive_with(Motors(1, 0.002))
    torque, followed, slow = np.zeros(1, WRENCH), [], 0.0
    for _ in range(200):
        torque["torque_N_m"] = 1e-3
        controller._drive(torque, np.array([3.7]))
        slow += (1.0 - np.exp(-0.002 / max(lag_s, LAG_S))) * (asked[-1] - slow)
        followed.append(slow)
    expected = 1e-3 * (1.0 - np.exp(-0.002 * np.arange(1, 201) / LAG_S))
    assert followed == pytest.approx(expected, abs=3e-5)
