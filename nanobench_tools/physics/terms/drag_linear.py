"""Drag in proportion to speed.

Parameters
----------
d : (3,) N s/m
    Drag force over air velocity, along body x, y and z.

References
----------
- Faessler, Franchi, Scaramuzza 2018, "Differential flatness of quadrotor dynamics subject to rotor drag", IEEE RA-L
  3(2), doi:10.1109/LRA.2017.2776353.
- Martin, Salaun 2010, "The true role of accelerometer feedback in quadrotor control", ICRA,
  doi:10.1109/ROBOT.2010.5509980.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import setting
from ..ops import Ops
from ..systematic import AIR
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

TYPICAL_N_S_M = setting("physics.drag_linear.typical_n_s_m")


def force(body_force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return [f - d * v for f, d, v in zip(body_force, p.d, at.air_b, strict=True)]


TERM = Term(name="drag_linear",
            sentence="A force against the air velocity along each body axis, in proportion to it.",
            equation="F_b <- F_b - diag(d) (v - wind)_b",
            parameters=(Parameter("d", "N s/m", 0.0, 20.0, TYPICAL_N_S_M, length=3, systematic=AIR, grows="m",
                                  source="79 NanoBench flights, test flights among them: k/m 0.391 (x), 0.404 "
                                         "(y), 0.14 (z) 1/s"),),
            acts={Stage.BODY_FORCE: force},
            confused_with={"drag_rotor": "the same speed with little and with much thrust (dives and climbs)",
                           "drag_quadratic": "a wide range of speeds", "wind": "the same path flown in two headings"})
