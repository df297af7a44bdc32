"""The vehicle a model is about: what a scale, a ruler and the wiring say."""

import math
from dataclasses import dataclass, replace

from ..errors import UsageError
from ..units import GRAVITY_M_S2

INPUTS = ("pwm", "rpm", "thrust")
FEWEST, MOST = 3, 8
"""Rotors of a vehicle."""


@dataclass(frozen=True)
class Vehicle:
    """Defaults: the NanoBench vehicle. ``inertia_kg_m2`` about body x, y, z; ``motor_positions_m`` x, y in the body of
    each motor, three to eight (of these four: front right, back right, back left, front left); ``spin`` sign of the
    yaw torque of each; ``input``: pwm (ratio 0..1), rpm (measured rotor speed, given in rad/s), or thrust. With
    thrust, each rotor gets a command in N, without a thrust map; ``rate_hz`` of the integration.
    """

    mass_kg: float = 0.04085
    inertia_kg_m2: tuple[float, float, float] = (1.8e-5, 1.8e-5, 3.1e-5)
    motor_positions_m: tuple[tuple[float, float], ...] = (
        (0.0325, -0.0325), (-0.0325, -0.0325), (-0.0325, 0.0325), (0.0325, 0.0325))
    spin: tuple[float, ...] = (-1.0, 1.0, -1.0, 1.0)
    gravity_m_s2: float = GRAVITY_M_S2
    input: str = "pwm"
    rate_hz: float = 100.0

    @property
    def rotors(self) -> int:
        """How many: one for every motor position."""
        return len(self.motor_positions_m)


UNITS = {"mass_kg": "kg", "inertia_kg_m2": "kg m^2, about body x, y, z",
         "motor_positions_m": "m, x and y in the body, motor after motor",
         "spin": "sign of the yaw torque, motor after motor", "gravity_m_s2": "m/s^2",
         "input": "pwm (ratio 0..1), rpm or thrust (N)", "rate_hz": "Hz, step of the integration"}
"""What each key of the vehicle means, for files and messages."""

BOUNDS = {"mass_kg": (0.001, 10.0), "inertia_kg_m2": (1e-8, 5.0), "motor_positions_m": (-1.0, 1.0),
          "gravity_m_s2": (0.0, 30.0), "rate_hz": (10.0, 20000.0)}
"""Physical range of every number of a key."""
SHORTEST_ARM_M = 0.005
ARM_M = 0.0325 * math.sqrt(2.0)
"""From the centre of the NanoBench vehicle to a motor."""


def sized(mass_kg: float = Vehicle.mass_kg, arm_m: float | None = None) -> Vehicle:
    """The NanoBench vehicle with another mass and distance from its centre to each motor.

    Inertia grows with mass times arm squared where an arm is given. UsageError for sizes that no vehicle has.
    """
    low, high = BOUNDS["mass_kg"]
    if not low <= mass_kg <= high:
        raise UsageError(f"--mass {mass_kg:g} kg is outside {low:g} to {high:g} kg; is it in grams?")
    vehicle = Vehicle(mass_kg=mass_kg)
    if arm_m is None:
        return vehicle
    if not SHORTEST_ARM_M <= arm_m <= BOUNDS["motor_positions_m"][1]:
        raise UsageError(f"--arm {arm_m:g} m is outside {SHORTEST_ARM_M:g} to {BOUNDS['motor_positions_m'][1]:g} m; "
                         "is it in millimetres?")
    longer = arm_m / ARM_M
    heavier = mass_kg / Vehicle.mass_kg * longer**2
    x, y, z = (heavier * value for value in vehicle.inertia_kg_m2)
    return replace(vehicle, inertia_kg_m2=(x, y, z), motor_positions_m=tuple(
        (longer * forward, longer * left) for forward, left in vehicle.motor_positions_m))
