"""Motors that can do no more.

One of the two parameters is given.

Parameters
----------
u_max : float, 1
    Largest PWM ratio that has an effect; for vehicles with PWM inputs.
T_max_N : float, N
    Largest thrust of one motor.

References
----------
crazyflie-firmware 2025.12.1, platform_defaults_cf2.h.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from ..ops import Ops
from ..systematic import NOTHING
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components


def limited_input(inputs: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> Components:
    return inputs if p.u_max is None else [ops.fmin(u, p.u_max) for u in inputs]


def limited_thrust(thrust: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> Components:
    return thrust if p.T_max_N is None else [ops.fmin(t, p.T_max_N) for t in thrust]


def one_is_given(values: Mapping[str, Any]) -> tuple[str, str] | None:
    return None if values else ("neither u_max nor T_max_N is given", "give one of them")


TERM = Term(
    name="saturation",
    sentence="Above a PWM ratio, or above a thrust, a motor does no more than it does there.",
    equation="u_i <- min(u_i, u_max) or T_i <- min(T_i, T_max)",
    parameters=(Parameter("u_max", "1", 0.05, 1.0, 1.0, neutral=1.0, optional=True, systematic=NOTHING,
                          only_input="pwm", search_start="inputs", source="full duty"),
                Parameter("T_max_N", "N", 0.001, 50.0, 0.12, neutral=50.0, optional=True, systematic=NOTHING, grows="m",
                          search_start="thrusts",
                          source="crazyflie-firmware 2025.12.1, platform_defaults_cf2.h, THRUST_MAX")),
    acts={Stage.INPUT_LIMIT: limited_input, Stage.THRUST_LIMIT: limited_thrust},
    confused_with={"thrust_pwm": "commands far above and far below the limit", "thrust_voltage": "the same"},
    check=one_is_given, answered=True,
)
