"""The rigid body against closed solutions, conservation laws and invariances."""

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.firmware.thrust_curve import voltage_of_thrust
from nanobench_tools.frames import MOTOR_SIGNS
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant, battery_voltage
from nanobench_tools.practice.vehicle_parameters import VEHICLE, draw_vehicles

NO_AIR = {"drag_lateral_1_s": 0.0, "drag_vertical_1_s": 0.0, "drag_torque_N_s": 0.0}


def nominal(n=1, **fixed):
    return draw_vehicles([np.random.default_rng(i) for i in range(n)], spread=0.0, **fixed)


def high_up(vehicles, yaw=0.0):
    """Vehicles 100 m above the ground, motors off."""
    n = len(vehicles)
    plant = Plant(vehicles, np.zeros((n, 3)), np.full(n, yaw))
    plant.state[2] = 100.0
    plant.apply(np.zeros((n, 4)))
    return plant


def run(plant, seconds, dt=0.002):
    for _ in range(round(seconds / dt)):
        plant.step(dt)
    return plant.state


def test_free_fall_with_drag_is_the_closed_solution():
    plant = high_up(nominal())
    s = run(plant, 2.0)
    k, g = VEHICLE["drag_vertical_1_s"].value, 9.81
    assert s[5, 0] == pytest.approx(-g / k * (1 - np.exp(-2.0 * k)), rel=1e-9)
    assert s[2, 0] == pytest.approx(100.0 - g / k * (2.0 - (1 - np.exp(-2.0 * k)) / k), rel=1e-9)


def test_in_free_fall_without_air_nothing_is_felt_and_energy_stays():
    vehicles = nominal(**NO_AIR)
    plant = high_up(vehicles)
    plant.state[VELOCITY, 0], plant.state[RATE, 0] = (1.0, -2.0, 3.0), (5.0, -3.0, 7.0)

    def energies(s):
        j = np.array([vehicles.inertia_xx_kg_m2, vehicles.inertia_yy_kg_m2, vehicles.inertia_zz_kg_m2])
        return (vehicles.mass_kg * (0.5 * np.sum(s[VELOCITY] ** 2, axis=0) + 9.81 * s[2]),
                0.5 * np.sum(j * s[RATE] ** 2, axis=0), so3.rotate(s[QUATERNION].T, (j * s[RATE]).T))

    before = energies(plant.state)
    after = energies(run(plant, 2.0))
    for x, y in zip(before, after, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(plant.specific_force(), 0.0, atol=1e-12)


def test_a_tumbling_body_converges_with_the_fourth_order():
    def end(dt):
        plant = high_up(nominal(**NO_AIR))
        plant.state[RATE, 0] = (12.0, -9.0, 15.0)
        return run(plant, 0.96, dt)[:, 0]

    truth = end(0.0005)
    coarse, fine = (np.abs(end(dt)[RATE] - truth[RATE]).max() for dt in (0.008, 0.004))
    assert 12.0 < coarse / fine < 20.0


def test_hover_is_an_equilibrium():
    vehicles = nominal(**NO_AIR)
    plant = high_up(vehicles)
    wanted = vehicles.mass_kg * 9.81 / (4.0 * vehicles.thrust_scale)
    for _ in range(30):  # command and voltage settle on each other before the flight begins
        plant.apply(np.tile(voltage_of_thrust(wanted) / plant.battery_V, (4, 1)).T)
    plant.state[THRUST] = plant.command_N
    for _ in range(2500):
        ratio = voltage_of_thrust(wanted) / plant.battery_V
        plant.apply(np.tile(ratio, (4, 1)).T)
        plant.step(0.002)
    assert abs(plant.state[2, 0] - 100.0) < 0.02  # the battery sags between two looks at it
    np.testing.assert_allclose(plant.specific_force()[:, 0], [0.0, 0.0, 9.81], atol=0.02)
    assert 0.7 < ratio[0] < 0.95
    assert plant.charge[0] < vehicles.charge_at_start[0] - 0.01


def test_on_the_ground_it_stands_still_and_feels_one_g():
    plant = Plant(nominal(), np.array([[0.3, -0.2, 0.06]]), np.array([0.7]))
    plant.apply(np.zeros((1, 4)))
    s = run(plant, 2.0)
    np.testing.assert_allclose(s[:3, 0], [0.3, -0.2, 0.06], atol=1e-6)
    np.testing.assert_allclose(plant.specific_force()[:, 0], [0.0, 0.0, 9.81], atol=1e-6)
    assert so3.euler_zyx(s[QUATERNION].T)[0, 2] == pytest.approx(0.7)


def test_it_bounces_less_than_it_fell_and_comes_to_rest_level():
    plant = Plant(nominal(), np.zeros((1, 3)), np.zeros(1))
    plant.state[2], plant.state[QUATERNION, 0] = 0.3, so3.from_euler_zyx(0.2, -0.1, 0.4)
    plant.apply(np.zeros((1, 4)))
    touched = 0.0
    for k in range(1500):
        plant.step(0.002)
        if k > 130:
            touched = max(touched, plant.state[2, 0])
    assert touched < 0.15
    np.testing.assert_allclose(so3.euler_zyx(plant.state[QUATERNION].T)[0, :2], 0.0, atol=1e-3)
    assert abs(plant.state[2, 0]) < 1e-3


def test_a_turned_world_turns_the_flight_and_nothing_else():
    ratios = np.array([[0.8, 0.84, 0.86, 0.81]])
    ends = []
    for yaw in (0.0, 1.1):
        plant = high_up(nominal(), yaw)
        turn = so3.from_euler_zyx(0.0, 0.0, yaw)
        plant.state[VELOCITY, 0] = so3.rotate(turn, np.array([1.0, 0.5, 0.2]))
        plant.apply(ratios)
        s = run(plant, 0.6)[:, 0]
        assert abs(np.linalg.norm(s[QUATERNION]) - 1.0) < 1e-14
        ends.append((so3.rotate_inverse(turn, s[:3]), so3.rotate_inverse(turn, s[VELOCITY]), s[RATE],
                     so3.multiply(so3.conjugate(turn), s[QUATERNION]), plant.specific_force()[:, 0]))
    for a, b in zip(*ends, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-10)


def test_each_motor_turns_the_body_as_the_convention_says():
    plant = high_up(nominal(4, **NO_AIR))
    plant.state[THRUST] = 0.05 * np.eye(4)
    _, moment, _ = plant.forces(plant.state)
    p = plant.vehicles
    expected = 0.05 * MOTOR_SIGNS.T * np.array([[p.arm_m[0]], [p.arm_m[0]], [p.yaw_arm_m[0]]])
    np.testing.assert_allclose(moment, expected, rtol=1e-12)


def test_lateral_speed_brakes_and_turns_with_the_measured_signs():
    plant = high_up(nominal())
    plant.state[VELOCITY, 0] = (1.0, 0.5, 0.0)
    force, moment, _ = plant.forces(plant.state)
    np.testing.assert_allclose(force[:2, 0], [-0.40, -0.20])
    assert moment[0, 0] > 0.0  # +|c| v_y about x
    assert moment[1, 0] < 0.0  # -|c| v_x about y


def test_thrust_follows_with_the_lag_of_the_table():
    plant = high_up(nominal())
    plant.apply(np.full((1, 4), 0.5))
    end = plant.command_N[0, 0]
    run(plant, VEHICLE["motor_tau_s"].value, dt=VEHICLE["motor_tau_s"].value / 20)
    assert plant.state[13, 0] / end == pytest.approx(1 - np.exp(-1.0), rel=1e-5)


def test_battery_sags_under_load_as_in_the_recordings():
    vehicles = nominal()
    charge = np.array([0.94])
    rest, load = (battery_voltage(charge, np.full((4, 1), u), vehicles)[0] for u in (0.0, 0.84))
    assert 4.1 < rest < 4.25
    assert 0.45 < rest - load < 0.75


def test_more_than_full_and_less_than_nothing_is_clipped():
    plant = high_up(nominal(2))
    plant.apply(np.array([[1.0, 1.0, 0.0, 0.0], [1.7, 1.0, -0.5, 0.0]]))
    np.testing.assert_array_equal(plant.command_N[:, 0], plant.command_N[:, 1])


def test_unknown_parameter_is_named():
    with pytest.raises(KeyError, match="weight_kg"):
        nominal(weight_kg=1.0)
