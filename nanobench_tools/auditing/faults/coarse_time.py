"""coarse_time: the timestamps have too few digits: several rows with different values share one timestamp.

Found where more than half of the rows share their timestamp with a neighbour and the rows of one timestamp differ in
their values. Rows that were written twice, and a few shared timestamps, are ``duplicate_time``. The time between two
rows is then unknown, and with it every velocity and delay; no row can be used.

Size: median number of rows per timestamp. Smallest found: 2.
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.usable_rows import coarse_tables
from .kind import FaultKind

KIND = "coarse_time"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per table of timestamps."""
    faults = []
    for stream, t in context.once(coarse_tables):
        stamps, rows = np.unique(t, return_counts=True)
        usual = float(np.median(rows))
        faults.append(
            Fault(KIND, stream, ("t",), float(stamps[0]), float(stamps[-1]), usual, "rows",
                  f"{len(t)} rows have {len(stamps)} different timestamps, usually {usual:.0f} rows share one: the "
                  "times were written with too few digits", 2.0)
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="timestamps have too few digits: usually {count} of {streams} share one",
                  advice="write the file again with more digits of the time (milliseconds or finer)",
                  group="clock", cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.clock_faults:COARSE_TIME")
