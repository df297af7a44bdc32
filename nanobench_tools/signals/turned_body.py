"""The tracked body against the gyro: markers defined while the vehicle pointed elsewhere turn it by any angle.

The rotation that takes the turning of the tracked body to that of the gyro is the polar factor of their covariance
(Kabsch 1976). Flights along circles fit a delay as well as a turn, so the turn has to explain more than every delay.
Quarter and half turns are ``frame``.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..settings import number
from .context import Context
from .held_poses import ROTATION
from .pairs import gyro_pair, sums_of
from .pose_frame import pose_frame
from .shared_frame import shared_frame
from .stream_frames import stream_turns
from .wrong_matches import wrong_matches

APART_RAD = number("audit.turned_body.apart_rad")
BETTER = number("audit.turned_body.better")
FOLLOWS = number("audit.turned_body.follows")


@dataclass(frozen=True)
class TurnedBody:
    """``angle_rad`` about the unit vector ``axis`` (3,) from the tracked body to the gyro; ``follows``: correlation of
    both after that turn, and ``straight`` without it."""

    angle_rad: float
    axis: np.ndarray
    follows: float
    straight: float

    @property
    def words(self) -> str:
        """``45 deg about z``."""
        main = int(np.argmax(np.abs(self.axis)))
        name = "xyz"[main] if abs(self.axis[main]) > 0.9 else f"({', '.join(f'{a:.1f}' for a in self.axis)})"
        lone = len(name) == 1 and bool(self.axis[main] < 0.0)
        return f"{'-' * lone}{np.degrees(self.angle_rad):.0f} deg about {name}"


def turned_body(context: Context) -> TurnedBody | None:
    """None where they agree, without both, and in recordings whose gyro or poses are in other axes, signs or units."""
    sums, frame = sums_of(context, gyro_pair), context.once(pose_frame)
    if sums is None or frame.turned or frame.body is None or any(t.stream == "imu" for t in context.once(stream_turns)):
        return None
    if context.once(shared_frame) is not None or any(
            match.stream == "imu" or set(ROTATION) & set(match.quantities) for match in context.once(wrong_matches)):
        return None
    cross, measured, reference = (v.sum(axis=0) for v in (sums.cross, sums.measured, sums.reference))
    size = np.sqrt(np.trace(measured) * np.trace(reference, axis1=1, axis2=2))
    left, values, right = np.linalg.svd(cross)
    proper = np.sign(np.linalg.det(left @ right))
    turned = (values[:, 0] + values[:, 1] + proper * values[:, 2]) / size
    at, straight = int(np.argmax(turned)), float((np.trace(cross, axis1=1, axis2=2) / size).max())
    turn = left[at] @ np.diag([1.0, 1.0, proper[at]]) @ right[at]
    vector = Rotation.from_matrix(turn).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle < APART_RAD or turned[at] < FOLLOWS or turned[at] < BETTER * straight:
        return None
    return TurnedBody(angle, vector / angle, float(turned[at]), straight)
