"""Poses that cannot be of a flying vehicle: repeated ones and jumps. They reach neither vehicle nor controller.

A tracker that froze sends the last pose again with new timestamps. A vehicle's filter that takes such poses estimates
that it has stopped. Without them it goes on by its IMU, and still knows its speed when the flight is handed over.
"""

from dataclasses import dataclass

import numpy as np

from ... import so3
from ...settings import number
from ..mocap.pose_datagram import Pose

FROZEN_S = number("flying.pose_gate.frozen_s")
JUMP_M = number("flying.pose_gate.jump_m")
JUMP_DEG = number("flying.pose_gate.jump_deg")
MOST_M_S2 = number("flying.pose_gate.most_m_s2")
SAME = "the same pose"
FEWEST = 3
"""Poses: one after a gap is not enough."""
AIR_M = 0.1
"""Above the ground. A vehicle at rest may repeat its pose, and may be carried before the flight."""


@dataclass
class PoseGate:
    """``ground_m``: height of a vehicle on the ground, None before the flight (all poses pass). ``why``: reason to end
    the flight, "" while poses are plausible."""

    ground_m: float | None = None
    why: str = ""
    _last: Pose | None = None
    _jumped: Pose | None = None
    _speed_m_s: np.ndarray | None = None
    _doubts: int = 0

    def admits(self, pose: Pose) -> bool:
        """Whether a pose that was seen may be used. Once there is a reason, no pose is."""
        if self.ground_m is None:
            return True
        if self.why or (self._last is not None and pose.time_s <= self._last.time_s):
            return False
        last = self._last
        doubt = "" if last is None or last.position_m[2] < self.ground_m + AIR_M else self._doubt(last, pose)
        if doubt:
            self._doubts += 1
            self._jumped = None if doubt == SAME else pose
            if last is not None and pose.time_s - last.time_s >= FROZEN_S and self._doubts >= FEWEST:
                self.why = f"{doubt} for {pose.time_s - last.time_s:.2f} s with new timestamps"
            return False
        if last is not None:
            self._speed_m_s = (pose.position_m - last.position_m) / (pose.time_s - last.time_s)
        self._last, self._jumped, self._doubts = pose, None, 0
        return True

    def _doubt(self, last: Pose, pose: Pose) -> str:
        if np.array_equal(last.position_m, pose.position_m) and np.array_equal(last.quaternion, pose.quaternion):
            return SAME
        since = pose.time_s - last.time_s
        speed = np.zeros(3) if self._speed_m_s is None else self._speed_m_s
        off = float(np.linalg.norm(pose.position_m - last.position_m - speed * since))
        if off > JUMP_M + 0.5 * MOST_M_S2 * since**2:
            return f"poses {off:.2f} m from where the vehicle can be"
        turned = float(np.degrees(so3.geodesic_angle(last.quaternion, pose.quaternion)))
        if turned > JUMP_DEG * max(1.0, 100.0 * since):
            return f"poses turned by {turned:.0f} deg at once"
        return "poses that continue impossible ones" if self._continues(pose) else ""

    def _continues(self, pose: Pose) -> bool:
        """Whether it is near the last pose that jumped. The path of a mirrored vehicle may cross the true one."""
        jumped = self._jumped
        return (jumped is not None and float(np.linalg.norm(pose.position_m - jumped.position_m)) < JUMP_M
                and float(np.degrees(so3.geodesic_angle(jumped.quaternion, pose.quaternion))) < JUMP_DEG)
