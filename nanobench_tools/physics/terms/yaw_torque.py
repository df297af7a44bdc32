"""Rotor drag turns the vehicle about its z axis.

Parameters
----------
k_m : float, m
    Moment about body z over the thrust of a rotor. The direction is the rotor's spin.

References
----------
- Mahony, Kumar, Corke 2012, "Multirotor aerial vehicles: Modeling, estimation, and control of quadrotor", IEEE
  Robotics & Automation Magazine 19(3), doi:10.1109/MRA.2012.2206474.
- crazyflie-firmware 2025.12.1, platform_defaults_cf2.h.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number, setting
from ..ops import Ops
from ..systematic import Systematic
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, total

SYSTEMATIC = number("physics.yaw_torque.systematic")
IMPLAUSIBLE = number("physics.yaw_torque.implausible")
FITTED: tuple[float, float, str] = setting("physics.yaw_torque.fitted")


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    spin = total([s * t for s, t in zip(at.vehicle.spin, at.thrust_N, strict=True)])
    return [torque[0], torque[1], torque[2] + p.k_m * spin]


TERM = Term(name="yaw_torque",
            sentence="Each rotor's drag turns the vehicle about body z in proportion to its thrust.",
            equation="tau_z <- tau_z + sum_i spin_i k_m T_i",
            parameters=(Parameter("k_m", "m", 0.0, 0.1, 0.006993, systematic=Systematic(SYSTEMATIC, "gain"),
                                  implausible=IMPLAUSIBLE, grows="l", fitted=FITTED,
                                  source="crazyflie-firmware 2025.12.1, platform_defaults_cf2.h, THRUST2TORQUE"),),
            acts={Stage.TORQUE: moment},
            confused_with={"inertia": "only k_m / J_z is seen: a pendulum measurement"})
