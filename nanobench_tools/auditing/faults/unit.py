"""unit: a stream has the wrong unit (deg for rad, g for m/s^2, mV for V, mm for m, counts for ratio).

Found in three ways. Size alone: the time between rows, specific force against gravity, battery against the voltage of
cells, motor commands and rotor speeds against those of flights. Also commands below zero, angles beyond two turns, and
a tracked position wider than a room. Path and tilt: lengths or times in another unit make a path accelerate by
another factor than its tilt (``signals.path_sizes``). Comparison:
the amplitude of rates, angles, velocities and positions in the air against the motion capture
(``signals.axis_unit_matching``). It needs a correlation of the two of more than 0.4. Without motion capture the
accelerometer judges the gyro (``signals.tumbling``). When estimator and setpoint are
both off by the same factor, the motion capture is.

Size: the factor. Smallest found: 3 (or 1/3); true ones are 0.4-1.3 in the real flights (motion capture noise, clock),
the smallest common mistake is 9.81. Not found: scale errors of calibration.
"""

from ...flight import Fault, Flight
from ...signals.attitude_signs import angle_matches
from ...signals.context import Context
from ...signals.motor_turning import motor_turning
from ...signals.own_reference import contradictions
from ...signals.own_turning import own_turning
from ...signals.plausible_ranges import FACTOR
from ...signals.stream_frames import IMU
from ...signals.tumbling import tumbling
from ...signals.unit_sign_errors import wrong_units
from ...signals.usable_rows import whole_span
from .kind import FaultKind
from .making import over_stream

KIND = "unit"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per group of columns; the time belongs to no stream."""
    faults = []
    for wrong in context.once(wrong_units):
        if wrong.stream:
            faults.append(
                over_stream(KIND, flight, wrong.stream, wrong.quantities, wrong.factor, "1", wrong.evidence, FACTOR)
            )
        else:
            span = context.once(whole_span)
            faults.append(
                Fault(KIND, "", wrong.quantities, span.start_s, span.end_s, wrong.factor, "1", wrong.evidence, FACTOR)
            )
    for c in context.once(contradictions):
        if c.kind == KIND and not any(set(c.quantities) & set(wrong.quantities) for wrong in context.once(wrong_units)):
            faults.append(over_stream(KIND, flight, c.stream, c.quantities, c.factor, "1", c.evidence, FACTOR))
    reported = {column for fault in faults for column in fault.columns}
    own = context.once(own_turning)
    by_attitude = [("imu", IMU[0][axis], "the estimated attitude", named) for axis, named in own.scaled] if own else []
    by_attitude += [("attitude", m.angle, m.gyro, m.scaled) for m in context.once(angle_matches)
                    if m.scaled and "attitude" in flight and m.gyro not in {gyro for _, gyro, *_ in by_attitude}]
    for stream, quantity, other, named in by_attitude if "t" not in reported else ():
        fault = over_stream(KIND, flight, stream, (quantity,), named.factor, "1",
                            f"{quantity} of {stream} turns {named.words} times as fast as {other}{named.reading}; one "
                            "of them is in another unit", FACTOR)
        faults += [fault] if not reported & set(fault.columns) else []
    turned = context.once(tumbling)
    if turned is not None and not {f.stream for f in faults} & {"", "imu"}:
        turns = "turn over" if turned.factor > 1.0 else "hardly turn"
        faults.append(over_stream(KIND, flight, "imu", IMU[0], turned.factor, "1",
                                  f"by the gyro the vehicle would {turns}, and by the specific force it flies"
                                  f"{turned.reading}", FACTOR))
    pushed = context.once(motor_turning)
    if pushed is not None and pushed.scaled is not None and not any(f.stream == "imu" for f in faults):
        faults.append(over_stream(KIND, flight, "imu", IMU[0][:2], pushed.scaled.factor, "1",
                                  f"the motors turn gyro_x {pushed.scaled.words} times as fast as gyro_y"
                                  f"{pushed.scaled.reading}; one of them is in another unit", FACTOR))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="{columns} {is} in another unit, by a factor of {factor}",
                  advice="give the unit in a column map: nanobench columns FILE",
                  cuts=True, cuts_trim=False, whole=True, injection="nanobench_tools.practice.inject.streams:UNIT")
