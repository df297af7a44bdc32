"""Air that moves."""

from ..term import Parameter, Stage, Term
from ..vector import add


def air(velocity, p, at, ops):
    return add(velocity, p.w_m_s)


TERM = Term(
    name="wind",
    sentence="The air moves with a constant velocity in the world; drag acts on the velocity against the air.",
    equation="v_air = v - w",
    parameters=(Parameter("w_m_s", "m/s", -20.0, 20.0, 0.0, length=3, source="draught of a room: below 0.5 m/s"),),
    acts={Stage.WIND: air},
    confused_with={"force_world": "two headings with unequal drag along x and y, or two speeds with quadratic drag",
                   "frame_tilt": "two headings: a tilt turns with the vehicle, wind does not"},
    needs=("drag_linear", "drag_rotor", "drag_quadratic", "drag_torque"),
)
