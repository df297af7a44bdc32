"""Centre of mass beside the centre of the motors."""

from ..term import Parameter, Stage, Term
from ..vector import cross, subtract


def moment(torque, p, at, ops):
    return subtract(torque, cross(p.r_m, at.force_b))


TERM = Term(
    name="com_offset",
    sentence="The centre of mass lies r away from the centre of the motors, so every body force has a moment.",
    equation="tau <- tau - r x F_b, F_b with thrust",
    parameters=(Parameter("r_m", "m", -0.05, 0.05, 0.0, length=3,
                          source="Crazyflie with deck and markers: a few millimetres"),),
    acts={Stage.TORQUE: moment},
    confused_with={"motor_imbalance": "yaw: unequal gains upset it, an offset does not; r_z shows in drag only",
                   "drag_torque": "hover: a moment from the air vanishes there"},
)
