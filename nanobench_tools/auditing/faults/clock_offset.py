"""clock_offset: the stamps of a stream are late (positive) or early by a constant against the motion capture.

Found where the 95 % interval of the offset (``constant.readings``) excludes zero by more than 5 ms. The gyro shows the
clock of the vehicle's link. An estimator's stream that follows it by -15 to 50 ms shares it (that much may be the
estimate's own delay). Its timestamps are reported as wrong separately only beyond that. Motors, requests, setpoints
and battery are not seen by cameras and never get this fault, although they share the link. The interval widens when
the clock wanders.

Size: the offset in s. Smallest found: 5 ms and 2.5 half intervals; for an estimator's stream alone 50 ms more.
"""

from ...flight import Fault, Flight
from ...settings import number
from ...signals.context import Context
from ...time_offsets.constant.drift_and_wander import OWN_LAG_S
from ...time_offsets.constant.readings import read_clocks
from .kind import FaultKind
from .making import over_stream

KIND = "clock_offset"

SMALLEST_S = number("audit.clock_offset.smallest_s")
HALVES = number("audit.clock_offset.halves")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream."""
    faults = []
    for name, reading in context.once(read_clocks).items():
        if not reading.identifiable or reading.ci95_s is None:
            continue
        low, high = reading.ci95_s
        if low <= SMALLEST_S and high >= -SMALLEST_S:
            continue
        own = not reading.reason.startswith("clock of the gyro") and name != "imu"
        half = 0.5 * (high - low - (OWN_LAG_S[1] - OWN_LAG_S[0] if own else 0.0))
        late = "late" if reading.offset_s > 0.0 else "early"
        evidence = (
            f"timestamps of {name} are {1e3 * abs(reading.offset_s):.1f} ms {late} (95 % interval {1e3 * low:.1f} to "
            f"{1e3 * high:.1f} ms); {reading.reason}"
        )
        faults.append(over_stream(KIND, flight, name, None, reading.offset_s, "s", evidence,
                                  SMALLEST_S + HALVES * half + (OWN_LAG_S[1] if own else 0.0)))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="timestamps of {streams} are {lateness}",
                  advice="try --clock retimed",
                  group="clock", corrected=True, left_s=lambda fault: abs(fault.size), whole=True,
                  injection="nanobench_tools.practice.inject.clock_faults:CLOCK_OFFSET")
