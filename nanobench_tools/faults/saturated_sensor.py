"""saturated_sensor: a gyro or accelerometer stuck at the end of its range.

Found by rows that equal the largest (or smallest) value of their column exactly: a sensor with noise meets its own
maximum once, one that clips meets it again and again. At least three rows in a row, one entry per column and side;
the span runs from the first to the last such row. A frozen stream repeats all columns and is reported as that.

Size: the limit, in the unit of the column. Smallest found: three clipped rows (30 ms) in a row.
"""

from __future__ import annotations

import numpy as np

from ..content.context import Context
from ..content.packets import packets_of
from ..content.rows import runs, usable_streams
from ..content.tails import alive_until
from ..flight import Fault, Flight

KIND = "saturated_sensor"

FEWEST_ROWS = 3


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per column and side."""
    stream = context.once(usable_streams).get("imu")
    if stream is None or "imu" not in context.once(packets_of):
        return []
    alive = stream.time_s <= context.once(alive_until)["imu"]
    still = context.once(packets_of)["imu"].still
    faults = []
    for k, column in enumerate(stream.columns):
        values = np.where(alive & np.isfinite(stream.values[:, k]), stream.values[:, k], np.nan)
        if not np.isfinite(values).any() or np.nanmin(values) == np.nanmax(values):
            continue
        for limit in (np.nanmax(values), np.nanmin(values)):
            at = values == limit
            together = [(a, b) for a, b in runs(at) if b - a >= FEWEST_ROWS and not still[a + 1:b].all()]
            if not together:
                continue
            rows = np.flatnonzero(at)
            faults.append(Fault(KIND, "imu", (column,), float(stream.time_s[rows[0]]), float(stream.time_s[rows[-1]]),
                                abs(float(limit)), stream.unit[k],
                                f"{column} stands at its extreme {limit:.4g} {stream.unit[k]} in {len(rows)} rows, up to "
                                f"{max(b - a for a, b in runs(at))} in a row", float(FEWEST_ROWS)))
    return faults
