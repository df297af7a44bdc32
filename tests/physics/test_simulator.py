"""simulator.toml: exact both ways, and one line that names file, line and key for everything that is wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_cases import CURVE, models

from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps, loads, read_simulator, write_simulator

GOOD = """\
schema = "nanobench-simulator/1"

[vehicle]
mass_kg = 0.04085
inertia_kg_m2 = [1.8e-5, 1.8e-5, 3.1e-5]
motor_positions_m = [[0.0325, -0.0325], [-0.0325, -0.0325], [-0.0325, 0.0325], [0.0325, 0.0325]]  # x, y in body
spin = [-1.0, 1.0, -1.0, 1.0]          # sign of the yaw torque of motors 1..4
gravity_m_s2 = 9.81
input = "pwm"                          # pwm | rpm
rate_hz = 100.0

[[terms]]
name = "thrust_voltage"
c = [0.0, 0.01, 0.01]

[[terms]]
name = "yaw_torque"
k_m = 0.006
"""


def test_the_example_of_the_format():
    model = loads(GOOD)
    assert model == Model(Vehicle(), {"thrust_voltage": {"c": [0.0, 0.01, 0.01]}, "yaw_torque": {"k_m": 0.006}})
    assert model.names == ("thrust_voltage.c[0]", "thrust_voltage.c[1]", "thrust_voltage.c[2]", "yaw_torque.k_m")
    assert model.units == ("N", "N/V", "N/V^2", "m")


def test_whole_numbers_and_defaults_are_fine():
    short = "\n".join(line for line in GOOD.splitlines() if not line.startswith(("gravity", "input", "rate")))
    assert loads(short.replace("[-1.0, 1.0, -1.0, 1.0]", "[-1, 1, -1, 1]")) == loads(GOOD)


@pytest.mark.parametrize("name", models())
def test_written_and_read_again_is_the_same(name, tmp_path):
    model = models()[name]
    write_simulator(model, tmp_path / "simulator.toml")
    again = read_simulator(tmp_path / "simulator.toml")
    assert again == model
    assert np.array_equal(again.values, model.values)
    assert again.as_dict() == model.as_dict()


@settings(max_examples=30, deadline=None)
@given(mass=st.floats(0.001, 5.0), c=st.lists(st.floats(-5, 5), min_size=1, max_size=5), delay=st.floats(0, 0.2))
def test_every_double_survives(mass, c, delay):
    model = Model(Vehicle(mass_kg=mass), {"thrust_pwm": {"c": c}, "command_delay": {"delay_s": delay}})
    again = loads(dumps(model))
    assert again == model
    assert again.vehicle.mass_kg == mass


def test_units_stand_beside_the_numbers():
    text = dumps(loads(GOOD))
    assert "mass_kg = 0.04085 # kg" in text
    assert "k_m = 0.006 # m" in text


def change(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


BAD = {
    "unknown key of the vehicle": (change("rate_hz", "rate_Hz"), 10, "rate_Hz", "did you mean rate_hz"),
    "unknown key at the top": ("colour = 1\n" + GOOD, 1, "colour", "unknown key"),
    "unknown term": (change('"yaw_torque"', '"yaw_torqe"'), 17, "yaw_torqe", "did you mean yaw_torque"),
    "a term from any module": (change('"yaw_torque"', '"os:system"'), 17, "os:system", "unknown term"),
    "unknown parameter": (change("k_m =", "km ="), 18, "km", "did you mean k_m"),
    "parameter missing": (change("k_m = 0.006\n", ""), 16, "k_m", "lacks k_m"),
    "wrong length": (change("[1.8e-5, 1.8e-5, 3.1e-5]", "[1.8e-5, 3.1e-5]"), 5, "inertia_kg_m2", "list of 2"),
    "a list for a number": (change("k_m = 0.006", "k_m = [0.006]"), 18, "k_m", "one number"),
    "a number for a list": (change("c = [0.0, 0.01, 0.01]", "c = 0.1"), 14, "c", "list of numbers"),
    "no coefficient": (change("c = [0.0, 0.01, 0.01]", "c = []"), 14, "c", "list of numbers"),
    "text for a number": (change("mass_kg = 0.04085", 'mass_kg = "0.04085"'), 4, "mass_kg", "text '0.04085'"),
    "truth for a number": (change("mass_kg = 0.04085", "mass_kg = true"), 4, "mass_kg", "bool"),
    "negative mass": (change("mass_kg = 0.04085", "mass_kg = -0.04085"), 4, "mass_kg", "outside"),
    "mass in grams": (change("mass_kg = 0.04085", "mass_kg = 40.85"), 4, "mass_kg", "grams"),
    "not finite": (change("mass_kg = 0.04085", "mass_kg = nan"), 4, "mass_kg", "not finite"),
    "infinite coefficient": (change("[0.0, 0.01, 0.01]", "[0.0, inf, 0.01]"), 14, "c", "not finite"),
    "out of physical bounds": (change("k_m = 0.006", "k_m = -0.006"), 18, "k_m", "outside 0 to 0.1"),
    "positions of three motors": (change("[[0.0325, -0.0325], [-0.0325, -0.0325], ", "[[0.0325, -0.0325], "), 6,
                                  "motor_positions_m", "4 lists of 2"),
    "spin of 2": (change("[-1.0, 1.0, -1.0, 1.0]", "[-1.0, 2.0, -1.0, 1.0]"), 7, "spin", "1.0 or -1.0"),
    "unknown input": (change('"pwm"', '"volts"'), 9, "input", "pwm or rpm"),
    "rpm without thrust_rpm": (change('"pwm" ', '"rpm" '), 9, "input", "add thrust_rpm"),
    "pwm with thrust_rpm and no map": (change('"thrust_voltage"\nc = [0.0, 0.01, 0.01]', '"thrust_rpm"\nk_f = 2e-8'),
                                       9, "input", "add thrust_voltage or thrust_pwm"),
    "two maps": (GOOD + '[[terms]]\nname = "thrust_pwm"\nc = [0.1]\n', 20, "name", "both give the thrust"),
    "twice the same": (GOOD + '[[terms]]\nname = "yaw_torque"\nk_m = 0.001\n', 20, "name", "twice"),
    "wind without drag": (GOOD + '[[terms]]\nname = "wind"\nw_m_s = [1, 0, 0]\n', 20, "wind", "drag_linear"),
    "rotor drag without k_f": (GOOD + '[[terms]]\nname = "drag_rotor"\nd = [0, 0, 0]\n', 20, "drag_rotor",
                               "thrust_rpm"),
    "gains whose mean is not 1": (GOOD + '[[terms]]\nname = "motor_imbalance"\ng = [1, 1, 1, 0.5]\n', 21, "g", "mean"),
    "saturation of nothing": (GOOD + '[[terms]]\nname = "saturation"\n', 19, "u_max", "neither"),
    "no name": (GOOD + "[[terms]]\nk_m = 1.0\n", 19, "name", "missing"),
    "name of a number": (change('name = "yaw_torque"', "name = 3"), 17, "name", "no text"),
    "no schema": (change('schema = "nanobench-simulator/1"\n', ""), 1, "schema", "nanobench-simulator/1"),
    "another schema": (change("simulator/1", "simulator/9"), 1, "schema", "nanobench-simulator/1"),
    "no vehicle": ('schema = "nanobench-simulator/1"\n', 1, "vehicle", "[vehicle]"),
    "vehicle without mass": (change("mass_kg = 0.04085\n", ""), 3, "mass_kg", "missing"),
    "terms as one table": (change('[[terms]]\nname = "thrust_voltage"\nc = [0.0, 0.01, 0.01]\n\n[[terms]]',
                                  "[terms]"), 12, "terms", "[[terms]]"),
    "no TOML": (change("rate_hz = 100.0", "rate_hz = 100.0.0"), 10, "TOML", "mend"),
    "a key twice": (change("rate_hz = 100.0", "rate_hz = 100.0\nrate_hz = 50.0"), 11, "TOML", "mend"),
    "cut off": (GOOD[:160], 6, "TOML", "mend"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_that_names_the_place(case, tmp_path):
    text, line, key, hint = BAD[case]
    path = tmp_path / "simulator.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_simulator(path)
    message = str(error.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: line {line}")
    assert key in message
    assert hint in message


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "absent.toml", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read_simulator(path)
    (tmp_path / "bytes.toml").write_bytes(b'schema = "a"\n\xff\xfe = 1\n')
    with pytest.raises(InputError, match=r"line 2: bytes that are not UTF-8"):
        read_simulator(tmp_path / "bytes.toml")


def test_a_fit_beyond_its_bounds_is_not_written():
    model = Model(Vehicle(), {**CURVE, "thrust_scale": {"s": 1.0}}).with_parameters({"thrust_scale.s": -1.0})
    with pytest.raises(InputError, match=r"thrust_scale\.s = -1"):
        dumps(model)
