"""Drag in proportion to speed squared.

It is the drag equation, 0.5 rho c A v^2, along each body axis.

Parameters
----------
q : (3,) N s^2/m^2
    Drag force over the air velocity squared, along body x, y and z.
"""

from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import AIR
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components


def force(body_force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return [f - q * (ops.fabs(v) * v) for f, q, v in zip(body_force, p.q, at.air_b, strict=True)]


TERM = Term(name="drag_quadratic",
            sentence="A force against the air velocity along each body axis, in proportion to its square.",
            equation="F_b <- F_b - diag(q) |v_b| v_b, v_b air velocity",
            parameters=(Parameter("q", "N s^2/m^2", 0.0, 1.0, 0.003, length=3, systematic=AIR, grows="m",
                                  source="0.5 rho c A with c = 1 and A = 0.005 m^2, frame and decks"),),
            acts={Stage.BODY_FORCE: force},
            confused_with={"drag_linear": "a wide range of speeds"},
            left_out={"first_principles": "their drag is linear"})
