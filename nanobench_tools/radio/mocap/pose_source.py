"""What a source of poses has to be while flying; ``mocap_sources`` knows those there are.

A source calls ``sink(pose)`` from a separate thread for every pose it sees, as soon as it sees it. Poses are metres in
a world with z up, quaternions x, y, z, w from the body (x forward, y left, z up) into it. The checklist refuses other
frames.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...errors import InputError
from .pose_datagram import Pose

Sink = Callable[[Pose], None]


class PoseSource(Protocol):
    """``synthetic``: the poses are made up, and so is what is recorded. ``setpoint``: receives everything that is sent
    to the vehicle, to pass it on. Arguments: time [Unix s], and the set-point in words of ``setpoint_packets``."""

    name: str
    synthetic: bool

    def start(self, sink: Sink) -> None: ...

    def setpoint(self, time_s: float, command: dict[str, object]) -> None: ...

    def close(self) -> None: ...


def checked(name: str, time_s: float, position_m: object, quaternion: object) -> Pose:
    """A Pose from the output of a source. Raises InputError for wrong shapes; NaN is kept and means not seen."""
    try:
        time = float(time_s)
        position, turn = np.asarray(position_m, float), np.asarray(quaternion, float)
    except (TypeError, ValueError):
        raise InputError(f"--mocap {name}", "a pose that is no numbers", "give time_s, (x, y, z), (qx, qy, qz, qw)") \
            from None
    if position.shape != (3,) or turn.shape != (4,):
        raise InputError(f"--mocap {name}", f"a pose of shapes {position.shape} and {turn.shape}",
                         "give (x, y, z) and (qx, qy, qz, qw)")
    return Pose(time, position, turn)


def seen(pose: Pose) -> bool:
    """Whether the body was seen: all numbers finite and the quaternion one."""
    turn = pose.quaternion
    return bool(np.isfinite(pose.position_m).all() and np.isfinite(turn).all() and 0.5 < turn @ turn < 2.0)
