"""body_frame: the attitude of the motion capture belongs to other axes than the vehicle's.

Found by a body with no axis up, or another one than z, from the first row on, without a fall before it. Causes are the
frame of a camera or of an inertial sensor, or markers defined while the vehicle was tilted. Positions, and changes of
the attitude, are right; the attitude itself is not that of an upright vehicle. A body with another axis up is
``frame`` where the recording has streams of the vehicle that have to be compared with it.

A body that is turned against the gyro, mostly about z, is found by their turning (``signals.turned_body``).

Size: tilt of the z axis in the first moment, or the turn, rad. Smallest found: a tilt of 30 deg, a turn of 18 deg.
"""

import math

from ...flight import Fault, Flight, poses_alone
from ...signals.context import Context
from ...signals.flown_axes import NAMES, UP
from ...signals.held_poses import ROTATION
from ...signals.pose_frame import FOREIGN_RAD, pose_frame
from ...signals.turned_body import APART_RAD, turned_body
from .kind import FaultKind
from .making import over_stream

KIND = "body_frame"


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault."""
    frame = context.once(pose_frame)
    if frame.foreign_rad:
        what = "the attitude belongs to another body frame, such as that of a hand-held camera or of a sensor"
        return [over_stream(KIND, context.flight, "mocap", ROTATION, frame.foreign_rad, "rad",
                            f"{what}: {frame.evidence}", FOREIGN_RAD)]
    if frame.world == UP and frame.body not in (None, UP) and poses_alone(context.flight):
        what = f"the attitude belongs to a body frame with {NAMES[frame.body]} up"
        if frame.body == (2, -1):
            what += ", or z of its world points down: the motion is too slow to show which"
        return [over_stream(KIND, context.flight, "mocap", ROTATION, math.pi if frame.body[0] == 2 else math.pi / 2,
                            "rad", f"{what}: {frame.evidence}", FOREIGN_RAD)]
    turned = context.once(turned_body)
    if turned is not None:
        return [over_stream(KIND, context.flight, "mocap", ROTATION, turned.angle_rad, "rad",
                            f"the tracked body is turned by {turned.words} against the gyro (correlation "
                            f"{turned.follows:+.2f} after that turn, {turned.straight:+.2f} without)", APART_RAD)]
    return []


FAULT = FaultKind(KIND, find, __doc__,
                  told="the attitude belongs to another body frame than the vehicle's (turned by {degrees})",
                  advice="turn the quaternions into the vehicle's axes before attitudes are compared; positions are "
                         "right unless z of the world points down")
