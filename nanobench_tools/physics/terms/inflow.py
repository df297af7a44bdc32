"""Thrust changes with the air that comes through and across the rotors.

Parameters
----------
k_z : float, s/m
    Share of thrust lost per velocity along body z.
k_h : float, s^2/m^2
    Share of thrust gained per squared velocity across body z.

References
----------
- Svacha, Mohta, Kumar 2017, "Improving quadrotor trajectory tracking by compensating for aerodynamic effects", ICUAS.
- Folk, Paulos, Kumar 2023, "RotorPy", arXiv 2306.04485.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number, setting
from ..ops import Ops
from ..systematic import AIR
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, scale

TYPICAL_S_M = number("physics.inflow.typical_s_m")
FITTED_K_Z: tuple[float, float, str] = setting("physics.inflow.fitted_k_z")
FITTED_K_H: tuple[float, float, str] = setting("physics.inflow.fitted_k_h")
"""The same of k_h."""


def changed(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    x, y, z = at.velocity_b
    return scale(1.0 - p.k_z * z + p.k_h * (x * x + y * y), thrust)


TERM = Term(
    name="inflow",
    sentence="Climbing takes thrust from the rotors, flying sideways gives some back (translational lift).",
    equation="T_i <- T_i (1 - k_z v_bz + k_h (v_bx^2 + v_by^2)), v_b ground velocity",
    parameters=(Parameter("k_z", "s/m", -0.5, 1.0, TYPICAL_S_M, systematic=AIR, fitted=FITTED_K_Z,
                          source="NanoBench flights, which ones is not recorded: vertical damping 0.14 "
                                 "1/s over 9.81 m/s^2"),
                Parameter("k_h", "s^2/m^2", -0.2, 0.2, 0.005, systematic=AIR, fitted=FITTED_K_H,
                          source="order of 1 / (8 v_i^2) with the induced velocity v_i = 5 m/s of momentum theory")),
    acts={Stage.INFLOW: changed},
    confused_with={"thrust_pwm": "climbs and descents at the same command", "thrust_voltage": "the same",
                   "drag_linear": "vertical speed at different thrusts; with k_z the force grows with thrust"},
    answered=True,
)
