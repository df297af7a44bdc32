"""backward_time: a stamp lies before that of an earlier row.

Found by a step backwards in the stamps. The rows between the step and the moment at which the timestamps have caught
up are in doubt. The span covers the times that occur twice. Shared stamps are reported once, with no stream. Size:
seconds of the step. Smallest found: any step to before the row ahead (one that only shortens a row is none).
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.usable_rows import tables
from .kind import FaultKind

KIND = "backward_time"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per step backwards."""
    faults = []
    for stream, t in context.once(tables):
        for i in np.flatnonzero(np.diff(t) < 0.0):
            back = float(t[i] - t[i + 1])
            faults.append(Fault(KIND, stream, ("t",), float(t[i + 1]), float(t[i]), back, "s",
                                f"row {i + 2} is stamped {back:.4f} s before row {i + 1}", 0.0))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="timestamps of {streams} run backwards {count}",
                  group="clock", cuts=True, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.clock_faults:BACKWARD_TIME")
