"""spike: one sample (up to three rows, since interpolation spreads it) that sticks out and is gone again.

Found as the distance of a row from the median of the seven rows around it. A spike is farther off than the vehicle can
get in 30 ms. It also exceeds 12 times the median distance of the rows within half a second (noise of this very place).
``signals.spikes.LIMITS`` gives the first limit per quantity, from its agility: 40 m/s^2 and 300 rad/s^2. For estimates
it is the radio clock's jumps of up to 70 ms. Accelerometer, gyro, accelerations and attitude are not judged within 0.2
m of the ground from take-off on, where true shocks look the same. Positions are not judged where they turn round
there, as in a bounce. Motors, requests and setpoints may jump by right. One entry per spike.

Size: distance, in the unit of the column. Smallest found: the larger of the two limits. If larger, it is twice the
vehicle's motion from the row before to the row after. A jump that stays must not count as a spike. A row's movement
and noise are added, which may hide it. It is 2 cm for the motion capture of a resting vehicle, 6 cm at 1 m/s.
"""

import numpy as np

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.spikes import LIMITS, spikes
from .kind import FaultKind

KIND = "spike"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per spike; columns that stick out together are one spike."""
    faults = []
    for name, stream, columns, distance, least, first, last in context.once(spikes):
        limits = np.array([LIMITS[name][stream.quantities[k]] for k in columns])
        strongest = int(np.argmax(distance / limits))
        k = columns[strongest]
        t = stream.time_s
        start, end = float(t[max(first - 1, 0)]), float(t[min(last + 1, len(t) - 1)])
        names = tuple(stream.columns[c] for c in columns)
        faults.append(Fault(KIND, name, names, start, end, float(distance[strongest]), stream.unit[k],
                            f"{stream.columns[k]} is {distance[strongest]:.3g} {stream.unit[k]} off its neighbours in "
                            f"{last - first + 1} row(s) at {t[first]:.3f} s",
                            float(least[strongest])))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{count} of {streams} stick out, by {size} at most",
                  cuts=True, cuts_logs=False, injection="nanobench_tools.practice.inject.streams:SPIKE")
