"""sign: a column is negated.

Found by its correlation with what the motion capture predicts for it in the air (gyro, specific force, attitude rates,
estimated position, velocity and acceleration, requested attitude, setpoint), at the lag that fits the whole stream
best: below -0.4, with one sign in the seconds of the flight (t > 4), and clearly better than any lag without a change
of sign. The accelerometer's z is judged by gravity. True correlations of real flights are +0.2 to +1.0. When gyro and
estimated attitude are both negated, the motion capture is.

Size: the correlation's sign, -1. Smallest found: any axis that moves enough for a correlation of 0.4; an axis without
(yaw in flights that hold their heading, a world axis not flown along) is not judged.
"""

from __future__ import annotations

from ..flight import Fault, Flight
from ..signals.axis_unit_matching import CLEAR
from ..signals.context import Context
from ..signals.unit_sign_errors import wrong_signs
from .kind import FaultKind
from .making import over_stream

KIND = "sign"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per negated column."""
    return [
        over_stream(KIND, flight, name, (quantity,), -1.0, "1", evidence, CLEAR)
        for name, quantity, evidence in context.once(wrong_signs)
    ]


FAULT = FaultKind(KIND, find, __doc__, cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.streams:SIGN")
