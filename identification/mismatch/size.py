"""How large a vehicle is beside the one that scales and tolerances were set on: 40 g on arms of 46 mm.

Forces grow with the weight, lengths with the arms, moments with both. Within a factor of two nothing changes: scales
are orders of magnitude, and tolerances were seen on vehicles from 30 to 46 g alike.
"""

from __future__ import annotations

import math

from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.settings import number

SET_ON = Vehicle()
ALIKE = number("mismatch.size.alike")
K_F = number("mismatch.size.k_f")
"""N s^2/rad^2, of a 46 mm propeller (RotorPy's Crazyflie): where a simulator says nothing, it only gives the unit in
which the drag of turning rotors is measured."""
GROWS = {"force_world.f_N": "m", "drag_linear.d": "m", "drag_quadratic.q": "m", "drag_rotor.d": "m/w",
         "drag_torque.c": "ml", "angular_damping.d_r": "mll", "com_offset.r_m": "l", "inertia.inertia_kg_m2": "mll",
         "rotor_gyro.J_r": "mll", "yaw_torque.k_m": "l", "thrust_pwm.c": "m", "thrust_voltage.c": "m", "mass.m": "m",
         "saturation.T_max_N": "m", "ground_effect.R": "l"}
"""Parameter -> what its usual size grows with: m mass, l length of the arms, w speed of all rotors in hover."""


def _beside(size: float, usual: float) -> float:
    ratio = size / usual
    return ratio if not 1.0 / ALIKE < ratio < ALIKE else 1.0


def heavier(vehicle: Vehicle) -> float:
    """How many times the mass, 1 within a factor of two."""
    return _beside(vehicle.mass_kg, SET_ON.mass_kg)


def wider(vehicle: Vehicle) -> float:
    """How many times as long its arms are on average, 1 within a factor of two."""
    return _beside(_arm(vehicle), _arm(SET_ON))


def _arm(vehicle: Vehicle) -> float:
    return sum(math.hypot(x, y) for x, y in vehicle.motor_positions_m) / vehicle.rotors


def _turns(vehicle: Vehicle, k_f: float) -> float:
    """Sum of the rotors' speeds in hover [rad/s]."""
    return math.sqrt(vehicle.rotors * vehicle.mass_kg * max(vehicle.gravity_m_s2, 1.0) / k_f)


def growth(model: Model, base: str) -> float:
    """How many times the usual size of a parameter, by flat name without its element, is that of the 40 g vehicle."""
    vehicle, kind = model.vehicle, GROWS.get(base, "")
    found = heavier(vehicle) ** kind.count("m") * wider(vehicle) ** kind.count("l")
    if "w" in kind:
        k_f = model.parameters.get("thrust_rpm.k_f", K_F)
        found /= _beside(_turns(vehicle, k_f), _turns(SET_ON, K_F))
    return found
