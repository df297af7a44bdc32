"""Another mass than the vehicle's table says.

Parameters
----------
m : float, kg
    Mass of the vehicle with everything that it carries.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import LEVEL
from ..term import Parameter, Situation, Stage, Term

DIFFERS = number("physics.mass.differs")
"""As a share: flights that differ by less need not differ in this."""


def mass(value: Any, p: SimpleNamespace, at: Situation, ops: Ops) -> Any:
    return p.m


TERM = Term(
    name="mass",
    sentence="The vehicle weighs m (payload, another battery); gravity and inertia of the motion use it.",
    equation="m",
    parameters=(Parameter("m", "kg", 0.001, 10.0, 0.04085, neutral="mass_kg", unidentifiable=(0,), systematic=LEVEL,
                          differs=DIFFERS, grows="m",
                          source="NanoBench paper: vehicle weighed with battery and markers"),),
    acts={Stage.MASS: mass},
    confused_with={"thrust_scale": "a weighing: free flight shows T/m only; torque shows mass weakly"},
    level=True, changes=True, cause="weight",
)
