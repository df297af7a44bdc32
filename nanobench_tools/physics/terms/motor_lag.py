"""Thrust follows its command with a first-order lag, faster up than down (or the reverse)."""

from ...settings import number
from ..term import Parameter, Stage, Term

TYPICAL_UP_S = number("physics.motor_lag.typical_up_s")
"""Typical of a 40 g quadrotor; where a fit begins."""
TYPICAL_DOWN_S = number("physics.motor_lag.typical_down_s")
"""Typical of a 40 g quadrotor; where a fit begins."""


def time_constants(value, p, at, ops):
    return p.tau_up_s, p.tau_down_s


_SOURCE = ("79 NanoBench flights, test flights among them: PWM differences to angular acceleration 45 "
           "ms, delay of the logging included")

TERM = Term(
    name="motor_lag",
    sentence="Each thrust approaches what is asked for exponentially, with one time constant up and another down.",
    equation="tau dT_i/dt = T_cmd_i - T_i, tau = tau_up where T_cmd_i > T_i, else tau_down; 0 means at once",
    parameters=(Parameter("tau_up_s", "s", 0.0, 0.5, TYPICAL_UP_S, neutral=0.0, source=_SOURCE),
                Parameter("tau_down_s", "s", 0.0, 0.5, TYPICAL_DOWN_S, neutral=0.0, source=_SOURCE)),
    acts={Stage.LAG: time_constants},
    confused_with={"command_delay": "steps of the command logged faster than 100 Hz: a lag begins at once",
                   "angular_damping": "rates that stay while the motors do not change"},
)
