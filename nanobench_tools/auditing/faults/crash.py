"""crash: the vehicle fell, tumbled or lay on its side.

Found in the motion capture (else the estimate). Either the body z axis is more than 60 deg from vertical for 0.1 s.
The largest tilt in controlled flight of 79 real ones is 38 deg. Or there is a steady fall faster than 3 m/s (the
hardest real landings hit at 2.1). The span runs from the moment the motors stopped, at the earliest one second before,
to the end of the recording. After a crash the vehicle is another one, so no other check uses these rows.

Size: the largest tilt afterwards, rad. Smallest found: 60 deg, or 3 m/s.
"""

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.crashes import TILT_RAD, crash_of
from ...signals.usable_rows import whole_span
from .kind import FaultKind

KIND = "crash"


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault."""
    crash = context.once(crash_of)
    if crash is None:
        return []
    end = context.once(whole_span).end_s
    return [Fault(KIND, "", (), crash.start_s, end, crash.size, "rad", crash.evidence, float(TILT_RAD))]


FAULT = FaultKind(KIND, find, __doc__,
                  told="a crash or a hard fall at {at}",
                  group="flight", cuts=True, cuts_logs=False, injection="nanobench_tools.practice.inject.whole:CRASH")
