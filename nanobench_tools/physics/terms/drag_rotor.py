"""Drag of the rotors: in proportion to speed and to how fast they turn.

Parameters
----------
d : (3,) N s^2/m/rad
    Drag force over air velocity and over the sum of the rotor speeds, along body x, y and z.

References
----------
- Martin, Salaun 2010, "The true role of accelerometer feedback in quadrotor control", ICRA,
  doi:10.1109/ROBOT.2010.5509980.
- Foerster 2015, "System identification of the Crazyflie 2.0 nano quadrocopter", bachelor thesis, ETH Zurich.
"""

from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import AIR
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, total


def force(body_force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    speed = total(at.rotor_rad_s)
    return [f - speed * (d * v) for f, d, v in zip(body_force, p.d, at.air_b, strict=True)]


TERM = Term(
    name="drag_rotor",
    sentence="Blades that advance lift more than those that retreat: a force against the air velocity that grows with "
             "the sum of the rotor speeds.",
    equation="F_b <- F_b - (sum_i Omega_i) diag(d) (v - wind)_b",
    parameters=(Parameter("d", "N s^2/m/rad", 0.0, 1e-1, (2.0e-6, 2.0e-6, 7e-7), length=3,
                          systematic=AIR, grows="m/w",
                          source="Foerster 2015, System Identification of the Crazyflie 2.0: 9.2e-7 unloaded"),),
    acts={Stage.BODY_FORCE: force},
    confused_with={"drag_linear": "the same speed with little and with much thrust (dives and climbs)"},
    needs=("thrust_rpm",),
)
