"""A model as a predictor of Task 1, its windows, and the model against the independent practice vehicle."""

import numpy as np
import pytest
from physics_cases import ALL, CURVE, SPEED, models

from identification.naive import Naive
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS
from nanobench_tools.flight import Span
from nanobench_tools.methods import Predictor
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.predictor import ModelPredictor
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.physics.simulator import write_simulator
from nanobench_tools.practice import practice_flight
from nanobench_tools.practice.rigid_bodies import Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles
from nanobench_tools.protocols import task1
from nanobench_tools.protocols.windows import PAST, cut_windows

SPANS = [Span(7.0, 9.0), Span(10.0, 12.0)]


@pytest.fixture(scope="module")
def flight():
    return practice_flight(3, "circle", "slow", duration_s=8.0, spread=0.0)


def practice_model(vehicles, rate_hz=100.0):
    """What the practice vehicle is made of, in terms."""
    mass = float(vehicles.mass_kg[0])
    lateral, vertical = float(vehicles.drag_lateral_1_s[0]), float(vehicles.drag_vertical_1_s[0])
    arm = float(vehicles.arm_m[0])
    return Model(
        Vehicle(mass_kg=mass, rate_hz=rate_hz,
                motor_positions_m=((arm, -arm), (-arm, -arm), (-arm, arm), (arm, arm))),
        {"thrust_voltage": {"c": COEFFICIENTS}, "thrust_scale": {"s": vehicles.thrust_scale[0]},
         "motor_imbalance": {"g": vehicles.motor_gain[:, 0]},
         "motor_lag": {"tau_up_s": vehicles.motor_tau_s[0], "tau_down_s": vehicles.motor_tau_s[0]},
         "yaw_torque": {"k_m": vehicles.yaw_arm_m[0]},
         "drag_linear": {"d": np.array([lateral, lateral, vertical]) * mass},
         "drag_torque": {"c": vehicles.drag_torque_N_s[0]}})


def test_flies_as_the_practice_vehicle():
    """Two implementations of the same physics, written apart: 0.3 s of flight from a fast, tilted start."""
    vehicles = draw_vehicles([np.random.default_rng(4)])
    model = practice_model(vehicles, 1000.0)
    plant = Plant(vehicles, np.array([[0.0, 0.0, -5.0]]), np.array([0.4]))
    rng = np.random.default_rng(0)
    plant.state[2:6, 0], plant.state[10:13, 0] = [1.0, 1.0, -0.5, 0.3], [2.0, -1.0, 3.0]
    plant.state[6:10, 0] = so3.exp(np.array([0.3, -0.2, 0.4]))
    plant.state[13:, 0] = rng.uniform(0.06, 0.12, 4)
    start, motor, battery, states = plant.state[:, 0].copy(), [], [], []
    for _ in range(300):
        motor.append(rng.uniform(0.6, 0.9, 4))
        plant.apply(motor[-1][None])
        battery.append(plant.battery_V[0])
        plant.step(0.001)
        states.append(plant.state[:, 0].copy())
    found = rollout(model, start[None], np.array([motor]), np.array([battery]))
    np.testing.assert_allclose(found[0, 1:, :13], np.array(states)[:, :13], atol=1e-8)
    np.testing.assert_allclose(found[0, 1:, 13:], np.array(states)[:, 13:], atol=1e-9)


@pytest.mark.slow
def test_windows_bring_half_a_second_of_inputs(flight):
    windows, _ = cut_windows(flight, SPANS, "mocap")
    assert windows.motor_past.shape == (len(windows), PAST, 4)
    starts = np.arange(len(windows))
    np.testing.assert_array_equal(windows.motor_past[0], np.repeat(windows.motor[0, :1], PAST, axis=0))
    later = starts[5]  # 50 rows on: its past is the first half second of the span
    np.testing.assert_array_equal(windows.motor_past[later], windows.motor[0])
    np.testing.assert_array_equal(windows.battery_past[later], windows.battery_V[0])
    np.testing.assert_array_equal(windows.battery_past[2, :30], np.full(30, windows.battery_V[0, 0]))
    second = next(i for i in starts[1:] if abs(windows.position_m[i] - windows.position_m[i - 1]).max() > 0.1)
    np.testing.assert_array_equal(windows.motor_past[second], np.repeat(windows.motor[second, :1], PAST, axis=0))


@pytest.mark.slow
def test_a_model_of_the_vehicle_predicts_it(flight):
    """A practice flight with its own parameters: better than the same model without its rotor lag, and than none."""
    vehicles = draw_vehicles([np.random.default_rng(0)], spread=0.0)
    model = practice_model(vehicles)
    case = task1.Case(flight, tuple(SPANS), ("all",))

    def position_error(predictor):
        value = task1.score(case, predictor, "mocap")
        return value.sums["position_mae_m"][-1] / value.windows

    fitted = ModelPredictor(model, "fitted")
    assert isinstance(fitted, Predictor)
    assert fitted.information == "state"
    error = position_error(fitted)
    assert error < position_error(ModelPredictor(model.without("motor_lag")))
    assert error < 0.7 * position_error(Naive())
    assert fitted.parameters["yaw_torque.k_m"].unit == "m"


@pytest.mark.slow
def test_predicts_from_a_file_and_without_casadi(flight, tmp_path, monkeypatch):
    windows, _ = cut_windows(flight, SPANS, "onboard")
    model = models()["all"]
    write_simulator(model, tmp_path / "mine.toml")
    predictor = ModelPredictor.from_file(tmp_path / "mine.toml")
    assert predictor.name == "mine"
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    plain = ModelPredictor(model)
    assert plain._rollout is numeric.rollout
    for name in ("position_m", "velocity_m_s", "quaternion", "rate_rad_s"):
        np.testing.assert_allclose(getattr(predictor.predict(windows), name), getattr(plain.predict(windows), name),
                                   rtol=1e-10, atol=1e-10)


def test_measured_speeds_are_not_in_the_windows():
    with pytest.raises(InputError, match="PWM"):
        ModelPredictor(Model(Vehicle(input="rpm"), {**SPEED, "yaw_torque": ALL["yaw_torque"]}))


def test_parameters_of_the_windows_past_matter():
    """With the same window, another past changes the flight through the lag, and only then."""
    rng = np.random.default_rng(1)
    start = np.array([[0, 0, 1.0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]])
    motor, battery = rng.uniform(0.6, 0.9, (1, 20, 4)), np.full((1, 20), 3.7)
    pasts = [(np.full((1, 50, 4), u), np.full((1, 50), 3.7)) for u in (0.3, 0.9)]
    for terms, differs in ((CURVE, False), ({**CURVE, "motor_lag": ALL["motor_lag"]}, True)):
        a, b = (rollout(Model(Vehicle(), terms), start, motor, battery, past)[..., :13] for past in pasts)
        assert (np.abs(a - b).max() > 1e-3) == differs
