"""axis_swap: columns of a vector have changed places.

Found by the correlations of all axes of a stream with all axes of what the motion capture predicts (as in ``sign``):
another order of axes must raise their sum by 0.5, every axis that moved must correlate by more than 0.4 with its new
partner and with one sign over the seconds of the flight. Gravity that lies along x or y gives the accelerometer's away.

Size: nan. Smallest found: axes that both move enough for a correlation of 0.4.
"""

from __future__ import annotations

import math

from ..flight import Fault, Flight
from ..signals.context import Context
from ..signals.unit_sign_errors import wrong_axes
from .kind import FaultKind
from .making import over_stream

KIND = "axis_swap"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream and vector."""
    return [
        over_stream(KIND, flight, name, quantities, math.nan, "1", evidence)
        for name, quantities, evidence in context.once(wrong_axes)
    ]


FAULT = FaultKind(KIND, find, __doc__, cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.streams:AXIS_SWAP")
