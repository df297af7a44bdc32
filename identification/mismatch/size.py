"""Size of a vehicle relative to the one that scales and tolerances were set on: 40 g on arms of 46 mm.

Forces grow with the weight, lengths with the arms, moments with both. Within a factor of two nothing changes: scales
are orders of magnitude, and the same tolerances were seen on vehicles from 30 to 46 g.
"""

from __future__ import annotations

import math

from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.model import Slot
from nanobench_tools.physics.term import Parameter
from nanobench_tools.settings import number

SET_ON = Vehicle()
ALIKE = number("mismatch.size.alike")
K_F = number("mismatch.size.k_f")
SCALE_SHARE = number("mismatch.size.scale_share")


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


def grown(vehicle: Vehicle, parameter: Parameter, k_f: float = K_F) -> float:
    """How many times the usual size of a parameter is that of the 40 g vehicle, see ``Parameter.grows``."""
    kind = parameter.grows
    found = heavier(vehicle) ** kind.count("m") * wider(vehicle) ** kind.count("l")
    if "w" in kind:
        found /= _beside(_turns(vehicle, k_f), _turns(SET_ON, K_F))
    return found


def growth(model: Model, parameter: Parameter) -> float:
    """``grown`` on the vehicle of a model."""
    k_f = model.parameters.get("thrust_rpm.k_f", K_F) if "w" in parameter.grows else K_F
    return grown(model.vehicle, parameter, k_f)


def typical(parameter: Parameter, element: int) -> float:
    """Typical size of an element on a vehicle of 40 g, 0 if the parameter states none."""
    value = parameter.typical
    return abs(value[min(element, len(value) - 1)] if isinstance(value, tuple) else value)


def range_share(parameter: Parameter) -> float:
    """Size of a parameter that states no typical value."""
    return min(1.0, SCALE_SHARE * (parameter.upper - parameter.lower))


def usual(model: Model, slot: Slot) -> float:
    """Usual size of one parameter of a model, independent of its value; never 0."""
    return (typical(slot.parameter, slot.element) or range_share(slot.parameter)) * growth(model, slot.parameter)
