"""no_common_time: streams whose times do not overlap, so that nothing of one can be compared with the other.

Found by the first and last timestamp of each stream, against the motion capture (else the first of IMU, estimate,
attitude and motors). If the time between two streams exceeds the duration of either, their clocks have different
origins. Examples are time since boot and Unix time, or a date that was never set. The recording cannot be used until
one is moved. A stream that ended before the other began is unfit alone, unless it is one of sensors, estimates or
motors.

Size: seconds between the streams. Smallest found: any without a common moment.
"""

from ...flight import Fault, Flight
from ...signals.common_time import JUDGES, apart, told
from ...signals.context import Context
from ...signals.usable_rows import whole_span
from .kind import FaultKind
from .making import over_stream

KIND = "no_common_time"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream; of the whole recording where clocks differ."""
    faults = []
    for found in apart(context.flight):
        evidence = told(found, flight.epoch_s)
        if found.clocks_differ or found.stream in JUDGES:
            span = context.once(whole_span)
            faults.append(Fault(KIND, "", (found.stream, found.other), span.start_s, span.end_s, found.gap_s, "s",
                                evidence, 0.0))
        else:
            faults.append(over_stream(KIND, context.flight, found.stream, None, found.gap_s, "s", evidence, 0.0))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="put both on one clock: convert LOG --mocap FILE pairs two recordings, or map a time column "
                         "that both share",
                  group="clock", cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.clock_faults:NO_COMMON_TIME")
