"""Commands act later than their timestamp.

Parameters
----------
delay_s : float, s
    From the logged timestamp of a motor command to its effect on the thrust.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number, setting
from ..ops import Ops
from ..systematic import Systematic
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

TYPICAL_S = number("physics.command_delay.typical_s")
SYSTEMATIC_S = number("physics.command_delay.systematic")
SEARCH_START_S = number("physics.command_delay.search_start")
FITTED: tuple[float, float, str] = setting("physics.command_delay.fitted")


def delayed(inputs: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    """The mean over the row of the held input shifted by the delay: exact, and linear in delay_s within a row."""
    share = p.delay_s / at.row_s - at.whole_rows
    return [new + share * (old - new) for new, old in zip(inputs, at.before, strict=True)]


TERM = Term(name="command_delay",
            sentence="Every motor command acts a constant time after the timestamp it is logged with.",
            equation="u_i <- u_i(t - d)",
            parameters=(Parameter("delay_s", "s", 0.0, 0.2, TYPICAL_S, neutral=0.0,
                                  systematic=Systematic(SYSTEMATIC_S), search_start=SEARCH_START_S, fitted=FITTED,
                                  source="a prototype on NanoBench flights, which ones is not recorded: 20 ms "
                                         "together with a first-order lag"),),
            acts={Stage.INPUT_DELAY: delayed},
            confused_with={"motor_lag": "steps of the command logged faster than 100 Hz: a delay does nothing at first",
                           "clock_offset": "the audit's clock of the motor stream against the others"},
            far=True)
