"""A constant push.

Parameters
----------
f_N : (3,) N
    Force on the centre of mass, world x, y and z.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import add

DIFFERS_N = number("physics.force_world.differs")


def force(value: Any, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return add(value, p.f_N)


TERM = Term(
    name="force_world",
    sentence="A constant force in the world at the centre of mass (a draught, a wire, gravity not along world z).",
    equation="F <- F + f",
    parameters=(Parameter("f_N", "N", -5.0, 5.0, 0.0, length=3, systematic=NOTHING, differs=DIFFERS_N, grows="m",
                          source="1 % of the weight of 0.4 N"),),
    acts={Stage.WORLD_FORCE: force},
    confused_with={"wind": "two headings with unequal drag along x and y, or two speeds with quadratic drag",
                   "frame_tilt": "two headings: a tilt turns with the vehicle, a force in the world does not"},
    changes=True, of_air=True, left_out={"first_principles": "give it as dist_f"},
)
