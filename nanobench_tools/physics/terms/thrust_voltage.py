"""Thrust from the voltage a motor sees: PWM ratio times battery voltage.

Parameters
----------
c : (k,) N/V^k
    Coefficients of the mean motor voltage [V], from the constant on, for one motor.

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
    return [polynomial(p.c, u * at.battery_V) for u in inputs]


TERM = Term(
    name="thrust_voltage",
    sentence="Each motor's thrust is a polynomial of the mean voltage at the motor, PWM ratio times battery voltage.",
    equation="T_i = sum_k c_k (u_i V)^k",
    parameters=(Parameter("c", "N/V^k", -500.0, 500.0, (-0.0248, 0.0652, -0.0268, 0.00678), neutral=None, length=None,
                          systematic=NOTHING, grows="m",
                          source="crazyflie-firmware 2025.12.1, platform_defaults_cf2.h, 2.1+ propellers"),),
    acts={Stage.THRUST_MAP: thrust},
    confused_with={"thrust_pwm": "the same hover at a full and at an empty battery"},
    answered=True, cause="battery",
)
