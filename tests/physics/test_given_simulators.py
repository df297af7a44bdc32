"""Callables of users and adapters along measured states: what they are given, what comes back, and their mistakes."""


import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.errors import InputError, NanobenchError, UsageError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.adapters.given import Along, load_simulator, run
from nanobench_tools.physics.numeric import derivative
from nanobench_tools.physics.simulator import write_simulator

MODEL = Model(Vehicle(), {"thrust_voltage": {"c": (0.0, 0.03, -0.012, 0.005)}, "thrust_rpm": {"k_f": 2.3e-8},
                          "yaw_torque": {"k_m": 0.006}, "drag_linear": {"d": (0.015, 0.015, 0.006)}})


def stretch(n=6):
    rng = np.random.default_rng(3)
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    return Along(0.01 * np.arange(n), rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), q,
                 rng.normal(size=(n, 3)), np.tile(rng.uniform(0.4, 0.7, 4), (n, 1)), np.full(n, 3.8))


MISTAKES = '''
import sys
import numpy as np
number = 3
def nothing(along): pass
def wide(along): return np.zeros((len(along), 2)), np.zeros((len(along), 3))
def short(along): return np.zeros((len(along) - 1, 3)), np.zeros((len(along), 3))
def words(along): return "a", "b"
def single(along): return np.zeros((len(along), 3))
def other(along): return {"force": 1}
def raises(along): raise KeyError("thrust")
def leaves(along): sys.exit(3)
def no_argument(): pass
def not_finite(along):
    force = np.zeros((len(along), 3))
    force[4, 2] = np.nan
    return force, np.zeros((len(along), 3))
class WantsMore:
    def __init__(self, more): pass
class NoCall: pass
class Steps:
    def reset(self): self.rows = 0
    def step(self, row):
        self.rows += 1
        assert row.motor.shape == (4,)
        return [0.0, 0.0, self.rows], [0.0, 0.0, row.battery_V]
def in_the_world(along):
    return {"acceleration_m_s2": np.zeros((len(along), 3)), "angular_acceleration_rad_s2": np.zeros((len(along), 3))}
'''


@pytest.fixture
def mistakes(tmp_path, monkeypatch):
    (tmp_path / "mistakes_of_users.py").write_text(MISTAKES)
    monkeypatch.syspath_prepend(tmp_path)
    return "mistakes_of_users"


@pytest.mark.parametrize(("name", "words"), [
    ("nothing", "returned NoneType"), ("wide", r"shape \(6, 2\) where \(6, 3\)"), ("short", r"shape \(5, 3\)"),
    ("words", "no array of numbers"), ("single", r"returned ndarray \(6, 3\)"), ("other", "a dictionary of force"),
    ("raises", "raised KeyError: 'thrust' in line"), ("leaves", "raised SystemExit: 3"),
    ("no_argument", "raised TypeError"), ("not_finite", r"\[0.0, 0.0, nan\] in row 4 of 6")])
def test_a_callable_that_fails_is_one_line(mistakes, name, words):
    with pytest.raises(InputError, match=words) as caught:
        run(load_simulator(f"{mistakes}:{name}"), stretch(), name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "words"), [
    ("mistakes_of_users:number", "is a int and cannot be called"), ("mistakes_of_users:absent", "no attribute"),
    ("mistakes_of_users:WantsMore", "made without arguments"), ("mistakes_of_users:NoCall", "cannot be called"),
    ("no_such_module:f", "No module named"), ("nothing", "no adapter of that name; there are crazyflow, rotorpy"),
    ("own/sim.py:f", r"given as own\.sim:f")])
def test_what_cannot_be_loaded_is_one_line(mistakes, name, words):
    with pytest.raises(UsageError, match=words):
        load_simulator(name)


def test_an_object_that_steps_is_reset_before_every_stretch(mistakes):
    steps = load_simulator(f"{mistakes}:Steps")
    for _ in range(2):
        force, turning = run(steps, stretch(), "steps")
        np.testing.assert_array_equal(force[:, 2], np.arange(1.0, 7.0))
        np.testing.assert_array_equal(turning[:, 2], 3.8)


def test_an_acceleration_of_the_world_is_turned_into_the_body(mistakes):
    at = stretch()
    force, _ = run(load_simulator(f"{mistakes}:in_the_world"), at, "world")
    np.testing.assert_allclose(so3.rotate(at.quaternion, force), np.tile([0.0, 0.0, 9.81], (6, 1)), atol=1e-12)


ADAPTERS = ("rotorpy", "crazyflow")


@pytest.mark.parametrize("name", ADAPTERS)
def test_adapters_give_what_the_model_gives(name, tmp_path):
    """Rotors settled on a constant command; RotorPy's drag of rotors grows with their speed, so that one has none."""
    model = MODEL.without("drag_linear") if name == "rotorpy" else MODEL
    write_simulator(model, tmp_path / "simulator.toml")
    at = stretch()
    force, turning = run(load_simulator(f"{name}:{tmp_path / 'simulator.toml'}"), at, name)
    lift = sum(c * (at.motor * 3.8) ** k for k, c in enumerate(MODEL.values_of("thrust_voltage")["c"]))
    states = np.concatenate([at.position_m, at.velocity_m_s, at.quaternion, at.rate_rad_s, lift], axis=1)
    wanted = derivative(model, states, np.column_stack([at.motor, at.battery_V]))
    np.testing.assert_allclose(so3.rotate(at.quaternion, force) - [0.0, 0.0, 9.81], wanted[:, 3:6], atol=1e-5)
    np.testing.assert_allclose(turning, wanted[:, 10:13], atol=1e-3)


@pytest.mark.parametrize("name", ADAPTERS)
def test_their_own_crazyflie_hovers_and_turns_as_ours(name):
    """Motor 1 is front right: more of it turns the vehicle nose up and to the left side down."""
    simulator = load_simulator(name)
    n = 100
    at = stretch(n)
    level = np.zeros((n, 3))
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    at = Along(at.time_s, level, level, upright, level, np.full((n, 4), 0.62), at.battery_V)
    force, turning = run(simulator, at, name)
    assert 7.0 < force[-1, 2] < 14.0
    np.testing.assert_allclose(turning[-1], 0.0, atol=1e-3)
    at.motor[:, 0] += 0.02
    roll, pitch, yaw = run(simulator, at, name)[1][-1]
    assert roll < -1.0
    assert pitch < -1.0
    assert yaw < 0.0
    assert 0.01 < simulator.vehicle.mass_kg < 0.05


def test_adapters_say_what_they_cannot_find(tmp_path):
    for name in ("rotorpy:absent.toml", "crazyflow:absent.toml", "crazyflow:no_drone"):
        with pytest.raises(NanobenchError):
            load_simulator(name)
