"""Another moment of inertia than the vehicle's table says.

Parameters
----------
inertia_kg_m2 : (3,) kg m^2
    Moments of inertia about body x, y and z, through the centre of mass.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import Systematic
from ..term import Belief, Parameter, Situation, Stage, Term
from ..vehicle import Vehicle

SYSTEMATIC = number("physics.inertia.systematic")
IMPLAUSIBLE = number("physics.inertia.implausible")
BELIEVED_SD = number("physics.inertia.believed_sd")
LEAST = number("physics.inertia.least")
FIRMWARE_MASS_KG, FIRMWARE_INERTIA = 0.027, (1.66e-5, 1.67e-5, 2.93e-5)
"""Crazyflie 2.1 without load: crazyflie-firmware, controller_lee.c. A load near the centre adds inertia about in
proportion to mass."""


def inertia(value: Any, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return list(p.inertia_kg_m2)


def most(vehicle: Vehicle) -> tuple[float, float, float]:
    """kg m^2 about x, y, z with all mass at the motors."""
    many = len(vehicle.motor_positions_m)
    x2, y2 = (sum(p[axis] * p[axis] for p in vehicle.motor_positions_m) / many for axis in (0, 1))
    return vehicle.mass_kg * y2, vehicle.mass_kg * x2, vehicle.mass_kg * (x2 + y2)


def fitted(vehicle: Vehicle) -> list[tuple[float, float]]:
    """From a share of the most to the most."""
    return [(LEAST * high, high) for high in most(vehicle)]


def believed(vehicle: Vehicle) -> list[Belief | None]:
    """The firmware's, scaled with the mass; about z only the ratio to yaw_torque is seen."""
    means = [value * vehicle.mass_kg / FIRMWARE_MASS_KG for value in FIRMWARE_INERTIA[:2]]
    return [*(Belief(mean, BELIEVED_SD * mean, "firmware controller_lee.c, scaled with the mass") for mean in means),
            None]


TERM = Term(
    name="inertia",
    sentence="The moments of inertia about body x, y and z, off-diagonal ones zero.",
    equation="J = diag(inertia)",
    parameters=(Parameter("inertia_kg_m2", "kg m^2", 1e-8, 5.0, (1.8e-5, 1.8e-5, 3.1e-5), neutral="inertia_kg_m2",
                          length=3, systematic=Systematic(SYSTEMATIC, "gain"), implausible=IMPLAUSIBLE, grows="mll",
                          fitted=fitted, believed=believed, unidentifiable=(2,), only_with={2: "yaw_torque"},
                          source="firmware controller_lee.c 1.66e-5, 1.67e-5, 2.93e-5, scaled for load"),),
    acts={Stage.INERTIA: inertia},
    confused_with={"thrust_scale": "climbs: thrust acts on the motion too, inertia only on rotation",
                   "yaw_torque": "only k_m / J_z is seen: a pendulum measurement"},
)
