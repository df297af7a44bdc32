"""saturated_sensor: a gyro or accelerometer stuck at the end of its range.

Found by rows that equal the largest (or smallest) value of their column exactly. A sensor with noise meets its own
extreme once (1224 of 1224 column ends of 102 real recordings). One that clips meets it again and again. At least three
rows, and three times as many as at any of the five values next to it. Coarse steps of a quiet sensor thus do not
count. One entry per column and end of the range; the span runs from the first to the last such row. A frozen stream
repeats all columns and is reported as that. Rows drawn between two packets count: a line between two clipped ones is
clipped.

Size: rows at that end of the range. Smallest found: 3, or three times the rows at the fullest of the five neighbouring
values (1 for a sensor with noise). A shorter clip looks like any extreme and is not found.
"""

import numpy as np

from ...flight import Fault, Flight
from ...settings import count
from ...signals.context import Context
from ...signals.dropouts import alive_until
from ...signals.packet_rows import packets_of
from ...signals.usable_rows import usable_streams
from .kind import FaultKind

KIND = "saturated_sensor"

FEWEST_ROWS = count("audit.saturated_sensor.fewest_rows")
NEIGHBOURS = count("audit.saturated_sensor.neighbours")
TIMES_NEIGHBOURS = count("audit.saturated_sensor.times_neighbours")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per column and side."""
    stream = context.once(usable_streams).get("imu")
    packets = context.once(packets_of).get("imu")
    if stream is None or packets is None:
        return []
    free = (stream.time_s <= context.once(alive_until)["imu"]) & ~packets.still
    faults = []
    for k, column in enumerate(stream.columns):
        rows = np.flatnonzero(free & np.isfinite(stream.values[:, k]))
        levels, counts = np.unique(stream.values[rows, k], return_counts=True)
        if len(levels) < 2 * NEIGHBOURS:
            continue
        for limit, here, beside in ((levels[-1], counts[-1], counts[-1 - NEIGHBOURS : -1]),
                                    (levels[0], counts[0], counts[1 : 1 + NEIGHBOURS])):
            fewest = max(FEWEST_ROWS, TIMES_NEIGHBOURS * int(beside.max()))
            if here < fewest:
                continue
            at = stream.time_s[rows[stream.values[rows, k] == limit]]
            faults.append(
                Fault(KIND, "imu", (column,), float(at[0]), float(at[-1]), float(here), "rows",
                      f"{column} has its extreme value {limit:.4g} {stream.unit[k]} in {here} rows, and each "
                      f"neighbouring value in at most {beside.max()}",
                      float(fewest))
            )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{columns} saturate{s} at the end of {its} range {count}",
                  cuts=True, cuts_logs=False, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.streams:SATURATED_SENSOR")
