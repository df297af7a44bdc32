"""bad_cell: text, an infinity, a gigantic number or nothing where a number belongs, or a row with too few or too many
cells.

Found by the reader, which gives line and column. This check finds other values that are not numbers, and numbers
beyond any measurement (1e8 in SI units). Stretches of poses are ``mocap_occlusion``.

Size: cells, or rows. Smallest found: one cell.
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.usable_rows import runs, usable_streams
from . import mocap_occlusion
from .kind import FaultKind
from .making import findings

KIND = "bad_cell"


def find(flight: Flight, context: Context) -> list[Fault]:
    """The reader's findings, and stretches of rows that are not finite in streams it said nothing about."""
    faults = findings(flight, KIND)
    occluded = mocap_occlusion.find(flight, context)
    for name, stream in context.once(usable_streams).items():
        if name == "extra":
            continue
        reported = [f.span for f in faults if f.stream in (name, "")]
        bad = ~np.isfinite(stream.values)
        t = stream.time_s
        for a, b in runs(bad.any(axis=1)):
            columns = tuple(c for c, flag in zip(stream.columns, bad[a:b].any(axis=0), strict=True) if flag)
            if any(span.start_s <= t[b - 1] and t[a] <= span.end_s for span in reported):
                continue
            start, end = float(t[max(a - 1, 0)]), float(t[min(b, len(t) - 1)])
            if any(fault.stream == name and fault.start_s <= start and end <= fault.end_s for fault in occluded):
                continue
            faults.append(
                Fault(KIND, name, columns, start, end, float(bad[a:b].sum()), "cells",
                      f"{', '.join(columns)}: no number, or one beyond any measurement, in {b - a} rows", 1.0)
            )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{streams} hold{s} no number in {count}",
                  cuts=True, file_injection="nanobench_tools.practice.inject.files:BAD_CELL")
