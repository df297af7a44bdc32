"""axis_swap: columns of a vector have changed places.

Found by the correlations of all axes of a stream with all axes of the motion capture's prediction (as in ``sign``).
Another order of axes must raise their sum by 0.5. Every axis that moved must correlate by more than 0.4 with its new
partner and with one sign over the seconds of the flight. Gravity that lies along x or y gives the accelerometer's
away. A path whose mirror image follows the tilt gives away that of the tracked x and y. So does another axis than z
that rises in flight, of a vehicle that tilts as one with z up. The turning that four motors cause gives away motors in
another order, and a gyro that no attitude judges. A velocity that is not the rate of its position is of
another column, as is a gyro that turns otherwise than the attitude. Axes that turned as a whole are ``frame``.

Size: nan. Smallest found: axes that both move enough for a correlation of 0.4.
"""

import math

from ...flight import Fault, Flight
from ...signals.attitude_signs import unrelated_turning
from ...signals.context import Context
from ...signals.held_poses import POSITION
from ...signals.motor_turning import MOTORS, judged_gyro, other_order
from ...signals.own_reference import contradictions
from ...signals.own_turning import own_turning
from ...signals.path_velocity import unrelated_velocities
from ...signals.stream_frames import unexplained, unexplained_gravity
from ...signals.tilt_heading import mirrored, other_height
from ...signals.unit_sign_errors import ACC, wrong_units
from .kind import FaultKind
from .making import OR, over_stream
from .sign import wrong_signs

KIND = "axis_swap"
GYRO = ("gyro_x", "gyro_y", "gyro_z")


def wrong_axes(context: Context) -> list[tuple[str, tuple[str, ...], str]]:
    """(stream, quantities that changed places, evidence)."""
    found = []
    for verdict in context.once(unexplained):
        if verdict.swapped:
            moved = tuple(verdict.quantities[i] for i in range(3) if verdict.order[i] != i)
            seen = ", ".join(
                f"{verdict.quantities[i]} looks like axis {'xyz'[verdict.order[i]]} ({verdict.correlation[i]:+.2f})"
                for i in range(3)
                if verdict.order[i] != i
            )
            found.append((verdict.stream, moved, seen))
    found += [(c.stream, c.quantities, c.evidence) for c in context.once(contradictions) if c.kind == KIND]
    own = context.once(own_turning)
    if own is not None and own.order != (0, 1, 2):
        places = [i for i in range(3) if own.order[i] != i]
        seen = ", ".join(f"{GYRO[i]} turns as {'xyz'[own.order[i]]} of the estimated attitude "
                         f"({own.follows[i, own.order[i]]:+.2f})" for i in places)
        found.append(("imu", tuple(GYRO[i] for i in places), seen))
    found += [("imu", (gyro,), f"{gyro} turns otherwise than {angle} ({follows:+.2f}): it is another column{OR}{angle} "
               "is")
              for angle, gyro, follows in context.once(unrelated_turning)]
    found += [wrong for wrong in context.once(unrelated_velocities) if wrong[0] not in {s for s, *_ in found} | {
        s for s, q, _ in context.once(wrong_signs) if "q" not in q} | {w.stream for w in context.once(wrong_units)} | {
        c.stream for c in context.once(contradictions)}]
    found += _by_motors(context)
    mirror = context.once(mirrored)
    if mirror is not None and mirror.swapped and not any(stream == "mocap" for stream, *_ in found):
        found.append(("mocap", mirror.quantities, "the vehicle speeds up along each as it tilts along the other "
                                                  f"({mirror.follows:+.2f})"))
    height = context.once(other_height)
    if height is not None and height[0] != 2:
        rises = POSITION[height[0]]
        found.append(("mocap", (rises, "pz"), f"{rises} rises above the place where the vehicle rested, pz does not, "
                                              "and the vehicle tilts as one with z up"))
    gravity = context.once(unexplained_gravity)
    if (
        gravity is not None
        and gravity.axis != 2
        and not any(s == "imu" and ACC[gravity.axis] in q for s, q, _ in found)
    ):
        found.append(("imu", (ACC[gravity.axis], "acc_z"),
                      f"gravity lies along {ACC[gravity.axis]} ({gravity.mean[gravity.axis]:.2f} m/s^2)"))
    return found


def _by_motors(context: Context) -> list[tuple[str, tuple[str, ...], str]]:
    """Axes of the gyro, or motors, that changed places by the turning that the motors cause."""
    other = context.once(other_order)
    if other is None:
        return []
    turning, by_gyro = other
    if by_gyro and turning.gyro is not None:
        return [("imu", GYRO[:2], "gyro_x turns as the motors push about y, and gyro_y as they push about x "
                                  f"({turning.follows.min():+.2f}); or the motors are in another order")
                ] if turning.gyro[0] == (1, 0) else []
    moved = [i for i in range(4) if turning.motors[i] != i]
    pushes = ", ".join(f"{MOTORS[i]} turns the vehicle as {MOTORS[turning.motors[i]]} does" for i in moved)
    return [("motor", tuple(MOTORS[i] for i in moved),
             f"{pushes} (correlation {turning.follows.min():+.2f} or more in that order); m1 is front right, then "
             "clockwise" + "; or axes of the gyro changed places" * (judged_gyro(context) is None))]


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream and vector."""
    return [over_stream(KIND, flight, name, quantities, math.nan, "1", evidence) for name, quantities,
            evidence in wrong_axes(context)]


FAULT = FaultKind(KIND, find, __doc__,
                  told="axes of {streams} changed places ({columns})",
                  advice="map the columns again: nanobench columns FILE",
                  cuts=True, cuts_trim=False, whole=True, injection="nanobench_tools.practice.inject.streams:AXIS_SWAP")
