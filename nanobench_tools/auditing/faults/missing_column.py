"""missing_column: a column of the format is not in the file, or holds no value.

Found by the reader. In a flight without a reader's verdict, this check finds incomplete vectors (two axes of a gyro,
motors 1, 2 and 4). Only the reader can know how many motors there are. Takes no time away: whoever needs the column
gets an InputError that names it.

Size: columns. Smallest found: one column.
"""

from dataclasses import replace

import numpy as np

from ...flight import Fault, Flight, Stream
from ...signals.context import Context
from ...sources.nanobench_columns import STREAMS
from .kind import FaultKind
from .making import findings, over_stream

KIND = "missing_column"

VECTORS = {
    "mocap": (("px", "py", "pz"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "vz"), ("wx", "wy", "wz"),
              ("roll", "pitch", "yaw")),
    "imu": (("acc_x", "acc_y", "acc_z"), ("gyro_x", "gyro_y", "gyro_z")),
    "estimator": (("x", "y", "z"), ("vx", "vy", "vz")),
    "estimator_acc": (("ax", "ay", "az"),),
    "attitude": (("roll", "pitch", "yaw"),),
    "attitude_qw": (("qx", "qy", "qz", "qw"),),
    "setpoint": (("x", "y", "z", "yaw"),),
    "pid": (("roll", "pitch", "yaw", "cmd_thrust"),),
}
"""What belongs together in every source."""
MOTORS = ("motor", "motor_request", "rpm")
"""Streams of m1, m2 ... up to the last that is there."""


def find(flight: Flight, context: Context) -> list[Fault]:
    """The reader's findings, else one fault per stream with holes in its vectors."""
    faults = findings(flight, KIND)
    reported = {fault.stream for fault in faults}
    for name in (*VECTORS, *MOTORS):
        if name not in flight or name in reported:
            continue
        stream = flight[name]
        empty = {
            q
            for q, k in zip(stream.quantities, range(stream.values.shape[1]), strict=True)
            if len(stream) and not np.isfinite(stream.values[:, k]).any()
        }
        there = set(stream.quantities) - empty
        vectors = VECTORS.get(name) or (_up_to_the_last(there),)
        missing = tuple(q for vector in vectors if there & set(vector) for q in vector if q not in there)
        # a stream with only independent columns left was never recorded
        if missing:
            columns = _column_names(name, stream, missing)
            evidence = f"{name} has {', '.join(sorted(there))} but not {', '.join(missing)}"
            whole = over_stream(KIND, flight, name, (), len(missing), "columns", evidence, 1.0)
            faults.append(replace(whole, columns=columns))
    return faults


def _up_to_the_last(there: set[str]) -> tuple[str, ...]:
    last = max((int(q[1:]) for q in there if q.startswith("m")), default=0)
    return tuple(f"m{i}" for i in range(1, last + 1))


def _column_names(name: str, stream: Stream, missing: tuple[str, ...]) -> tuple[str, ...]:
    """What the missing quantities are called where the other columns come from, else the quantities."""
    known = {c.quantity: c.name for c in STREAMS.get(name, ())}
    same_source = all(known.get(q) == c for q, c in zip(stream.quantities, stream.columns, strict=True))
    return tuple(known.get(q, q) for q in missing) if same_source else missing


FAULT = FaultKind(KIND, find, __doc__,
                  told="columns of {streams} are missing: {columns}",
                  group="lost", whole=True, in_diagnosis=False,
                  injection="nanobench_tools.practice.inject.streams:MISSING_COLUMN",
                  file_injection="nanobench_tools.practice.inject.files:MISSING_COLUMN")
