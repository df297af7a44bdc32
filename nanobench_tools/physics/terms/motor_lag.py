"""Thrust follows its command with a first-order lag, faster up than down (or the reverse).

Parameters
----------
tau_up_s : float, s
    Time constant while the commanded thrust is above the thrust.
tau_down_s : float, s
    Time constant while it is below.

References
----------
- Mahony, Kumar, Corke 2012, "Multirotor aerial vehicles: Modeling, estimation, and control of quadrotor", IEEE
  Robotics & Automation Magazine 19(3), doi:10.1109/MRA.2012.2206474.
- Foerster 2015, "System identification of the Crazyflie 2.0 nano quadrocopter", bachelor thesis, ETH Zurich.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number, setting
from ..ops import Ops
from ..systematic import Systematic
from ..term import Belief, Parameter, Situation, Stage, Term

TYPICAL_UP_S = number("physics.motor_lag.typical_up_s")
TYPICAL_DOWN_S = number("physics.motor_lag.typical_down_s")

SYSTEMATIC_S = number("physics.motor_lag.systematic")
SEARCH_START_S = number("physics.motor_lag.search_start")
FITTED: tuple[float, float, str] = setting("physics.motor_lag.fitted")
BELIEVED_UP_S: tuple[float, float] = setting("physics.motor_lag.believed_up_s")
BELIEVED_DOWN_S: tuple[float, float] = setting("physics.motor_lag.believed_down_s")


def time_constants(value: Any, p: SimpleNamespace, at: Situation, ops: Ops) -> tuple[Any, Any]:
    return p.tau_up_s, p.tau_down_s


_SOURCE = ("79 NanoBench flights, test flights among them: PWM differences to angular acceleration 45 "
           "ms, delay of the logging included")


def _lag(name: str, typical_s: float, believed: tuple[float, float]) -> Parameter:
    return Parameter(name, "s", 0.0, 0.5, typical_s, neutral=0.0, source=_SOURCE, systematic=Systematic(SYSTEMATIC_S),
                     search_start=SEARCH_START_S, fitted=FITTED, believed=Belief(*believed, f"motor_lag: {_SOURCE}"))


TERM = Term(
    name="motor_lag",
    sentence="Each thrust approaches what is commanded exponentially, with one time constant up and another down.",
    equation="tau dT_i/dt = T_cmd_i - T_i, tau = tau_up where T_cmd_i > T_i, else tau_down; 0 means at once",
    parameters=(_lag("tau_up_s", TYPICAL_UP_S, BELIEVED_UP_S), _lag("tau_down_s", TYPICAL_DOWN_S, BELIEVED_DOWN_S)),
    acts={Stage.LAG: time_constants},
    confused_with={"command_delay": "steps of the command logged faster than 100 Hz: a lag begins at once",
                   "angular_damping": "rates that stay while the motors do not change"},
    left_out={"gym-pybullet-drones": "thrust follows the command at once there"},
)
