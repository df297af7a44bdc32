"""Poses on their way: from the motion capture to who tracks them, to the recorder, and to the vehicle."""

from collections.abc import Callable

from ..in_time import within
from ..mocap.pose_datagram import Pose
from ..mocap.pose_source import PoseSource, seen
from ..vehicle_link import Link
from . import setpoint_packets
from .pose_gate import PoseGate
from .pose_tracker import PoseTrack

CLOSE_S = 3.0


class Feed:
    """``track`` has the poses. ``feed``: send them to the vehicle as they come, in the source's thread. ``on_pose``
    gets all, seen or not. ``gate`` withholds from both what cannot be of a flying vehicle."""

    def __init__(self, link: Link, source: PoseSource) -> None:
        self._link, self._source = link, source
        self.track, self.gate = PoseTrack(), PoseGate()
        self.feed = False
        self.on_pose: Callable[[Pose], None] | None = None

    def start(self) -> None:
        """Raises InputError when the source cannot be had."""
        self._source.start(self._pose)

    def close(self) -> None:
        """Leaves a source alone that does not end."""
        within(CLOSE_S, self._source.close, "closing the poses")

    def switch(self, on: bool) -> None:
        self.feed = on

    def sent(self, time_s: float, packet: bytes) -> None:
        """Report to the source what was sent."""
        self._source.setpoint(time_s, setpoint_packets.decoded(packet))

    def _pose(self, pose: Pose) -> None:
        fresh = seen(pose) and self.gate.admits(pose) and self.track.add(pose)
        if fresh and self.feed:
            self._link.send_pose(pose.position_m, pose.quaternion)
        if self.on_pose is not None:
            self.on_pose(pose)
