"""quaternion_order: quaternions stored w, x, y, z where x, y, z, w belongs.

Found by a vehicle that would not be upright. The mean cosine of the tilt over the first 3 s is below 0.5 as read and
above 0.9 in the other order (real flights have 0.97-1.00). Where the heading hides that, the estimated Euler angles
decide. One order differs from them by more than 0.5 rad and the other by less than 0.25. The checks that use the
motion capture go on with the right order. A conjugate (world to body) is ``sign`` of the rates.

Size: mean cosine of the tilt as read. Smallest found: any.
"""

from __future__ import annotations

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.quaternion_lengths import STREAMS
from ...signals.quaternions import quaternion_orders
from .kind import FaultKind
from .making import over_stream

KIND = "quaternion_order"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream with another order."""
    faults = []
    for name, order in context.once(quaternion_orders).items():
        if order.name == "x, y, z, w":
            continue
        faults.append(
            over_stream(
                KIND,
                flight,
                name,
                STREAMS[name],
                order.upright,
                "1",
                f"as x, y, z, w the mean cosine of tilt is {order.upright:.2f}, as {order.name} {order.fitting:.2f}",
            )
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="quaternions of {streams} are in the order w, x, y, z",
                  advice="map the columns again: nanobench columns FILE",
                  cuts=True, cuts_trim=False, whole=True,
                  injection="nanobench_tools.practice.inject.room:QUATERNION_ORDER")
