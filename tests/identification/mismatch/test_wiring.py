"""Motor order and spins of a simulator: what cannot fly, and what the flights contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.equivalent import turning_by_motor
from identification.mismatch.wiring import against_flights, gains_against_flights, impossible
from identification.mismatch.wrench import Wrench
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model
from nanobench_tools.steps.diagnosing import check_wiring

RIGHT_BACK_LEFT_FRONT = (-1.0, 1.0, -1.0, 1.0)


@pytest.fixture(scope="module")
def calm():
    """Flights of MODEL in calm air, in which yaw shows, too."""
    return wrench_of(MODEL, noise=0.3)


def rewired(model, order=(0, 1, 2, 3), spin=RIGHT_BACK_LEFT_FRONT):
    places = tuple(model.vehicle.motor_positions_m[k] for k in order)
    return Model(replace(model.vehicle, motor_positions_m=places, spin=spin),
                 {t.name: model.values_of(t.name) for t in model.terms})


@pytest.mark.parametrize(("order", "spin", "words"), [
    ((1, 0, 2, 3), RIGHT_BACK_LEFT_FRONT, "neighbours and spin the same way"),
    ((0, 1, 2, 3), (1.0, 1.0, 1.0, 1.0), "neighbours and spin the same way"),
    ((0, 1, 2, 3), (1.0, 1.0, -1.0, 1.0), "no hover is in balance in which motor 4"),
])
def test_what_cannot_fly(model, order, spin, words):
    assert words in impossible(rewired(model, order, spin)).found


def test_what_can_fly(model):
    assert impossible(model) is None
    assert impossible(rewired(model, (0, 2, 3, 1), (-1.0, -1.0, 1.0, 1.0))) is None  # the order of PX4
    without_yaw = Model(rewired(model, spin=(1.0,) * 4).vehicle, {"thrust_voltage": model.values_of("thrust_voltage")})
    assert impossible(without_yaw) is None


@pytest.mark.parametrize("rotors", [3, 5, 6, 8])
def test_regular_vehicles_of_other_numbers_of_rotors_can_fly(model, rotors):
    angle = 2.0 * np.pi * (np.arange(rotors) + 0.5) / rotors
    spin = tuple(float((-1) ** k) for k in range(rotors)) if rotors % 2 == 0 else (1.0, -1.0) * (rotors // 2) + (1.0,)
    vehicle = replace(model.vehicle, spin=spin, motor_positions_m=tuple(
        (float(x), float(y)) for x, y in 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)))
    other = Model(vehicle, {"thrust_voltage": model.values_of("thrust_voltage"), "yaw_torque": {"k_m": 0.01}})
    assert impossible(other) is None


def test_flights_agree_with_their_own_wiring(calm, plain, model):
    assert against_flights(calm, model) is None
    assert against_flights(plain, model) is None


def test_what_flights_do_not_show_is_no_contradiction(plain, model):
    """In rough air the motors hardly turn this vehicle about z."""
    assert against_flights(plain, rewired(model, spin=(1.0, -1.0, 1.0, -1.0))) is None
    found = against_flights(plain, rewired(model, (1, 0, 2, 3), (1.0, -1.0, -1.0, 1.0))).found
    assert found == ("pitch of the flights does not follow the simulator's motors, but would if motors 1 and 2 were "
                     "swapped")


@pytest.mark.parametrize(("order", "spin", "key", "words"), [
    ((1, 0, 2, 3), (1.0, -1.0, -1.0, 1.0), "motor_positions_m", "if motors 1 and 2 were swapped"),
    ((2, 1, 0, 3), RIGHT_BACK_LEFT_FRONT, "motor_positions_m", "if motors 1 and 3 were swapped"),
    ((0, 2, 3, 1), (-1.0, -1.0, 1.0, 1.0), "motor_positions_m", "sat at the places of 1, 4, 2, 3"),
    ((0, 1, 2, 3), (1.0, -1.0, 1.0, -1.0), "spin",
     "yaw of the flights does not follow the simulator's motors, but would if every rotor spun the other way"),
])
def test_flights_show_which_motors_are_swapped(calm, model, order, spin, key, words):
    found = against_flights(calm, rewired(model, order, spin))
    assert found.key == key
    assert found.found.endswith(words)


def test_motors_that_do_not_turn_the_vehicle_differently_show_nothing(calm, model):
    still = [replace(t, motor=np.full_like(t.motor, 0.6), battery_V=np.full_like(t.battery_V, 3.8))
             for t in calm.tracks]
    assert against_flights(Wrench(still), rewired(model, spin=(1.0, -1.0, 1.0, -1.0))) is None


def test_the_line_names_the_file_and_the_key(model):
    class Nothing:
        tracks = ()

    with pytest.raises(InputError, match=r"^sim.toml: vehicle.spin: motors 1 and 2 are neighbours"):
        check_wiring(Nothing(), rewired(model, spin=(1.0,) * 4), "sim.toml")


def test_a_callable_with_swapped_motors_contradicts_the_flights(calm, model):
    """The callable turns as the model does; its motors are taken in another order."""
    def turning(order):
        def accelerations(at):
            lift = 0.01 * (at.motor[:, order] * at.battery_V[:, None]) ** 2
            arms = np.array(model.vehicle.motor_positions_m)
            torque = np.stack([lift @ arms[:, 1], -lift @ arms[:, 0], 0.006 * lift @ np.array(model.vehicle.spin)], 1)
            return np.stack([0.0 * lift[:, 0], 0.0 * lift[:, 0], lift.sum(axis=1) / 0.04], axis=1), torque / 2e-5
        return accelerations

    for order, words in (((0, 1, 2, 3), None), ((1, 0, 2, 3), "motors 1 and 2 were swapped")):
        gains = turning_by_motor(turning(order), calm.tracks[0], "mine")
        found = gains_against_flights(calm, gains)
        assert (found is None) is (words is None)
        assert words is None or words in found.found
    assert gains_against_flights(calm, np.zeros((3, 4))) is None  # forces alone
