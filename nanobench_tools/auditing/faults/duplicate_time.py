"""duplicate_time: two or more rows carry the same stamp.

Found by equal neighbours among the stamps. Streams of one table share their stamps, and a fault of shared stamps is
reported once, with no stream. Where most rows share theirs, it is ``coarse_time``. Size: rows that repeat a stamp.
Smallest found: 1 row.
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.usable_rows import coarse_tables, runs, tables
from .kind import FaultKind

KIND = "duplicate_time"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per run of repeated stamps."""
    faults = []
    coarse = {stream for stream, _ in context.once(coarse_tables)}
    for stream, t in (table for table in context.once(tables) if table[0] not in coarse):
        for a, b in runs(np.concatenate(([False], np.diff(t) == 0.0))):
            start, end = float(t[a - 1]), float(t[min(b, len(t) - 1)])
            faults.append(Fault(KIND, stream, ("t",), start, max(end, start), float(b - a), "rows",
                                f"{b - a + 1} rows have the timestamp {start:.4f} s", 1.0))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{count} of {streams} share a timestamp with another",
                  advice="check the time column: every row needs its own",
                  group="clock", injection="nanobench_tools.practice.inject.clock_faults:DUPLICATE_TIME")
