"""Air velocity across the rotors turns the vehicle.

Parameters
----------
c : float, N s
    Moment over the velocity against the air. A velocity along body x gives a moment about y, one along y about -x.

References
----------
Pounds, Mahony, Corke 2010, "Modelling and control of a large quadrotor robot", Control Engineering Practice 18(7),
doi:10.1016/j.conengprac.2010.02.008.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number, setting
from ..ops import Ops
from ..systematic import AIR
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

TYPICAL_N_S = number("physics.drag_torque.typical_n_s")
FITTED: tuple[float, float, str] = setting("physics.drag_torque.fitted")


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    """e3 x v_b = (-v_y, v_x, 0)."""
    return [torque[0] - p.c * at.air_b[1], torque[1] + p.c * at.air_b[0], torque[2]]


TERM = Term(
    name="drag_torque",
    sentence="Lateral air velocity tips the vehicle (flapping blades, drag above or below the centre of mass). Real "
             "vehicles have c < 0: the nose goes up against the wind.",
    equation="tau <- tau + c e3 x v_b, v_b air velocity",
    parameters=(Parameter("c", "N s", -2.0, 2.0, TYPICAL_N_S, systematic=AIR, grows="ml", fitted=FITTED,
                          source="a prototype on 54 NanoBench flights: 6-11 rad/s^2 per m/s of lateral velocity"),),
    acts={Stage.TORQUE: moment},
    confused_with={"com_offset": "hover: an offset of the centre of mass still turns there"},
)
