"""Thrust grows near the ground.

Parameters
----------
rho : float, 1
    Strength of the effect; 1 for a single rotor.
R : float, m
    Radius of a propeller.

References
----------
Cheeseman, Bennett 1955, "The effect of the ground on a helicopter rotor in forward flight", ARC R&M 3021.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, scale

SEARCH_START = number("physics.ground_effect.search_start")
LOWEST = 0.5
"""Heights below this many radii count as this: Cheeseman and Bennett's law is not meant for less and has a pole."""


def changed(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    ratio = p.R / (4.0 * ops.fmax(at.position_m[2], LOWEST * p.R))
    return scale(1.0 / (1.0 - p.rho * (ratio * ratio)), thrust)


TERM = Term(
    name="ground_effect",
    sentence="Near the ground, z = 0 of the world, the air cannot get away and the same rotor lifts more.",
    equation="T_i <- T_i / (1 - rho (R / (4 z))^2), z not below R / 2",
    parameters=(Parameter("rho", "1", 0.0, 3.5, 1.0, systematic=NOTHING, search_start=SEARCH_START, in_product=True,
                          source="Cheeseman and Bennett 1955: 1 for one rotor; Danjun et al. 2015 fit larger"),
                Parameter("R", "m", 0.005, 0.5, 0.0231, neutral=0.0231, systematic=NOTHING, grows="l",
                          source="46 mm propeller")),
    acts={Stage.GROUND: changed},
    confused_with={"thrust_scale": "hover at 0.05 m and at 1 m"},
    frame="world",
)
