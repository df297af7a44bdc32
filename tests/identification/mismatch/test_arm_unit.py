"""The unit of moments: thrust at the arm that makes it."""

from __future__ import annotations

import pytest

from identification.mismatch.posterior.arm_unit import arms
from nanobench_tools.physics import Model, Vehicle


def test_a_moment_is_the_thrust_at_the_arm_that_makes_it():
    vehicle = Vehicle(mass_kg=0.05, inertia_kg_m2=(2e-5, 2e-5, 4e-5))
    model = Model(vehicle, {"thrust_pwm": {"c": (0.0, 0.2)}})
    # 0.01 N more on both motors of one side at 32.5 mm: 0.02 N make 6.5e-4 N m, 32.5 rad/s^2 and 0.4 m/s^2
    assert arms(model)[0] * 0.02 * 0.0325 / 2e-5 == pytest.approx(0.02 / 0.05)


def test_a_vehicle_of_another_size_has_the_same_unit():
    """Lengths times 4, masses times 64, inertia times 1024: the same motion in the unit of weight and arm."""
    small = Model(Vehicle(), {"thrust_pwm": {"c": (0.0, 0.2)}})
    vehicle = Vehicle(mass_kg=64 * 0.04085, inertia_kg_m2=tuple(1024 * j for j in Vehicle().inertia_kg_m2),
                      motor_positions_m=tuple((4 * x, 4 * y) for x, y in Vehicle().motor_positions_m))
    # angular accelerations of similar vehicles go with 1 over length
    assert arms(Model(vehicle, {"thrust_pwm": {"c": (0.0, 9.0)}})) / 4 == pytest.approx(arms(small))
