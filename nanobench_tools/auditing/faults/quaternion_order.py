"""quaternion_order: quaternions with the scalar in another place, or inverted (world to body).

Found by a vehicle that would not be upright. The mean cosine of the tilt over the first 3 s is below 0.5 as read and
above 0.9 in the other order. Real flights have 0.97-1.00. Where the heading hides that, the estimated Euler angles
decide. One order differs from them by more than 0.5 rad and the other by less than 0.25. The checks that use the
motion capture go on with the right order.

Inverted quaternions, and x, y, z, w read as w, x, y, z, are upright, too. They are found by the flight. The tilt must
correlate with the acceleration of the path, and the turning with the gyro, by 0.8 or more in the right reading. As read
it is less by 0.1 or more, in both where both are known. The gyro alone decides only if no other axes of the IMU explain
it.

The path also shows an attitude that was made from Euler angles in another order or with other signs
(``signals.euler_reading``).

Size: mean cosine of the tilt as read. Smallest found: any.
"""

from dataclasses import replace

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.euler_reading import euler_reading
from ...signals.quaternion_lengths import STREAMS
from ...signals.quaternion_reading import AS_STORED
from ...signals.quaternions import quaternion_orders
from ...signals.stream_frames import unexplained
from ...signals.tilt_heading import half_turned
from .kind import FaultKind
from .making import SINCE, over_stream

KIND = "quaternion_order"
INVERTED = replace(AS_STORED, inverted=True)


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream with another order."""
    faults = []
    for name, order in context.once(quaternion_orders).items():
        if order.reading.as_stored:
            continue
        evidence = order.evidence or (f"as x, y, z, w the mean cosine of tilt is {order.upright:.2f}, "
                                      f"as {order.reading.order} {order.fitting:.2f}")
        faults.append(
            over_stream(
                KIND,
                flight,
                name,
                STREAMS[name],
                order.upright,
                "1",
                f"the quaternions of {name} are {order.reading.meaning}: {order.reading.change}{SINCE}{evidence}",
            )
        )
    blamed = next((m for m in context.once(unexplained) if m.quantities == ("qx", "qy", "qz") and m.sign[2] < 0
                   and min(m.sign[:2]) >= 0 and m.stream == "mocap"), None)
    if blamed is not None and not any(f.stream == "mocap" for f in faults) and context.once(half_turned):
        faults.append(over_stream(KIND, flight, "mocap", STREAMS["mocap"], 1.0, "1",
                                  f"the quaternions of mocap are {INVERTED.meaning}: {INVERTED.change}{SINCE}"
                                  f"gyro and estimate turn against them about z alone "
                                  f"({blamed.correlation[2]:+.2f}), near a heading of 180 deg"))
    euler = context.once(euler_reading) if not any(f.stream == "mocap" for f in faults) else None
    if euler is not None:
        faults.append(over_stream(KIND, flight, "mocap", STREAMS["mocap"], euler.stored, "1",
                                  "the attitude of mocap was made from other Euler angles: "
                                  f"{euler.change}, or export matrices{SINCE}tilt and acceleration then "
                                  f"correlate {euler.follows:+.2f} ({euler.stored:+.2f} as stored)"))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="write this into the column map; nanobench columns FILE drafts one",
                  cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.room:QUATERNION_ORDER")
