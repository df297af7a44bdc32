"""Which faults of the data reach a comparison of physics, and which of them forbid it.

A fault reaches the comparison only through the streams and quantities that it uses. The unit of a set-point or a spike
in the estimated attitude does not reach it. A fault whose rows are removed does not forbid the comparison while enough
rows remain. Nor does a corrected clock forbid it: only the delay that remains in the compared recording counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from nanobench_tools.auditing.faults.kinds import cutting as cutting_kinds
from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.flight import Fault, Flight
from nanobench_tools.signals.context import Context

ATTITUDES = ("attitude_qw", "attitude")
Needed = Mapping[str, Sequence[str]]


def taking_part(audit: Audit, flight: Flight, needed: Needed) -> Audit:
    """The verdict with only the faults that reach the quantities in ``needed`` of ``flight`` (as recorded). An attitude
    that replaces that of the motion capture counts as part of it."""
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
    """Faults of ``taking_part`` that remove rows in the air; all of them if the time in the air is unknown."""
    cuts = cutting_kinds()
    return tuple(f for f in audit.faults if f.kind in cuts and (
        not audit.airborne or any(f.start_s < s.end_s and f.end_s > s.start_s for s in audit.airborne)))


def still_late(audit: Audit, moved: Flight, least_s: float) -> tuple[Fault, ...]:
    """Time errors of ``taking_part`` above ``least_s`` that remain in the compared recording (``moved``)."""
    clocks = {name: kind for name, kind in kinds().items() if kind.left_s is not None}
    streams = {f.stream for f in audit.faults if f.kind in clocks}
    if not streams:
        return ()
    context = Context(moved)
    return tuple(f for kind in clocks.values() for f in kind.find(context.flight, context)
                 if f.stream in streams and kind.left_s is not None and kind.left_s(f) > least_s)
