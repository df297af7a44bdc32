"""Offset of the centre of mass from the centre of the motors.

Parameters
----------
r_m : (3,) m
    From the centre of the motors to the centre of mass, body x, y and z. Flights show z only together with drag.
"""

import math
from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import Systematic
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, cross, subtract
from ..vehicle import Vehicle

SYSTEMATIC_M = number("physics.com_offset.systematic")
DIFFERS_M = number("physics.com_offset.differs")
"""Flights that differ by less need not differ in this."""

MOST = 0.5
"""Of the distance of the motors from their centre: a vehicle whose centre of mass is further off can hardly fly."""


def fitted(vehicle: Vehicle) -> list[tuple[float, float]]:
    """m along x, y, z."""
    most = MOST * sum(math.hypot(*p) for p in vehicle.motor_positions_m) / len(vehicle.motor_positions_m)
    return [(-most, most)] * 3


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return subtract(torque, cross(p.r_m, at.force_b))


TERM = Term(name="com_offset",
            sentence="The centre of mass lies r away from the centre of the motors, so every body force has a moment.",
            equation="tau <- tau - r x F_b, F_b with thrust",
            parameters=(Parameter("r_m", "m", -0.05, 0.05, 0.0, length=3, systematic=Systematic(SYSTEMATIC_M),
                                  differs=DIFFERS_M, grows="l", fitted=fitted, only_with={2: "drag_torque"},
                                  source="Crazyflie with deck and markers: a few millimetres"),),
            acts={Stage.TORQUE: moment},
            confused_with={"motor_imbalance": "yaw: unequal gains upset it, an offset does not; r_z shows in drag only",
                           "drag_torque": "hover: a moment from the air vanishes there"},
            changes=True, scatters=("r_m[0]", "r_m[1]"))
