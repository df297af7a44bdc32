"""The rotors are gyroscopes.

Parameters
----------
J_r : float, kg m^2
    Moment of inertia of one rotor with its motor's bell. Negative for real rotors: they turn against the yaw torque
    whose direction is the vehicle's ``spin``.

References
----------
Mahony, Kumar, Corke 2012, "Multirotor aerial vehicles: Modeling, estimation, and control of quadrotor", IEEE Robotics
& Automation Magazine 19(3), doi:10.1109/MRA.2012.2206474.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, cross, subtract, total
from ..vehicle import Vehicle
from .inertia import most

SHARE = number("physics.rotor_gyro.share")


def fitted(vehicle: Vehicle) -> list[tuple[float, float]]:
    """Rotors against the vehicle, with the sign of real ones: at most so much of the inertia of all mass at the
    motors."""
    return [(-SHARE * most(vehicle)[2], 0.0)]


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    spinning = total([s * omega for s, omega in zip(at.vehicle.spin, at.rotor_rad_s, strict=True)])
    zero = 0.0 * spinning
    return subtract(torque, cross(at.rate_rad_s, [zero, zero, p.J_r * spinning]))


TERM = Term(
    name="rotor_gyro",
    sentence="The angular momentum of the rotors resists turning their axis. Rotors turn against the yaw torque, "
             "whose sign is spin, so real rotors have J_r < 0 in this sign.",
    equation="tau <- tau - w x J_r sum_i(spin_i Omega_i) e3",
    parameters=(Parameter("J_r", "kg m^2", -1e-2, 1e-2, -2e-8, systematic=NOTHING, grows="mll", fitted=fitted,
                          source="propeller and bell, 0.4 g at 7 mm radius of gyration; sign see sentence"),),
    acts={Stage.TORQUE: moment},
    confused_with={"motor_imbalance": "fast yaw: the moment needs a rate of the body"},
    needs=("thrust_rpm",),
)
