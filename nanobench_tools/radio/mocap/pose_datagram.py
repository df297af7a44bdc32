"""One pose of simulated motion capture as a UDP datagram.

Send any datagram to the address to get poses for the next ``SUBSCRIPTION_S``. By default the address is the vehicle's
port + ``PORT_OFFSET``. Sending again in time keeps them coming.
"""

import struct
from typing import NamedTuple

import numpy as np

from ...errors import InputError

PORT_OFFSET = 100
SUBSCRIPTION_S = 2.0
HELLO = b"nanobench"
"""What a subscriber may send; any other datagram will do."""
_FORMAT = struct.Struct("<d7f")
SIZE = _FORMAT.size


class Pose(NamedTuple):
    """time_s: Unix time of the exposure on the host's clock. position_m (3,) world, z up; quaternion (4,) x, y, z, w,
    body (FLU) to world."""

    time_s: float
    position_m: np.ndarray
    quaternion: np.ndarray


def pack(time_s: float, position_m: np.ndarray, quaternion: np.ndarray) -> bytes:
    """36 bytes, little endian: float64 time, float32 x, y, z, qx, qy, qz, qw."""
    return _FORMAT.pack(time_s, *position_m, *quaternion)


def unpack(datagram: bytes) -> Pose:
    """The pose in a datagram; InputError for one of another length."""
    if len(datagram) != SIZE:
        raise InputError("pose datagram", f"{len(datagram)} bytes", f"a pose has {SIZE}")
    time_s, *numbers = _FORMAT.unpack(datagram)
    return Pose(time_s, np.array(numbers[:3]), np.array(numbers[3:]))
