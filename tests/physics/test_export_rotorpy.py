"""Exported parameters flown in RotorPy against our own model: two implementations, one vehicle.

Tolerances: RotorPy integrates to 1e-12; our Runge-Kutta 4 is what differs, so its error has to fall sixteenfold with
half the step, down to 1e-9 in every state of half a second of tumbling. What is equal at one point is tested there.
"""

import json
import runpy
import sys

import numpy as np
import pytest
from physics_cases import CURVE, models

from nanobench_tools.errors import InputError, MissingExtraError
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.adapters.rotorpy import RotorPySimulator
from nanobench_tools.physics.export import Assumed, export_model
from nanobench_tools.physics.export.rotorpy_params import quad_params

BOTH = {"yaw_torque": {"k_m": 0.006}, "inertia": {"inertia_kg_m2": (1.9e-5, 1.7e-5, 3.2e-5)}, "mass": {"m": 0.0413},
        "com_offset": {"r_m": (0.001, -0.002, 0.003)}, "motor_imbalance": {"g": (1.04, 0.97, 1.01, 0.98)},
        "thrust_scale": {"s": 0.95}}
"""What both can express."""
RPM, PWM = {"thrust_rpm": {"k_f": 2.3e-8}, **BOTH}, {**CURVE, "saturation": {"T_max_N": 0.13}, **BOTH}
START = np.array([0.0, 0.0, 1.0, 0.5, -0.3, 0.2, 0.1, -0.2, 0.3, 0.9, 1.0, -2.0, 0.5])
ROWS, ROW_HZ = 50, 100.0


def simulator(model, folder, **options):
    return RotorPySimulator.from_file(export_model(model, "rotorpy", folder).files[0], tolerance=1e-12, **options)


def flown(model, folder, motor, start=START):
    """States (rows + 1, 17) of our model and of RotorPy."""
    battery = np.linspace(4.0, 3.5, len(motor))
    ours = numeric.rollout(model, start[None], motor[None], battery[None], row_hz=ROW_HZ)[0]
    there = simulator(model, folder)
    return ours, there.rollout(ours[0], there.speeds(motor, battery, row_hz=ROW_HZ), 1.0 / ROW_HZ)


@pytest.mark.parametrize("kind", ["rpm", "pwm"])
@pytest.mark.slow
def test_the_same_commands_give_the_same_flight(kind, tmp_path):
    rng = np.random.default_rng(1)
    motor = rng.uniform(1500.0, 2200.0, (ROWS, 4)) if kind == "rpm" else rng.uniform(0.5, 0.8, (ROWS, 4))
    errors = []
    for rate_hz in (400.0, 800.0):
        model = Model(Vehicle(input=kind, rate_hz=rate_hz), RPM if kind == "rpm" else PWM)
        ours, theirs = flown(model, tmp_path, motor)
        errors.append(np.max(np.abs(ours - theirs)))
    assert np.ptp(ours[:, 6:10], axis=0).min() > 0.05  # it did tumble about all axes
    assert errors[1] < 1e-9
    assert 14.0 < errors[0] / errors[1] < 18.0


def test_a_delayed_command_is_delayed_there_too(tmp_path):
    motor = np.random.default_rng(2).uniform(0.5, 0.8, (ROWS, 4))
    model = Model(Vehicle(rate_hz=800.0), {**PWM, "command_delay": {"delay_s": 0.023}})
    ours, theirs = flown(model, tmp_path, motor)
    assert np.max(np.abs(ours - theirs)) < 1e-9


@pytest.mark.parametrize(("drag", "speed"), [("drag_rotor", (2.0, -1.0, 0.5)), ("drag_quadratic", (0.0, 0.0, -3.0))])
@pytest.mark.slow
def test_drag_is_exact_in_flights_without_rotation(drag, speed, tmp_path):
    values = {"drag_rotor": {"d": (2e-6, 2e-6, 7e-7)}, "drag_quadratic": {"q": (0.003, 0.002, 0.004)}}[drag]
    model = Model(Vehicle(input="rpm", rate_hz=800.0), {"thrust_rpm": {"k_f": 2.3e-8}, drag: values})
    tilted = (0.1, -0.05, 0.2, 0.97) if drag == "drag_rotor" else (0.0, 0.0, 0.0, 1.0)
    start = np.concatenate([[0.0, 0.0, 1.0], speed, tilted, [0.0, 0.0, 0.0]])
    motor = np.repeat(np.random.default_rng(3).uniform(1500.0, 2200.0, (ROWS, 1)), 4, axis=1)
    ours, theirs = flown(model, tmp_path, motor, start)
    still = numeric.rollout(model.without(drag), start[None], motor[None], np.zeros((1, ROWS)), row_hz=ROW_HZ)[0]
    assert np.max(np.abs(ours - still)) > 0.05
    assert np.max(np.abs(ours - theirs)) < 1e-9


@pytest.mark.slow
def test_a_lag_is_the_same_for_small_changes(tmp_path):
    """Thrusts lag here, speeds there: half the change leaves a quarter of the difference."""
    model = Model(Vehicle(input="rpm", rate_hz=800.0),
                  {"thrust_rpm": {"k_f": 2.3e-8}, "motor_lag": {"tau_up_s": 0.04, "tau_down_s": 0.04}})
    hover = quad_params(model)[0]["rotor_speed_max"] / np.sqrt(2.0)  # the greatest thrust is twice the weight
    pattern = np.random.default_rng(4).choice([-1.0, 1.0], (ROWS, 4))
    pattern[0] = 0.0
    differences = []
    for change in (0.02, 0.01):
        ours, theirs = flown(model, tmp_path, hover * (1.0 + change * pattern))
        differences.append(np.max(np.abs(ours - theirs)[:, 13:]) / (change * 0.1))
    assert differences[0] < 0.05  # of the change of thrust itself
    assert differences[0] / differences[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize(("term", "values", "air"), [
    ("drag_linear", {"d": (0.016, 0.016, 0.006)}, (1.0, -2.0, 0.5)),
    ("drag_quadratic", {"q": (0.003, 0.002, 0.004)}, (0.0, 2.0, 0.0)),
    ("drag_torque", {"c": -1.5e-4}, (1.0, -2.0, 0.5)),
    ("inflow", {"k_z": 0.014, "k_h": 0.005}, (1.0, -2.0, 0.5))])
def test_what_is_approximated_is_equal_at_hover(term, values, air, tmp_path):
    model = Model(Vehicle(input="rpm"), {"thrust_rpm": {"k_f": 2.3e-8}, term: values})
    hover = 0.04085 * 9.81 / 4.0
    state = np.concatenate([[0.0, 0.0, 1.0], air, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], np.full(4, hover)])
    inputs = np.append(np.full(4, np.sqrt(hover / 2.3e-8)), 3.7)
    ours = numeric.derivative(model, state[None], inputs[None])[0]
    found = simulator(model, tmp_path).accelerations(state[None])[0]
    assert np.max(np.abs(ours[3:6])) + np.max(np.abs(ours[10:13])) > 0.1
    np.testing.assert_allclose(found[:3], ours[3:6], atol=1e-12)
    np.testing.assert_allclose(found[3:], ours[10:13], atol=1e-10)


def test_wind_blows_there_too(tmp_path):
    model = Model(Vehicle(input="rpm", rate_hz=800.0), {"thrust_rpm": {"k_f": 2.3e-8},
                  "drag_rotor": {"d": (2e-6, 2e-6, 7e-7)}, "wind": {"w_m_s": (2.0, -1.0, 0.5)}})
    start = np.concatenate([np.zeros(9), [1.0], np.zeros(3)])
    ours, theirs = flown(model, tmp_path, np.full((ROWS, 4), 2000.0), start)
    assert abs(ours[-1, 3]) > 0.05
    assert np.max(np.abs(ours - theirs)) < 1e-9


def test_every_term_is_accounted_for_and_named_in_the_file(tmp_path):
    for model in models().values():
        json_file, module = export_model(model, "rotorpy", tmp_path, Assumed(battery_V=4.2)).files
        beside = json.loads(json_file.read_text())["nanobench"]
        parts = [beside[kind] for kind in ("exact", "approximated", "left_out")] + [beside["commands"]["terms"]]
        assert set().union(*parts) >= {term.name for term in model.terms}
        assert all(name in module.read_text() for name in (*parts[1], *parts[2]))


def test_the_python_file_is_what_rotorpy_takes(tmp_path):
    from rotorpy.vehicles.crazyflie_params import quad_params as reference
    from rotorpy.vehicles.multirotor import Multirotor

    files = export_model(models()["all"], "rotorpy", tmp_path).files
    found = runpy.run_path(str(files[1]))["quad_params"]
    assert set(found) == set(reference)
    assert Multirotor(found).mass == 0.0413
    numbers = json.loads(files[0].read_text())
    assert all(numbers[key] == value for key, value in found.items() if isinstance(value, float))


def test_rotorpys_own_parameters_fly():
    from rotorpy.vehicles.crazyflie_params import quad_params as crazyflie

    there = RotorPySimulator(crazyflie)
    hover = np.sqrt(crazyflie["mass"] * 9.81 / 4.0 / crazyflie["k_eta"])
    level = np.concatenate([[0.0, 0.0, 1.0], np.zeros(6), [1.0], np.zeros(3)])
    states = there.rollout(level, np.full((5, 4), hover), 0.01)
    np.testing.assert_allclose(states[-1, :6], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], atol=1e-12)
    with pytest.raises(InputError, match="no map from PWM"):
        there.speeds(np.full((5, 4), 0.5), np.full(5, 3.7), row_hz=100.0)


@pytest.mark.parametrize(("key", "value", "hint"), [
    ("mass", None, "key mass: is missing"), ("mass", -1.0, "key mass: -1.0; give a positive"),
    ("k_eta", "2e-8", "key k_eta: '2e-8' is no finite number"), ("tau_m", 0.0, "key tau_m"),
    ("rotor_pos", {"r1": [0, 0, 0]}, "key rotor_pos: is not what four rotors need"),
    ("rotor_directions", [1, -1, 1], "key rotor_directions"), ("nanobench", {"schema": "other/1"}, "other/1"),
    ("nanobench", {"schema": "nanobench-rotorpy/1"}, "key nanobench: cannot be used")])
def test_bad_parameters_are_one_line_that_names_the_key(key, value, hint, tmp_path):
    path = export_model(models()["all"], "rotorpy", tmp_path).files[0]
    params = json.loads(path.read_text())
    params.pop(key)
    path.write_text(json.dumps(params if value is None else {**params, key: value}))
    with pytest.raises(InputError) as error:
        RotorPySimulator.from_file(path)
    assert str(error.value).startswith(str(path))
    assert hint in str(error.value)
    assert "\n" not in str(error.value)


def test_without_rotorpy_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rotorpy.vehicles.multirotor", None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[rotorpy\]"):
        simulator(Model(Vehicle(input="rpm"), RPM), tmp_path)


def test_bad_flights_are_refused(tmp_path):
    there = simulator(Model(Vehicle(input="rpm"), RPM), tmp_path)
    for start, asked, dt_s in ((START[:12], np.zeros((3, 4)), 0.01), (START, np.zeros((3, 3)), 0.01),
                               (START, np.full((3, 4), np.nan), 0.01), (START, np.zeros((3, 4)), 0.0)):
        with pytest.raises(InputError, match="rollout"):
            there.rollout(start, asked, dt_s)
    with pytest.raises(InputError, match="accelerations"):
        there.accelerations(START)
    with pytest.raises(InputError, match="cannot be read"):
        RotorPySimulator.from_file(tmp_path / "absent.json")
