"""Thrust changes with the air that comes through and across the rotors."""

from ...settings import number
from ..term import Parameter, Stage, Term
from ..vector import scale

TYPICAL_S_M = number("physics.inflow.typical_s_m")
"""Typical of a 40 g quadrotor; where a fit begins."""


def changed(thrust, p, at, ops):
    x, y, z = at.velocity_b
    return scale(1.0 - p.k_z * z + p.k_h * (x * x + y * y), thrust)


TERM = Term(
    name="inflow",
    sentence="Climbing takes thrust from the rotors, flying sideways gives some back (translational lift).",
    equation="T_i <- T_i (1 - k_z v_bz + k_h (v_bx^2 + v_by^2)), v_b ground velocity",
    parameters=(Parameter("k_z", "s/m", -0.5, 1.0, TYPICAL_S_M,
                          source="NanoBench flights, which ones is not recorded: vertical damping 0.14 "
                                 "1/s over 9.81 m/s^2"),
                Parameter("k_h", "s^2/m^2", -0.2, 0.2, 0.005,
                          source="order of 1 / (8 v_i^2) with the induced velocity v_i = 5 m/s of momentum theory")),
    acts={Stage.INFLOW: changed},
    confused_with={"thrust_pwm": "climbs and descents at the same command", "thrust_voltage": "the same",
                   "drag_linear": "vertical speed at different thrusts; with k_z the force grows with thrust"},
)
