"""All controllers: safe whatever they are fed, right in their signs, and able to fly a made vehicle."""

import functools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import solve_discrete_are
from scipy.signal import cont2discrete

from controllers import lqr
from nanobench_tools import so3
from nanobench_tools.firmware.guard import HOLD_S, SINK
from nanobench_tools.frames import MOTOR_SIGNS
from nanobench_tools.lookup import registry
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

NAMES = ("geometric", "lead_pid", "lqr", "mellinger_full", "mpc_hover", "onboard_mellinger", "onboard_pid")
PREVIEW = ("mpc_hover", "geometric", "lqr", "mellinger_full")
PREDICTIVE = ("mpc_daqp", "mpc_osqp", "nmpc")
"""These have tests of their own beside this file."""

make = functools.cache(lambda name: registry.load("controllers", name)())


def fresh(name, n):
    """One object a name: ``reset`` has to forget everything."""
    controller = make(name)
    controller.reset(n)
    return controller


def resting(n=1, **changes):
    """At the origin, level, and asked to be there."""
    state = {"position_m": np.zeros((n, 3)), "velocity_m_s": np.zeros((n, 3)),
             "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)), "rate_rad_s": np.zeros((n, 3)),
             "battery_V": np.full(n, 3.6)}
    reference = {"position_m": np.zeros((n, 3)), "yaw_rad": np.zeros(n), "velocity_m_s": np.zeros((n, 3)),
                 "acceleration_m_s2": np.zeros((n, 3)), "jerk_m_s3": np.zeros((n, 3)), "yaw_rate_rad_s": np.zeros(n)}
    for name, value in changes.items():
        (reference if name.startswith("r_") else state)[name.removeprefix("r_")] = value
    return VehicleState(**state), Reference(**reference)


def run(controller, steps, state, reference):
    for step in range(steps):
        command = controller.command(0.002 * step, state, reference)
    return command


def test_every_registered_controller_is_tested_and_keeps_the_protocol():
    assert set(registry.names("controllers")) == {*NAMES, *PREDICTIVE}
    for name in NAMES:
        assert isinstance(make(name), Controller)
        assert make(name).name == name
        told = "preview" if name in PREVIEW else "lead" if name == "lead_pid" else "as flown"
        assert make(name).information == told


ANYTHING = st.one_of(st.floats(-3.0, 3.0), st.floats(), st.sampled_from([0.0, np.nan, np.inf, -np.inf, 1e300, -1e-300]))


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=arrays(float, (4, 2, 28), elements=ANYTHING))
def test_no_input_makes_a_controller_fail(name, values):
    controller = fresh(name, 2)
    for step, v in enumerate(values):
        state = VehicleState(v[:, :3], v[:, 3:6], v[:, 6:10], v[:, 10:13], v[:, 13])
        reference = Reference(v[:, 14:17], v[:, 17], v[:, 18:21], v[:, 21:24], v[:, 24:27], v[:, 27])
        command = controller.command(v[0, 0], state, reference)
        assert command.shape == (2, 4)
        assert np.all((command >= 0.0) & (command <= 1.0)), step
    command = run(controller, 8, *resting(2))  # and it flies on when all is well again
    assert np.all((command >= 0.0) & (command <= 1.0))
    assert not controller.guard.lost.any()


@pytest.mark.parametrize("name", NAMES)
def test_a_lost_measurement_is_bridged_then_the_vehicle_sinks_and_then_it_flies_again(name):
    controller = fresh(name, 2)
    state, reference = resting(2, r_position_m=np.tile([0.0, 0.0, 0.1], (2, 1)))
    for _ in range(400):
        before = controller.command(0.0, state, reference).copy()
    broken, _ = resting(2)
    broken.position_m[1, 2] = np.nan
    held = round(HOLD_S / controller.period_s)
    during = run(controller, held - 5, broken, reference)
    assert np.abs(during - before).max() < 0.1
    after = run(controller, 10, broken, reference)
    assert controller.guard.lost.tolist() == [False, True]
    assert np.ptp(after[1]) == 0.0
    assert 0.7 * before[1].mean() < after[1].mean() < SINK * 1.1 * before[1].mean()
    assert controller.guard.counts["measurement"] == held + 5
    back = run(controller, 5, state, reference)
    assert not controller.guard.lost.any()
    assert np.abs(back[1] - back[0]).max() < 0.15


@pytest.mark.parametrize("name", NAMES)
def test_a_reference_that_is_no_number_is_the_last_good_one_or_where_the_vehicle_is(name):
    state, reference = resting(position_m=np.array([[0.3, -0.2, 1.0]]), r_position_m=np.array([[0.3, -0.2, 1.0]]))
    _, nowhere = resting(r_position_m=np.full((1, 3), np.nan))
    np.testing.assert_array_equal(run(fresh(name, 1), 20, state, reference), run(fresh(name, 1), 20, state, nowhere))
    _, ahead = resting(r_position_m=np.array([[0.5, -0.2, 1.1]]))
    expected = run(fresh(name, 1), 30, state, ahead).copy()
    shaken = fresh(name, 1)
    run(shaken, 15, state, ahead)
    np.testing.assert_array_equal(run(shaken, 15, state, nowhere), expected)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_is_answered_by_the_opposite_moment(name, axis):
    turn = np.zeros((2, 3))
    turn[1, axis] = 0.4
    target = np.tile([0.0, 0.0, 0.3], (2, 1))
    ratio = run(fresh(name, 2), 12, *resting(2, quaternion=so3.exp(turn), r_position_m=target))
    moment = (ratio[1] - ratio[0]) @ MOTOR_SIGNS
    assert moment[axis] < -1e-3
    assert np.all(np.abs(np.delete(moment, axis)) < 0.3 * abs(moment[axis]))


@pytest.mark.parametrize("name", PREVIEW)
def test_turning_the_world_about_the_vertical_changes_nothing(name):
    rng = np.random.default_rng(5)
    turn, yaw = so3.exp(np.array([0.0, 0.0, 1.1])), rng.uniform(-1.0, 1.0, 3)
    place, speed, rate, goal, wish, push, jerk = 0.1 * rng.standard_normal((7, 3, 3))
    attitude = so3.from_euler_zyx(0.2 * yaw, -0.3 * yaw, yaw)
    commands = []
    for q, psi in ((np.array([0.0, 0.0, 0.0, 1.0]), 0.0), (turn, 1.1)):
        turned = [so3.rotate(q, x) for x in (place, speed, goal, wish, push, jerk)]
        state = VehicleState(turned[0], turned[1], so3.multiply(q, attitude), rate, np.full(3, 3.7))
        reference = Reference(turned[2], yaw + psi, *turned[3:], 0.3 * yaw)
        commands.append(run(fresh(name, 3), 6, state, reference).copy())
    np.testing.assert_allclose(commands[0], commands[1], atol=3e-4)  # float32 and whole counts


@pytest.mark.parametrize("name", NAMES)
def test_a_vehicle_flies_in_a_batch_as_it_does_alone(name):
    rng = np.random.default_rng(6)
    many = [resting(3, position_m=0.1 * rng.standard_normal((3, 3)), rate_rad_s=rng.standard_normal((3, 3)))
            for _ in range(12)]
    together, alone = fresh(name, 3), []
    batch = [together.command(0.0, *one)[1].copy() for one in many]
    single = fresh(name, 1)
    for pair in many:
        one = (type(x)(*(v if v is None else v[[1]] for v in vars(x).values())) for x in pair)
        alone.append(single.command(0.0, *one)[0].copy())
    np.testing.assert_allclose(batch, alone, atol=2e-5)


def flight(controller, spec, seconds):
    """RMS distance [m] to the path after 0.8 s, from hover at its start, with perfect measurements."""
    vehicles = draw_vehicles([np.random.default_rng(0)], 0.0)
    plant = Plant(vehicles, np.zeros((1, 3)), np.zeros(1))
    start = spec.reference(np.zeros(1))
    plant.state[:3] = start.position_m.T
    plant.state[VELOCITY] = start.velocity_m_s.T
    plant.state[THRUST] = vehicles.mass_kg * 9.81 / 4.0
    controller.reset(1)
    errors = []
    for step in range(round(seconds / 0.002)):
        reference = spec.reference(np.array([0.002 * step]))
        if controller.information == "as flown":
            zero = np.zeros((1, 3))
            reference = Reference(reference.position_m, reference.yaw_rad, zero, zero)
        s = plant.state
        state = VehicleState(s[:3].T, s[VELOCITY].T, s[QUATERNION].T, s[RATE].T, plant.battery_V)
        plant.apply(controller.command(0.002 * step, state, reference))
        plant.step(0.002)
        errors.append(np.linalg.norm(plant.state[:3, 0] - reference.position_m[0]))
    return float(np.sqrt(np.mean(np.square(errors[400:]))))


@pytest.mark.parametrize(("name", "most_m"), [("geometric", 0.06), ("lqr", 0.03), ("mellinger_full", 0.2),
                                              ("onboard_mellinger", 0.5), ("onboard_pid", 0.5)])
def test_it_flies_a_figure_of_eight(name, most_m):
    assert flight(make(name), path_spec("figure_eight", "slow"), 2.0) < most_m


def test_the_gain_is_that_of_the_riccati_equation_and_stable():
    a, b = lqr.model(Vehicle())
    a, b, *_ = cont2discrete((a, b, np.eye(19), np.zeros((19, 4))), lqr.PERIOD_S)
    q = np.diag([*(1.0 / np.square(lqr.TOLERATED[:15])), *(1e-6,) * 4])
    r = np.diag(1.0 / np.square(lqr.EFFORT))
    p = solve_discrete_are(a, b, q, r)
    expected = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
    found = lqr.gain(Vehicle())
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
    assert np.abs(np.linalg.eigvals(a - b @ found)).max() < 1.0
