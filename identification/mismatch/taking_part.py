"""Which faults of the data reach a comparison of physics, and which of them forbid it.

A fault reaches it in a stream, and in quantities, that it is made from: the unit of a set-point or a spike in the
estimated attitude does not. One whose rows are left out forbids nothing while enough rows are left, and a clock that
was put right forbids nothing either: how late the recording still is, as it is compared, decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from nanobench_tools.audit import CUTTING_KINDS, Audit
from nanobench_tools.content.context import Context
from nanobench_tools.faults import clock_drift, clock_offset
from nanobench_tools.flight import Fault, Flight

CLOCKS = (clock_offset.KIND, clock_drift.KIND)
ATTITUDES = ("attitude_qw", "attitude")
Needed = Mapping[str, Sequence[str]]


def taking_part(audit: Audit, flight: Flight, needed: Needed) -> Audit:
    """The verdict with the faults alone that reach what ``needed`` says of ``flight`` (as recorded). An attitude that
    stands in for that of the motion capture counts as its own."""
    mocap = flight.streams.get("mocap")
    lent = mocap is not None and "qw" in needed["mocap"] and "qw" not in mocap
    faults = (replace(f, stream="mocap", columns=()) if lent and f.stream in ATTITUDES and "imu" not in needed else f
              for f in audit.faults)
    return replace(audit, faults=tuple(f for f in faults if _reaches(f, flight, needed)))


def _reaches(fault: Fault, flight: Flight, needed: Needed) -> bool:
    if not fault.stream:
        return True
    if fault.stream not in needed:
        return False
    stream = flight.streams.get(fault.stream)
    if stream is None or not fault.columns or fault.stream == "motor":  # of the motors all are needed
        return True
    hit = {stream.quantities[stream.index(c)] if c in stream else c for c in fault.columns}
    return not hit.isdisjoint(needed[fault.stream])


def cutting(audit: Audit) -> tuple[Fault, ...]:
    """Faults of ``taking_part`` that take rows in the air away; all of them where nobody can tell when it flew."""
    return tuple(f for f in audit.faults if f.kind in CUTTING_KINDS and (
        not audit.airborne or any(f.start_s < s.end_s and f.end_s > s.start_s for s in audit.airborne)))


def still_late(audit: Audit, moved: Flight, least_s: float) -> tuple[Fault, ...]:
    """Time errors of ``taking_part`` above ``least_s`` that are left in the recording as it is compared (``moved``)."""
    if not any(f.kind in CLOCKS for f in audit.faults):
        return ()
    context = Context(moved)
    left = (*clock_offset.find(context.flight, context), *clock_drift.find(context.flight, context))
    streams = {f.stream for f in audit.faults if f.kind in CLOCKS}
    return tuple(f for f in left if f.stream in streams and _error_s(f) > least_s)


def _error_s(fault: Fault) -> float:
    """The largest time error of a fault of ``CLOCKS``: a drift is least in the middle."""
    return abs(fault.size) * (0.5 * (fault.end_s - fault.start_s) if fault.kind == clock_drift.KIND else 1.0)
