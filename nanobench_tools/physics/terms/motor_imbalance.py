"""Motors that differ from each other.

Parameters
----------
g : (rotors,) 1
    Factor on the thrust of each motor, in the order of the motors; their mean is 1.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import Systematic
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

SYSTEMATIC = number("physics.motor_imbalance.systematic")
DIFFERS = number("physics.motor_imbalance.differs")
"""Flights that differ by less need not differ in this."""
MEAN_WITHIN = 0.005
"""Gains written with two or three digits still have mean 1 within this."""


def imbalanced(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return [g * t for g, t in zip(p.g, thrust, strict=True)]


def mean_is_one(values: Mapping[str, Any]) -> tuple[str, str] | None:
    mean = sum(values["g"]) / len(values["g"])
    if abs(mean - 1.0) > MEAN_WITHIN:
        return f"g has mean {mean:.6g}, must be 1", "divide g by its mean and put the mean into thrust_scale"
    return None


TERM = Term(
    name="motor_imbalance",
    sentence="Each motor has its own gain around a mean of 1 (a chipped propeller, a worn motor).",
    equation="T_i <- g_i T_i, mean g = 1",
    parameters=(Parameter("g", "1", 0.2, 2.0, 1.0, neutral=1.0, length="rotors", fixed_mean=1.0,
                          systematic=Systematic(SYSTEMATIC), differs=DIFFERS,
                          source="NanoBench flights, which ones is not recorded: PWM of the four motors "
                                 "differs by 10 % in hover"),),
    acts={Stage.MOTOR_GAIN: imbalanced},
    confused_with={"com_offset": "hover and strong climbs: both turn with thrust, but only an offset of the centre "
                                 "of mass also turns with drag. Yaw helps too, as only gains upset it"},
    check=mean_is_one, changes=True, scatters=("g",), frame="per motor", cause="propeller",
)
