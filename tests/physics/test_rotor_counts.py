"""Vehicles of three to eight rotors: every way to evaluate a model gives the same, and files and messages know them."""

import ctypes
import subprocess

import numpy as np
import pytest
from physics_cases import ALL

from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, Vehicle, numeric, symbolic
from nanobench_tools.physics.ccode import write_c
from nanobench_tools.physics.export import export_model
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.physics.simulator import dumps, loads, read_quadrotor


def model_of(rotors: int) -> Model:
    """Every term on motors in a ring."""
    angles = -np.pi * (2.0 * np.arange(rotors) + 1.0) / rotors
    vehicle = Vehicle(motor_positions_m=tuple((0.05 * float(np.cos(a)), 0.05 * float(np.sin(a))) for a in angles),
                      spin=tuple((-1.0) ** (k + 1) for k in range(rotors)))
    gains = np.linspace(0.97, 1.03, rotors)
    return Model(vehicle, {**ALL, "motor_imbalance": {"g": tuple(gains / gains.mean())}})


def drawn(model: Model, n: int = 5, rows: int = 12, past: int = 10):
    rng = np.random.default_rng(model.rotors)
    start = np.concatenate([rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(0.5, 1.5, (n, 1)), rng.normal(size=(n, 3)),
                            rng.normal(size=(n, 4)), rng.normal(size=(n, 3))], axis=1)
    return (start, rng.uniform(0.4, 0.8, (n, rows, model.rotors)), rng.uniform(3.4, 4.1, (n, rows)),
            (rng.uniform(0.4, 0.8, (n, past, model.rotors)), rng.uniform(3.4, 4.1, (n, past))))


@pytest.mark.parametrize("rotors", [3, 6, 8])
def test_compiled_rollouts_are_the_plain_ones(rotors):
    model = model_of(rotors)
    given = drawn(model)
    found = rollout(model, *given)
    assert found.shape == (5, 13, 13 + rotors)
    np.testing.assert_allclose(found, numeric.rollout(model, *given), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("rotors", [6, 8])
def test_casadi_and_c_give_the_same_derivative(rotors, tmp_path):
    model = model_of(rotors)
    rng = np.random.default_rng(rotors)
    start, motor, battery, _ = drawn(model)
    states = np.concatenate([start, rng.uniform(0.02, 0.1, (5, rotors))], axis=1)
    states[:, 6:10] /= np.linalg.norm(states[:, 6:10], axis=1, keepdims=True)
    inputs = np.concatenate([motor[:, 0], battery[:, :1], motor[:, 1], np.ones((5, 1))], axis=1)
    assert len(model.inputs) == inputs.shape[1]
    plain = numeric.derivative(model, states, inputs)
    function = symbolic.derivative(model)
    source, _ = write_c(model, tmp_path)
    library = tmp_path / "model.so"
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
    call = ctypes.CDLL(str(library)).model_derivative
    for x, u, expected in zip(states, inputs, plain, strict=True):
        np.testing.assert_allclose(np.array(function(x, u, model.values)).ravel(), expected, rtol=1e-10, atol=1e-12)
        arrays = [np.ascontiguousarray(a, float) for a in (x, u, model.values)]
        out, work = np.zeros(len(x)), np.zeros(10000)
        pointers = (ctypes.POINTER(ctypes.c_double) * 3)(*(a.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
                                                           for a in arrays))
        result = (ctypes.POINTER(ctypes.c_double) * 1)(out.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
        assert call(pointers, result, None, work.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), 0) == 0
        np.testing.assert_allclose(out, expected, rtol=1e-10, atol=1e-12)


def test_moments_of_a_hexarotor_by_hand():
    """Two motors a side: only their arms and spins turn it."""
    positions = tuple((0.2 * np.cos(a), 0.2 * np.sin(a)) for a in np.radians([30, 90, 150, 210, 270, 330]))
    vehicle = Vehicle(2.0, (0.02, 0.02, 0.04), positions, (1.0, -1.0) * 3, 9.81)
    model = Model(vehicle, {"thrust_pwm": {"c": (0.0, 10.0)}, "yaw_torque": {"k_m": 0.02}})
    thrust = np.array([3.0, 3.0, 3.0, 3.0, 3.0, 4.0])
    state = np.zeros((1, 19))
    state[0, 9] = 1.0
    slope = numeric.derivative(model, state, np.array([[*(thrust / 10.0), 4.0]]))[0]
    np.testing.assert_allclose(slope[5], 19.0 / 2.0 - 9.81)
    x, y = positions[5]
    np.testing.assert_allclose(slope[10:13], [y / 0.02, -x / 0.02, -0.02 / 0.04], atol=1e-12)


def test_a_file_holds_them(tmp_path):
    model = model_of(6)
    assert loads(dumps(model)) == model
    assert len(model.state) == 19
    (tmp_path / "hexa.toml").write_text(dumps(model))
    with pytest.raises(InputError, match="6 rotors, and the trim knows quadrotors only"):
        read_quadrotor(tmp_path / "hexa.toml", "the trim")


@pytest.mark.parametrize(("changes", "words"), [
    ({"motor_positions_m": ((0.1, 0.0), (-0.1, 0.0))}, "give 3 to 8 lists of 2 numbers"),
    ({"motor_positions_m": ((0.1, 0.0),) * 9, "spin": (1.0,) * 9}, "give 3 to 8 lists of 2 numbers"),
    ({"spin": (1.0, -1.0, 1.0)}, "4 motors have positions and 3 a spin"),
])
def test_other_numbers_of_motors_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        Model(Vehicle(**changes), {"thrust_pwm": {"c": (0.0, 0.2)}})


def test_gains_are_as_many_as_rotors():
    with pytest.raises(InputError, match="give a list of 6 numbers"):
        model_of(6).with_term("motor_imbalance", g=(1.0, 1.0, 1.0, 1.0))


def test_inputs_of_another_vehicle_are_refused():
    with pytest.raises(InputError, match=r"give \(windows, rows, 6\)"):
        rollout(model_of(6), *drawn(model_of(4)))


@pytest.mark.parametrize("target", ["rotorpy", "crazyflow", "urdf"])
def test_simulators_of_four_rotors_say_so(target, tmp_path):
    with pytest.raises(InputError, match="6 rotors, and the simulators of rotors") as error:
        export_model(model_of(6), target, tmp_path)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())
