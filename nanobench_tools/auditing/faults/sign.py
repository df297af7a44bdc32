"""sign: a column is negated.

Found by its correlation with the motion capture's prediction in the air (gyro, specific force, attitude rates,
estimated position, velocity and acceleration, requested attitude, setpoint). The correlation is taken at the lag that
fits the whole stream best. It is below -0.4 with one sign in the seconds of the flight (t > 4). It must also be
clearly better than any lag without a change of sign. The accelerometer's z is judged by gravity. True correlations of
real flights are +0.2 to +1.0. When gyro and estimated attitude are both negated, the motion capture is.

A negated axis of the tracked position makes its path the mirror image of that of the tilt. The correlation of the
mirror image is above 0.8, and 0.3 above that of any turn. If the gyro turns against the attitude, too, a
part of the quaternion is negated. A height that only falls, of a vehicle that tilts as one with z up, is negated.

Without motion capture the estimated angles are compared with the gyro. Where gyro and attitude contradict each other,
other streams show which is wrong (``signals.turning_doubt``). If none does, both are listed. Estimated
velocity, acceleration and set-point are compared with the estimated position, and that with the tilt of the estimated
attitude (``signals.own_reference``). A tracked path without an attitude judges the estimated angles by their tilt
(``signals.tracked_tilt``).

Size: the correlation's sign, -1. Smallest found: any axis that moves enough for a correlation of 0.4. Other axes (yaw
in flights that hold their heading, a world axis not flown along) are not judged.
"""

from ...flight import Fault, Flight, motors_of
from ...signals.attitude_signs import contradicted_angles
from ...signals.axis_unit_matching import CLEAR, axis_unit_matches
from ...signals.context import Context
from ...signals.estimated_turning import EULER, estimated_attitude
from ...signals.motor_turning import other_order
from ...signals.own_reference import contradictions
from ...signals.pairs import gyro_pair, sums_of
from ...signals.shared_frame import turns_as
from ...signals.stream_frames import IMU, unexplained, unexplained_gravity
from ...signals.tilt_heading import half_turned, mirrored, other_height
from ...signals.tracked_tilt import tracked_tilt
from ...signals.unit_sign_errors import ACC, against
from ...signals.usable_rows import usable_streams
from ...units import GRAVITY_M_S2
from .kind import FaultKind
from .making import OR, over_stream

KIND = "sign"


def wrong_signs(context: Context) -> list[tuple[str, str, str]]:
    """(stream, quantity, evidence) of every negated axis."""
    found = []
    gravity = context.once(unexplained_gravity)
    if gravity is not None and gravity.sign < 0:
        found.append(("imu", ACC[gravity.axis],
                      f"the mean specific force along {ACC[gravity.axis]} is {gravity.mean[gravity.axis]:.2f} "
                      f"m/s^2, a vehicle on its feet has +{GRAVITY_M_S2}" + _or_frd(context, gravity.axis)))
    found += (poses := _poses(context))
    for verdict in context.once(unexplained):
        if any(q[:1] == "q" for _, q, _ in poses) and "gyro_x" in verdict.quantities:
            continue  # it agrees once the attitude is mended
        for quantity, sign, k in zip(verdict.quantities, verdict.sign, verdict.correlation, strict=True):
            if quantity == "qz" and min(verdict.sign[:2]) >= 0 and context.once(half_turned):
                continue  # ``quaternion_order``: inverted
            if sign < 0 and (verdict.stream, quantity) not in {(s, q) for s, q, _ in found}:
                found.append((verdict.stream, quantity,
                              f"{quantity} of {verdict.stream} correlates {k:+.2f} with what the "
                              f"{against(verdict)} predicts" + _or_inverted(context, quantity)))
    found += [(c.stream, c.quantities[0], c.evidence) for c in context.once(contradictions) if c.kind == KIND]
    for name in ("motor", "motor_request", "rpm"):
        motor = context.once(usable_streams).get(name)
        found += [] if motor is None or not len(motor) else [
            (name, q, f"{q} of {name} is below 0 in most rows, above it in none, and "
             + ("a speed has no sign" if name == "rpm" else "a command is 0 to 1"))
            for q in motors_of(motor) if (motor[q] < 0.0).mean() > 0.5 and not (motor[q] > 0.0).any()]
    other = context.once(other_order)
    if other is not None and other[1] and other[0].gyro is not None and other[0].gyro[0] == (0, 1):
        found += [("imu", IMU[0][axis], f"{IMU[0][axis]} turns against what the motors push (correlation "
                                        f"{-other[0].follows[axis]:+.2f}); or the motors are in another order")
                  for axis, turned in enumerate(other[0].gyro[1]) if turned < 0]
    angles = context.once(contradicted_angles)
    if angles and not ("attitude" in context.flight and all(q in context.flight["attitude"] for q in EULER)):
        shown = ", ".join(f"{angle} against {gyro} ({k:+.2f})" for angle, gyro, k in angles)
        found.append(("attitude_qw", "qx" if angles[0][0] == "roll" else "qy" if angles[0][0] == "pitch" else "qz",
                      f"the estimated attitude turns {shown}: the quaternions are inverted (change the sign of qx, qy, "
                      f"qz){OR}these rates are negated"))
        angles = []
    for angle, gyro, k in angles:
        found.append(("attitude", angle,
                      f"{angle} of attitude turns against {gyro} (correlation {k:+.2f}): it is negated{OR}{gyro} is"
                      + ", and angles of pitch are positive nose down" * (angle == "pitch")))
    tilt = context.once(tracked_tilt)
    if tilt is not None and not angles:
        words = (f"the path mirrors the estimated tilt ({tilt.stored:+.2f}); with {' and '.join(tilt.angles)} negated "
                 f"it follows ({tilt.follows:+.2f})")
        found += [("attitude", angle, words) for angle in tilt.angles]
        found += [("imu", gyro, f"{words}; {gyro} turns with it") for gyro in tilt.gyro]
    return found


def _or_inverted(context: Context, quantity: str) -> str:
    """At a heading of half a turn, inverted quaternions only turn against the gyro about z."""
    return ("; or the quaternions are inverted, which the tilt does not show at a heading near 180 deg"
            if quantity in ("gyro_z", "wz") and context.once(half_turned) else "")


def _poses(context: Context) -> list[tuple[str, str, str]]:
    """A negated axis of the motion capture that its own tilt shows."""
    if context.once(other_height) == (2, -1):
        return [("mocap", "pz", "pz goes below the place where the vehicle rested, and it tilts as one with z up")]
    mirror = context.once(mirrored)
    if mirror is None or mirror.swapped:
        return []
    (position,) = mirror.quantities
    about, turning = ("qx", 0) if position == "py" else ("qy", 1)
    gyro = context.once(axis_unit_matches).get(gyro_pair)
    against_gyro = gyro is not None and gyro.sign[turning] < 0 and not gyro.swapped
    quantity = about if against_gyro else position
    return [("mocap", quantity, f"along {position} the vehicle speeds up against its tilt"
             + (", and the gyro turns against the attitude" if against_gyro else "")
             + f"; with {quantity} negated they correlate {mirror.follows:+.2f}")]


def _or_frd(context: Context, axis: int) -> str:
    """If the axes of the gyro are unknown, gravity alone cannot separate one negated column from a turned sensor."""
    if axis != 2 or "gyro_x" not in context.flight["imu"]:
        return ""
    if sums_of(context, gyro_pair) is not None:
        return "; if the sensor gives gravity and not the specific force, acc_x and acc_y are negated, too"
    attitude, imu = estimated_attitude(context), context.once(usable_streams).get("imu")
    if attitude is not None and imu is not None and all(q in imu for q in IMU[0]) and turns_as(imu, attitude):
        return '; if y points right, too, imu and attitude are in FRD axes: write frame = "NED/FRD" into both'
    return '; if y points right, too, the whole sensor is in FRD axes: write frame = "FRD"'


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per negated column."""
    return [over_stream(KIND, flight, name, (quantity,), -1.0, "1", evidence, CLEAR) for name, quantity,
            evidence in wrong_signs(context)]


FAULT = FaultKind(KIND, find, __doc__,
                  told="{columns} of {streams} {is} negated",
                  advice="turn the sign in a column map: nanobench columns FILE",
                  cuts=True, cuts_trim=False, whole=True, injection="nanobench_tools.practice.inject.streams:SIGN")
