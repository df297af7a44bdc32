"""never_flew: the vehicle never left the ground.

Found by its height: never more than 5 cm above the lowest place it stood at. Needs the motion capture or an estimated
position. Size: the highest point in m. Smallest found: any recording of a second or more.
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.airborne import HEIGHT_M, airborne_spans, height_of, resting_height_m
from ...signals.context import Context
from ...signals.pose_frame import pose_frame
from ...signals.usable_rows import whole_span
from .kind import FaultKind

KIND = "never_flew"


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault."""
    height = context.once(height_of)
    if height is None or context.once(airborne_spans) or context.once(pose_frame).foreign_rad:
        return []
    time_s, z = height
    if time_s[-1] - time_s[0] < 1.0:
        return []
    top = float(np.max(z) - resting_height_m(z))
    motor = flight.streams.get("motor")
    ran = motor is not None and bool(np.any(np.nan_to_num(motor.values) > 0.0))
    motors = "" if motor is None else "; motors ran" if ran else "; motors never ran"
    span = context.once(whole_span)
    return [Fault(KIND, "", (), span.start_s, span.end_s, top, "m",
                  f"never more than {100 * top:.1f} cm above the ground{motors}", HEIGHT_M)]


FAULT = FaultKind(KIND, find, __doc__,
                  told="the vehicle never left the ground",
                  group="flight", whole=True, injection="nanobench_tools.practice.inject.whole:NEVER_FLEW")
