"""Thrust from PWM alone, blind to the battery.

Parameters
----------
c : (k,) N
    Coefficients of the PWM ratio (0 to 1), from the constant on, for one motor.

References
----------
crazyflie-firmware 2025.12.1, platform_defaults_cf2.h.
"""

from types import SimpleNamespace

from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components, polynomial


def thrust(inputs: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> Components:
    return [polynomial(p.c, u) for u in inputs]


TERM = Term(name="thrust_pwm",
            sentence="Each motor's thrust is a polynomial of its PWM ratio, independent of the battery.",
            equation="T_i = sum_k c_k u_i^k",
            parameters=(Parameter("c", "N", -500.0, 500.0, (0.0, 0.02, 0.14), neutral=None, length=None,
                                  systematic=NOTHING, grows="m",
                                  source="order of the firmware's 0.12 N at full command (platform_defaults_cf2.h)"),),
            acts={Stage.THRUST_MAP: thrust},
            confused_with={"thrust_voltage": "the same hover at a full and at an empty battery"},
            answered=True)
