"""Rotation dies away.

Parameters
----------
d_r : (3,) N m s
    Moment against the body rate, over that rate, about body x, y and z.
"""

from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import DAMPING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components


def moment(torque: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    return [tau - d * w for tau, d, w in zip(torque, p.d_r, at.rate_rad_s, strict=True)]


TERM = Term(
    name="angular_damping",
    sentence="A moment against the body rate, from rotors that move through the air when the body turns.",
    equation="tau <- tau - diag(d_r) w",
    parameters=(Parameter("d_r", "N m s", 0.0, 2.0, 1e-5, length=3, systematic=DAMPING, grows="mll",
                          source="hover thrust times arm squared over induced velocity of a 46 mm propeller, 3 m/s"),),
    acts={Stage.TORQUE: moment},
    left_out={"RotorPy": "RotorPy damps rates only through k_d and k_z of its rotors"},
    confused_with={"motor_lag": "rates that stay while the motors do not change"},
)
