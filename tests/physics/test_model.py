"""The flat parameter vector, models made from models, and what a model refuses in Python."""

import subprocess
import sys

import numpy as np
import pytest
from physics_cases import ALL, CURVE, SPEED

from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.lookup import registry
from nanobench_tools.physics import Model, Vehicle, find_term
from nanobench_tools.physics.term import Stage

EFFECTS = [
    "thrust_pwm", "thrust_voltage", "thrust_rpm", "thrust_scale", "mass", "motor_lag", "command_delay",
    "motor_imbalance", "com_offset", "inertia", "yaw_torque", "rotor_gyro", "rotor_reaction", "angular_damping",
    "drag_linear", "drag_rotor", "drag_quadratic", "drag_torque", "inflow", "ground_effect", "wind",
    "force_world", "frame_tilt", "saturation", "slung_load"]


def test_all_effects_are_registered():
    assert registry.names("terms") == sorted(EFFECTS)


def test_every_stage_has_a_term():
    assert {stage for name in EFFECTS for stage in find_term(name).acts} == set(Stage)


def test_values_bounds_and_units_have_names():
    model = Model(Vehicle(), ALL)
    assert len(model.names) == len(model.units) == len(model.values) == len(set(model.names))
    assert (model.lower <= model.values).all()
    assert (model.values <= model.upper).all()
    assert model.parameters["drag_linear.d[1]"] == 0.0165
    assert model.values_of("motor_imbalance")["g"] == ALL["motor_imbalance"]["g"]
    assert model.values_of("saturation") == ALL["saturation"]


def test_changed_models_leave_the_first_as_it_was():
    model = Model(Vehicle(), {**CURVE, "thrust_scale": {"s": 0.9}})
    other = model.with_parameters({"thrust_scale.s": 0.8})
    assert (model.parameters["thrust_scale.s"], other.parameters["thrust_scale.s"]) == (0.9, 0.8)
    assert model.structure == other.structure
    assert model != other
    assert "mass" in model.with_term("mass", m=0.05)
    assert "thrust_scale" not in model.without("thrust_scale")
    with pytest.raises(ValueError, match="read-only"):
        model.values[0] = 1.0
    with pytest.raises(KeyError, match=r"thrust_scale\.s"):
        model.with_parameters({"thrust_scale.S": 1.0})
    with pytest.raises(ValueError, match="5 parameters"):
        model.with_values(np.zeros(4))


def test_optional_parameters_are_in_the_vector_only_when_given():
    assert Model(Vehicle(), {**CURVE, "saturation": {"u_max": 0.9}}).names[-1] == "saturation.u_max"


@pytest.mark.parametrize(("vehicle", "terms", "words"), [
    (Vehicle(mass_kg=40.85), CURVE, "grams"),
    (Vehicle(input="rpm"), {**SPEED, "saturation": {"u_max": 0.9}}, "T_max_N"),
    (Vehicle(input="rpm"), {**SPEED, **CURVE}, "needs PWM"),
    (Vehicle(), SPEED, "add thrust_voltage"),
    (Vehicle(), {**CURVE, "drag_linear": {"d": [0.1, 0.1]}}, "list of 3 numbers"),
    (Vehicle(), {**CURVE, "drag_linear": {"d": np.array([0.1, np.nan, 0.1])}}, "not finite"),
    (Vehicle(), {**CURVE, "rotor_gyro": {"J_r": 1e-8}}, "thrust_rpm"),
])
def test_impossible_models(vehicle, terms, words):
    with pytest.raises(InputError, match=words):
        Model(vehicle, terms)


def test_unknown_term_names_the_known():
    with pytest.raises(UsageError, match="drag_linear"):
        Model(Vehicle(), {**CURVE, "drag_cubic": {}})


def test_physics_is_imported_without_casadi():
    """The symbolic package and the compiler are loaded by what needs them."""
    code = ("import sys; import nanobench_tools.physics.predictor, nanobench_tools.physics.symbolic; "
            "assert not {'casadi', 'llvmlite', 'numba', 'tomlkit', 'matplotlib'} & set(sys.modules)")
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)
