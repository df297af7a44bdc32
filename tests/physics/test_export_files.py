"""What is written for crazyflow, gym-pybullet-drones, C and CasADi, against equations written down once more here."""

import json
import os
import runpy
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from physics_cases import CURVE, draw, models

from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.export import TARGETS, Assumed, export_model

RPM = np.pi / 30.0
FIRST_PRINCIPLES = {
    "thrust_rpm": {"k_f": 2.3e-8}, "yaw_torque": {"k_m": 0.006}, "thrust_scale": {"s": 0.95}, "mass": {"m": 0.0413},
    "inertia": {"inertia_kg_m2": (1.9e-5, 1.7e-5, 3.2e-5)}, "drag_linear": {"d": (0.016, 0.0165, 0.006)},
    "rotor_gyro": {"J_r": -2e-8}, "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.05}}


def hovering(model, n, seed):
    """States with rotors in hover, inputs, and the rotor speeds [rad/s]."""
    states, inputs = draw(model, n, seed)
    states[:, 13:] = 0.0413 * 9.81 / 4.0
    return states, inputs, np.sqrt(states[:, 13:] / (2.3e-8 * 0.95))


def test_crazyflow_first_principles(tmp_path):
    """Its equations as its documentation gives them, Omega in RPM."""
    model = Model(Vehicle(input="rpm"), FIRST_PRINCIPLES)
    p = {key: np.array(value) for key, value in
         tomllib.loads(export_model(model, "crazyflow", tmp_path).files[0].read_text())["fitted"].items()}
    given = hovering(model, 20, 1)
    for x, u, omega, wanted in zip(*given, numeric.derivative(model, *given[:2]), strict=True):
        rotor, command, rate = omega / RPM, u[:4] / RPM, x[10:13]
        a = np.where(command > rotor, p["rotor_dyn_coef"][0], p["rotor_dyn_coef"][2])
        b = np.where(command > rotor, p["rotor_dyn_coef"][1], p["rotor_dyn_coef"][3])
        slope = a * (command - rotor) + b * (command**2 - rotor**2)
        force, torque = (np.polyval(p[key][::-1], rotor) for key in ("rpm2thrust", "rpm2torque"))
        turn = _matrix(x[6:10])
        acceleration = turn @ (np.array([0.0, 0.0, force.sum()]) + p["drag_matrix"] @ turn.T @ x[3:6]) / p["mass"]
        moment = p["mixing_matrix"] @ force * p["L"] * [1, 1, 0] + p["mixing_matrix"] @ torque * [0, 0, 1]
        moment += p["prop_inertia"] * np.cross([0, 0, 1], rate) * -(p["mixing_matrix"][2] @ omega)
        moment -= np.cross(rate, p["J"] @ rate)
        np.testing.assert_allclose(acceleration + p["gravity_vec"], wanted[3:6], atol=1e-12)
        np.testing.assert_allclose(np.linalg.solve(p["J"], moment), wanted[10:13], atol=1e-9)
        np.testing.assert_allclose(2.0 * 2.3e-8 * 0.95 * omega * slope * RPM, wanted[13:], atol=1e-12)


def _matrix(quaternion):
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quaternion).as_matrix()


@pytest.mark.parametrize("change", [{}, {"com_offset": {"r_m": (0.001, -0.002, 0.0)}}])
@pytest.mark.slow
def test_drone_models_itself(change, tmp_path):
    """In a process of its own, because the package wants to be imported before SciPy. No gyroscopic moment here: its
    0.1.0 has one component with the wrong sign, and adds the moment of rotors that change their speed; an offset of the
    centre of mass without drag, whose moment it lacks."""
    out = {"rotor_gyro", "drag_linear"} if change else {"rotor_gyro"}
    model = Model(Vehicle(input="rpm"), {**FIRST_PRINCIPLES, **change}).without(*out)
    path = export_model(model, "crazyflow", tmp_path).files[0]
    states, inputs, omega = hovering(model, 5, 2)
    given = {"toml": str(path), "states": states.tolist(), "rotor": (omega / RPM).tolist(),
             "command": (inputs[:, :4] / RPM).tolist()}
    done = subprocess.run([sys.executable, "-c", _DRONE_MODELS], input=json.dumps(given), capture_output=True,
                          text=True, env={**os.environ, "SCIPY_ARRAY_API": "1"}, check=False)
    assert done.returncode == 0, done.stderr
    wanted = numeric.derivative(model, states, inputs)
    for found, ours in zip(json.loads(done.stdout), wanted, strict=True):
        np.testing.assert_allclose(found[0], ours[3:6], atol=1e-12)
        np.testing.assert_allclose(found[1], ours[10:13], atol=1e-9)


_DRONE_MODELS = """
import inspect, json, sys, tomllib
from drone_models.first_principles import dynamics
import numpy as np
given = json.load(sys.stdin)
p = tomllib.load(open(given["toml"], "rb"))["fitted"]
p["J_inv"] = np.linalg.inv(p["J"])
names = [n for n, q in inspect.signature(dynamics).parameters.items() if q.kind == q.KEYWORD_ONLY]
keys = {n: np.asarray(p[n], float) for n in names}
found = []
for x, rotor, command in zip(np.array(given["states"]), given["rotor"], given["command"]):
    made = dynamics(x[:3], x[6:10], x[3:6], x[10:13], np.array(command), np.array(rotor), **keys)
    found.append([made[2].tolist(), made[3].tolist()])
print(json.dumps(found))
"""


def test_urdf_holds_the_numbers_where_they_are_looked_for(tmp_path):
    """By the places of the elements, as gym_pybullet_drones/envs/BaseAviary.py reads them."""
    model = Model(Vehicle(), {
        **CURVE, "thrust_rpm": {"k_f": 2.3e-8}, "yaw_torque": {"k_m": 0.006}, "mass": {"m": 0.0413},
        "com_offset": {"r_m": (0.001, -0.002, 0.003)}, "drag_rotor": {"d": (2e-6, 3e-6, 7e-7)},
        "ground_effect": {"rho": 1.2, "R": 0.02}})
    tree = ET.parse(export_model(model, "urdf", tmp_path).files[0]).getroot()
    properties = {key: float(value) for key, value in tree[0].attrib.items()}
    assert float(tree[1][0][1].attrib["value"]) == 0.0413
    assert [float(tree[1][0][2].attrib[key]) for key in ("ixx", "iyy", "izz")] == [1.8e-5, 1.8e-5, 3.1e-5]
    assert tree[1][2].tag == "collision"
    assert float(tree[1][2][1][0].attrib["length"]) > 0
    assert float(tree[1][2][0].attrib["xyz"].split(" ")[2]) == 0
    assert properties["kf"] * 1000.0**2 == pytest.approx(2.3e-8 * (1000.0 * RPM) ** 2)
    assert properties["km"] / properties["kf"] == pytest.approx(0.006)
    assert properties["arm"] == pytest.approx(0.0325 * np.sqrt(2.0), rel=1e-3)
    assert (properties["gnd_eff_coeff"], properties["prop_radius"]) == (1.2, 0.02)
    assert (properties["drag_coeff_xy"], properties["drag_coeff_z"]) == pytest.approx((2.5e-6, 7e-7))
    at = np.polyval(CURVE["thrust_voltage"]["c"][::-1], 3.7)
    assert properties["thrust2weight"] == pytest.approx(4.0 * at / (0.0413 * 9.8), rel=1e-6)
    names = ["prop0_link", "prop1_link", "prop2_link", "prop3_link", "center_of_mass_link"]
    assert [joint.find("child").get("link") for joint in tree.findall("joint")] == names  # links 0..4 of PyBullet
    origins = [tree.find(f"link[@name='{name}']/inertial/origin") for name in names]
    places = [[float(v) for v in origin.get("xyz").split()] for origin in origins]
    np.testing.assert_allclose(places[0], [0.0315, -0.0305, -0.003])
    thrust, signs = np.array([0.1, 0.11, 0.12, 0.13]), np.array([-1, 1, -1, 1])
    found = sum(np.cross(place, [0, 0, t]) for place, t in zip(places, thrust, strict=False))
    found[2] = properties["km"] / properties["kf"] * signs @ thrust
    state = np.concatenate([[0.0, 0.0, 1e4], np.zeros(6), [1.0], np.zeros(3), thrust])
    lagging = model.with_term("motor_lag", tau_up_s=0.03, tau_down_s=0.03)  # the state's thrusts act
    ours = numeric.derivative(lagging, state[None], np.array([[0.5] * 4 + [3.7]]))[0]
    np.testing.assert_allclose(found / [1.8e-5, 1.8e-5, 3.1e-5], ours[10:13], rtol=1e-9)


def test_propellers_are_ordered_by_their_spin(tmp_path):
    model = Model(Vehicle(spin=(1.0, -1.0, 1.0, -1.0)), CURVE)
    exported = export_model(model, "urdf", tmp_path)
    origin = ET.parse(exported.files[0]).find("link[@name='prop0_link']/inertial/origin")
    assert origin.get("xyz") == "-0.0325 -0.0325 0.0"  # motor 2, the first that spins so
    assert "motors 2, 3, 4, 1" in exported.account.assumed["order"]
    with pytest.raises(InputError, match="spin"):
        export_model(model.on(spin=(1.0, 1.0, -1.0, -1.0)), "urdf", tmp_path)


def test_casadi_files_step_as_the_model_does(tmp_path):
    model = models()["all"]
    loaded = runpy.run_path(str(export_model(model, "casadi", tmp_path).files[0]))
    assert loaded["PARAMETERS"] == model.parameters
    states, inputs = draw(model, 5, 3)
    for x, u, y in zip(states, inputs, numeric.step(model, states, inputs), strict=True):
        np.testing.assert_allclose(np.array(loaded["step"](x, u, loaded["p"])).ravel(), y, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("to", TARGETS)
def test_every_term_of_every_model_is_accounted_for_once(to, tmp_path):
    chosen = models() if to in ("rotorpy", "crazyflow", "urdf") else {"all": models()["all"]}
    for name, model in chosen.items():
        found = export_model(model, to, tmp_path / name).account
        parts = [*found.exact, *found.commands, *found.approximated, *found.left_out]
        assert sorted(parts) == sorted(term.name for term in model.terms)
        text = "".join(path.read_text() for path in export_model(model, to, tmp_path / name).files)
        assert all(term in text for term in (*found.approximated, *found.left_out, *found.assumed))


def test_what_is_assumed_is_an_argument_and_in_the_file(tmp_path):
    model = Model(Vehicle(), CURVE)
    for to in ("rotorpy", "crazyflow", "urdf"):
        one, two = (export_model(model, to, tmp_path / str(V), Assumed(battery_V=V, k_f=3e-8)) for V in (3.7, 4.1))
        assert one.files[0].read_text() != two.files[0].read_text()
        assert "4.1 V" in two.files[-1].read_text()
        assert "3e-08" in two.files[-1].read_text()
        assert two.account.assumed["battery_V"].startswith("4.1 V")


@pytest.mark.parametrize(("model", "to", "hint"), [
    (Model(Vehicle(mass_kg=0.4), CURVE), "rotorpy", "cannot hover: greatest thrust of a motor 0.193 N at 3.7 V"),
    (Model(replace(Vehicle(), gravity_m_s2=0.0), CURVE), "crazyflow", "gravity is 0"),
    (Model(Vehicle(motor_positions_m=((0.0, 0.0),) * 4), CURVE), "crazyflow", "at the centre"),
    (Model(Vehicle(input="rpm"), {"thrust_rpm": {"k_f": 2e-8}, "saturation": {"T_max_N": 0.09}}), "urdf", "T_max_N")])
def test_models_that_do_not_fit_are_one_line(model, to, hint, tmp_path):
    with pytest.raises(InputError) as error:
        export_model(model, to, tmp_path)
    assert hint in str(error.value)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_unknown_simulators_and_impossible_assumptions(tmp_path):
    with pytest.raises(UsageError, match="gazebo"):
        export_model(Model(Vehicle(), CURVE), "gazebo", tmp_path)
    for bad in ({"battery_V": float("nan")}, {"k_f": 0.0}, {"thrust_to_weight": 0.9}):
        with pytest.raises(InputError, match=next(iter(bad))):
            Assumed(**bad)
