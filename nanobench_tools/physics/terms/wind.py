"""Air that moves.

Parameters
----------
w_m_s : (3,) m/s
    Velocity of the air, world x, y and z.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, add

DIFFERS_M_S = number("physics.wind.differs")
"""Flights that differ by less need not differ in this."""


def air(velocity: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return add(velocity, p.w_m_s)


TERM = Term(
    name="wind",
    sentence="The air moves with a constant velocity in the world; drag acts on the velocity against the air.",
    equation="v_air = v - w",
    parameters=(Parameter("w_m_s", "m/s", -20.0, 20.0, 0.0, length=3, systematic=NOTHING, differs=DIFFERS_M_S,
                          source="draught of a room: below 0.5 m/s"),),
    acts={Stage.WIND: air},
    confused_with={"force_world": "two headings with unequal drag along x and y, or two speeds with quadratic drag",
                   "frame_tilt": "two headings: a tilt turns with the vehicle, wind does not"},
    changes=True, of_air=True, cause="wind",
    left_out={"RotorPy": "no parameter of the vehicle; give RotorPy ConstantWind, as the adapter does from "
                         "wind_m_s", "first_principles": "their drag takes the velocity over ground"},
    needs=("drag_linear", "drag_rotor", "drag_quadratic", "drag_torque"),
)
