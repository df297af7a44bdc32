"""clock_drift: the stamps of a stream gain or lose against the motion capture, at one rate over the whole flight.

Found as the slope of the time error over the flight (``drift_and_wander``). It uses half-second lags of gyro and
attitude, and the estimated position along its path. The slope must exceed what the scatter around the line explains
(chance below 1e-6), and 4 ms over the flight. A clock that wanders scatters, so its slope counts only if it exceeds
the scatter.

Size: s per s. Smallest found: stated per stream, 4-15 ms over a flight with a quiet clock.
"""

from ...flight import Fault, Flight
from ...signals.context import Context
from ...time_offsets.constant.drift_and_wander import moving_clocks
from .kind import FaultKind
from .making import over_stream

KIND = "clock_drift"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream."""
    return [over_stream(KIND, flight, name, None, clock.slope, "s/s", clock.drift_evidence,
                        clock.detectable_drift_s / clock.span_s)
            for name, clock in context.once(moving_clocks).items()
            if clock.drifts]


def _left_s(fault: Fault) -> float:
    """The largest time error: the stamps of a drift are least wrong in the middle."""
    return abs(fault.size) * 0.5 * (fault.end_s - fault.start_s)


FAULT = FaultKind(KIND, find, __doc__,
                  told="the clock of {streams} gains or loses against the motion capture ({size})",
                  advice="try --clock retimed",
                  group="clock", corrected=True, left_s=_left_s, whole=True,
                  injection="nanobench_tools.practice.inject.clock_faults:CLOCK_DRIFT")
