"""constant_offset: a velocity, the tilt of the estimated attitude, or an accelerometer is off by a constant.

Found on the mean of the flight (``signals.constant_offsets``). The mean velocity is the way over the time. The mean
specific force is known by the accelerations of the path, and by gravity at rest. A tilt that the accelerometer feels
too is no offset: the vehicle leans into a wind. The path is that of the motion capture, else that of the estimate. An
offset of the gyro is ``gyro_bias``. A recording with columns in other axes, signs or units has to be mended first.

Size: the offset of the worst axis. Smallest found: 0.3 m/s, 0.1 rad, 0.3 m/s^2 by gravity at rest, else 0.8 m/s^2.
Real flights have up to 0.15 m/s, 0.04 rad, 0.16 m/s^2 at rest and 0.63 m/s^2 in flight.
"""

from ...flight import Fault, Flight
from ...signals.constant_offsets import constant_offsets
from ...signals.context import Context
from . import axis_swap, frame, sign, unit
from .kind import FaultKind
from .making import SINCE, over_stream

KIND = "constant_offset"
JUDGED = {"mocap", "estimator", "attitude", "attitude_qw", "imu"}


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per vector that is off."""
    if any(fault.stream in JUDGED for kind in (unit, sign, axis_swap, frame) for fault in kind.find(flight, context)):
        return []
    faults: list[Fault] = []
    for found in context.once(constant_offsets):
        if found.wrong and not any(f.stream == found.stream for f in faults):
            names = [found.quantities[i] for i in found.wrong]
            worst = max((float(found.offset[i]) for i in found.wrong), key=abs)
            read = ", ".join(f"{found.quantities[i]} {found.offset[i]:+.2f}" for i in found.wrong)
            faults.append(over_stream(KIND, flight, found.stream, names, worst, found.unit,
                                      f"{found.stream} has a constant offset ({read} {found.unit}){SINCE}that is its "
                                      f"mean beyond {found.by}", found.limit))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="write the offset with the other sign into a column map: nanobench columns FILE",
                  cuts=True, cuts_trim=False, whole=True)
