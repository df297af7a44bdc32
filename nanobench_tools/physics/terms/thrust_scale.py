"""All motors weaker or stronger than the thrust curve by one factor.

Parameters
----------
s : float, 1
    Factor on the thrust of every motor.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import LEVEL
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, scale

TYPICAL = number("physics.thrust_scale.typical")
DIFFERS = number("physics.thrust_scale.differs")
"""As a share: flights that differ by less need not differ in this."""


def scaled(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return scale(p.s, thrust)


TERM = Term(name="thrust_scale",
            sentence="All thrusts are s times what the thrust curve gives (worn propellers, another air density).",
            equation="T_i <- s T_i",
            parameters=(Parameter("s", "1", 0.2, 3.0, TYPICAL, neutral=1.0, unidentifiable=(0,), systematic=LEVEL,
                                  differs=DIFFERS,
                                  source="78 NanoBench flights, test flights among them: real thrust over "
                                         "firmware cubic 0.943 +- 0.033"),),
            acts={Stage.THRUST_SCALE: scaled},
            confused_with={"mass": "a weighing, or fast rotations: torque grows with s and not with m",
                           "ground_effect": "hover high above the ground"},
            level=True, changes=True, scatters=("s",), cause="weight")
