"""The integration: its order, its limits, and what must hold whatever the code: invariances, conserved quantities."""

import numpy as np
import pytest
from physics_cases import ALL, CURVE, draw, models, windows
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from nanobench_tools import so3
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, ROTOR, VELOCITY

MODELS = models()
SMOOTH = {name: values for name, values in ALL.items()
          if name not in ("saturation", "ground_effect", "drag_quadratic", "command_delay")}

COUNTS = {False: (16, 32, 64), True: (64, 128, 256)}
"""Steps in 80 ms; a short lag needs steps below it before an order shows."""


def thrust_of(voltage):
    return np.polyval(CURVE["thrust_voltage"]["c"][::-1], voltage)


def exact(model, state, inputs, duration_s):
    found = solve_ivp(lambda _, x: numeric.derivative(model, x[None], inputs)[0], (0, duration_s), state, rtol=1e-12,
                      atol=1e-13, method="DOP853")
    return found.y[:, -1]


LAGS = [None, {"tau_up_s": 0.03, "tau_down_s": 0.05}, {"tau_up_s": 0.004, "tau_down_s": 0.003}]


@pytest.mark.parametrize("lag", LAGS)
def test_order_four(lag):
    """Halving the step divides the error by 16, against SciPy at 1e-12."""
    terms = {name: values for name, values in SMOOTH.items() if name != "motor_lag"}
    model = Model(Vehicle(), terms if lag is None else {**terms, "motor_lag": lag})
    states, inputs = draw(model, 1, 5)
    states[0, RATE] = [3.0, -4.0, 2.0]
    inputs[0, :4] = [0.5, 0.9, 0.7, 0.8]  # no thrust crosses zero, where the rotor speed has a kink
    truth = exact(model, states[0], inputs, 0.08)
    errors = []
    for count in COUNTS[lag is not None and lag["tau_up_s"] < 0.01]:
        fine, x = model.on(rate_hz=count / 0.08), states
        for _ in range(count):
            x = numeric.step(fine, x, inputs)
        errors.append(np.linalg.norm((x[0] - truth)[:13]))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(4.0, abs=0.4), (errors, orders)


def test_substeps_are_steps_of_the_faster_rate():
    model = Model(Vehicle(rate_hz=500.0), {**CURVE, "motor_lag": ALL["motor_lag"]})
    states, inputs = draw(model, 2, 1)
    x = states
    for _ in range(5):
        x = numeric.step(model, x, inputs, row_hz=500.0)
    np.testing.assert_allclose(numeric.step(model, states, inputs, row_hz=100.0), x, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("tau", [0.0, 1e-7, 1e-4, 0.002])
def test_short_lags_are_stable_and_tend_to_none(tau):
    lagged = Model(Vehicle(), {**CURVE, "motor_lag": {"tau_up_s": tau, "tau_down_s": tau}})
    start, motor, battery, past = windows(lagged, 3, 2)
    at_once = numeric.rollout(Model(Vehicle(), CURVE), start, motor, battery, past)
    found = numeric.rollout(lagged, start, motor, battery, past)
    assert np.abs(found[..., :3] - at_once[..., :3]).max() <= 8.0 * tau
    if tau == 0.0:
        np.testing.assert_allclose(found[..., :13], at_once[..., :13], rtol=1e-13, atol=1e-13)


def test_lag_is_the_exponential():
    model = Model(Vehicle(), {**CURVE, "motor_lag": {"tau_up_s": 0.02, "tau_down_s": 0.06}})
    states, inputs = draw(model, 1, 9)
    command = thrust_of(inputs[0, :4] * inputs[0, 4])
    before = states[0, ROTOR]
    tau = np.where(command > before, 0.02, 0.06)
    after = command + (before - command) * np.exp(-0.01 / tau)
    np.testing.assert_allclose(numeric.step(model, states, inputs)[0, ROTOR], after, rtol=1e-13)


def test_free_fall():
    model = Model(Vehicle(), {"thrust_pwm": {"c": [0.0]}})
    n, horizon = 3, 50
    start = draw(model, n, 4)[0][:, :13]
    start[:, RATE] = 0.0
    states = numeric.rollout(model, start, np.zeros((n, horizon, 4)), np.full((n, horizon), 3.7))
    t = 0.01 * np.arange(horizon + 1)[:, None]
    fall = start[:, None, POSITION] + t * start[:, None, VELOCITY] + 0.5 * t**2 * np.array([0, 0, -9.81])
    np.testing.assert_allclose(states[..., POSITION], fall, rtol=1e-12, atol=1e-12)


def test_hover_stays():
    terms = {**CURVE, **{k: ALL[k] for k in ("motor_lag", "yaw_torque", "drag_linear", "angular_damping")}}
    model = Model(Vehicle(), terms)
    u = brentq(lambda u: thrust_of(3.7 * u) - 0.04085 * 9.81 / 4, 0.3, 1.0, xtol=1e-15)
    start = np.array([[0, 0, 1.0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]])
    past = (np.full((1, 50, 4), u), np.full((1, 50), 3.7))
    states = numeric.rollout(model, start, np.full((1, 100, 4), u), np.full((1, 100), 3.7), past)
    np.testing.assert_allclose(states[0, :, :13], np.repeat(start, 101, axis=0), atol=1e-12)


def test_momentum_and_energy_of_a_body_without_moments():
    """Only gravity: angular momentum in the world and kinetic energy of rotation stay, to the order of the method."""
    model = Model(Vehicle(rate_hz=1000.0), {"thrust_pwm": {"c": [0.0]}, "inertia": ALL["inertia"]})
    start = draw(model, 4, 8)[0][:, :13]
    states = numeric.rollout(model, start, np.zeros((4, 1000, 4)), np.full((4, 1000), 3.7))
    j = np.array(ALL["inertia"]["inertia_kg_m2"])
    momentum = so3.rotate(states[..., QUATERNION], j * states[..., RATE])
    energy = 0.5 * np.sum(j * states[..., RATE] ** 2, axis=-1)
    assert np.abs(momentum / np.linalg.norm(momentum, axis=-1, keepdims=True)
                  - momentum[:, :1] / np.linalg.norm(momentum[:, :1], axis=-1, keepdims=True)).max() < 1e-7
    assert np.abs(energy / energy[:, :1] - 1).max() < 1e-7
    assert np.abs(np.linalg.norm(states[..., QUATERNION], axis=-1) - 1).max() < 1e-14


def test_drag_takes_energy_only():
    model = Model(Vehicle(gravity_m_s2=0.0), {"thrust_pwm": {"c": [0.0]}, "drag_linear": ALL["drag_linear"],
                                              "drag_quadratic": ALL["drag_quadratic"]})
    start = draw(model, 5, 8)[0][:, :13]
    states = numeric.rollout(model, start, np.zeros((5, 100, 4)), np.full((5, 100), 3.7))
    speed = np.linalg.norm(states[..., VELOCITY], axis=-1)
    assert (np.diff(speed, axis=1) < 0).all()


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.slow
def test_turning_the_world_about_its_vertical_turns_the_flight(name):
    model = MODELS[name]
    start, motor, battery, past = windows(model, 3, 6)
    turn = Rotation.from_euler("z", 1.234)
    turned_start = start.copy()
    for part in (POSITION, VELOCITY):
        turned_start[:, part] = turn.apply(start[:, part])
    turned_start[:, QUATERNION] = (turn * Rotation.from_quat(start[:, QUATERNION])).as_quat()
    world = {}  # what is fixed in the world turns with it
    for term, parameter in (("wind", "w_m_s"), ("force_world", "f_N")):
        if term in model:
            vector = turn.apply(model.values_of(term)[parameter])
            world |= {f"{term}.{parameter}[{i}]": x for i, x in enumerate(vector)}
    states = numeric.rollout(model, start, motor, battery, past)
    turned = numeric.rollout(model.with_parameters(world), turned_start, motor, battery, past)
    shape = (*states.shape[:2], 3)
    for part in (POSITION, VELOCITY):
        expected = turn.apply(states[..., part].reshape(-1, 3)).reshape(shape)
        np.testing.assert_allclose(turned[..., part], expected, atol=1e-11)
    np.testing.assert_allclose(turned[..., RATE], states[..., RATE], atol=1e-10)
    both = so3.geodesic_angle(turned[..., QUATERNION], so3.multiply(turn.as_quat(), states[..., QUATERNION]))
    assert both.max() < 1e-10


def test_quaternion_of_either_sign_flies_the_same():
    model = MODELS["all"]
    start, motor, battery, past = windows(model, 2, 6)
    other = start.copy()
    other[:, QUATERNION] *= -3.0  # another sign, and a length that is not 1
    a, b = (numeric.rollout(model, s, motor, battery, past) for s in (start, other))
    np.testing.assert_allclose(a[..., :6], b[..., :6], rtol=1e-12, atol=1e-12)


def test_delay_of_whole_rows_shifts_the_inputs():
    base = Model(Vehicle(), {**CURVE, "yaw_torque": ALL["yaw_torque"]})
    start, motor, battery, past = windows(base, 2, 3)
    battery[:], past[1][:] = 3.7, 3.7
    delayed = numeric.rollout(base.with_term("command_delay", delay_s=0.03), start, motor, battery, past)
    shifted = np.concatenate([past[0][:, -3:], motor[:, :-3]], axis=1)
    expected = numeric.rollout(base, start, shifted, battery, past)
    np.testing.assert_allclose(delayed[..., :13], expected[..., :13], rtol=1e-10, atol=1e-10)


def test_warm_up_uses_the_past_inputs():
    """Half a second of hover before the start: the rotors hover at the start whatever the window commands."""
    model = Model(Vehicle(), {**CURVE, "motor_lag": ALL["motor_lag"]})
    start, motor, battery, past = windows(model, 2, 3)
    past[0][:], past[1][:] = 0.7, 3.8
    states = numeric.rollout(model, start, motor, battery, past)
    np.testing.assert_allclose(states[:, 0, ROTOR], thrust_of(0.7 * 3.8), rtol=1e-12)


@pytest.mark.parametrize("n", [0, 1])
def test_few_windows(n):
    model = MODELS["all"]
    start, motor, battery, past = windows(model, 2, 3)
    states = numeric.rollout(model, start[:n], motor[:n], battery[:n], (past[0][:n], past[1][:n]))
    assert states.shape == (n, 21, 17)
