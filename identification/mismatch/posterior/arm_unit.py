"""One unit for forces and moments: m/s^2 of acceleration, moments by the arm of the thrust that would make them.

A moment of J rad/s^2 is the thrust of m rad/s^2 J / (m l) at the mean arm l. So a vehicle of 30 g and one of 5 kg are
judged by the same numbers. About z thrust has no arm: rotors turn the vehicle by their own drag. This moment is an
eighth of thrust times the distance of the motors. On a Crazyflie k_m is 6 mm at 46 mm; a 5 inch racer has 13 mm at 110
mm.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools.physics import Model

YAW = 0.13
"""Arm of the moment about z, of the distance of the motors."""


def arms(model: Model) -> np.ndarray:
    """(3,) m/s^2 per rad/s^2 about body x, y, z."""
    vehicle = model.vehicle
    mass = model.values_of("mass").get("m", vehicle.mass_kg)
    inertia = np.array(model.values_of("inertia").get("inertia_kg_m2", vehicle.inertia_kg_m2))
    x, y = np.abs(np.array(vehicle.motor_positions_m)[:, :2]).mean(axis=0)
    return np.asarray(inertia / (mass * np.maximum([y, x, YAW * np.hypot(x, y)], 1e-3)))
