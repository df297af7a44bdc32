"""bad_cell: text, an infinity or nothing where a number belongs, or a row with too few or too many cells.

Found by the reader, which names line and column; what is not a number in a stream and was not named by it is found
here (streams built by a program, for instance). Poses that are not numbers are ``mocap_occlusion``.

Size: cells, or rows. Smallest found: one cell.
"""

from __future__ import annotations

import numpy as np

from ..content.context import Context
from ..content.rows import runs, usable_streams
from ..flight import Fault, Flight
from .making import findings

KIND = "bad_cell"


def find(flight: Flight, context: Context) -> list[Fault]:
    """The reader's findings, and stretches of rows that are not finite in streams it said nothing about."""
    faults = findings(flight, KIND)
    told = {fault.stream for fault in faults}
    for name, stream in context.once(usable_streams).items():
        if name in told or name in ("mocap", "extra") or "" in told:
            continue
        bad = ~np.isfinite(stream.values)
        t = stream.time_s
        for a, b in runs(bad.any(axis=1)):
            columns = tuple(c for c, flag in zip(stream.columns, bad[a:b].any(axis=0), strict=True) if flag)
            start, end = float(t[max(a - 1, 0)]), float(t[min(b, len(t) - 1)])
            faults.append(
                Fault(
                    KIND,
                    name,
                    columns,
                    start,
                    end,
                    float(bad[a:b].sum()),
                    "cells",
                    f"{', '.join(columns)}: no number in {b - a} rows",
                    1.0,
                )
            )
    return faults
