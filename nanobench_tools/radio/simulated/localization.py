"""Positions and poses from outside, and the emergency stop (crtp_localization_service.c)."""

import math
import struct
from collections.abc import Callable, Sequence

import numpy as np

from ...firmware.kalman import ATTITUDE_SD_RAD, POSITION_SD_M
from ...firmware.stabilizer import Stabilizer
from ..crtp import Packet
from .quaternion32 import decompress

POSITION, GENERIC, POSITION_PACKED = 0, 1, 2
EMERGENCY_STOP, EMERGENCY_WATCHDOG, POSE, POSE_PACKED = 3, 4, 8, 9


class Localization:
    """Port 6. No pose is thinned out, delayed or checked, as in the firmware; NaN is dropped.

    last: newest pose, x, y, z [m], qx, qy, qz, qw, as group ``locSrv`` shows it. own_id: low byte of the address.
    """

    def __init__(self, stabilizer: Stabilizer, stop: Callable[[], None], feed: Callable[[], None]) -> None:
        self._stabilizer, self._stop, self._feed = stabilizer, stop, feed
        self.own_id, self.position_sd_m, self.attitude_sd_rad = 0xE7, POSITION_SD_M, ATTITUDE_SD_RAD
        self.last, self.count = np.zeros(7), 0

    def take(self, packet: Packet) -> None:
        """One packet; nothing is answered."""
        data = packet.data
        if packet.channel == POSITION and len(data) == 12:
            self._position(struct.unpack("<3f", data))
        elif packet.channel == POSITION_PACKED:
            for at in range(0, len(data) // 7 * 7, 7):
                own, x, y, z = struct.unpack_from("<B3h", data, at)
                if own == self.own_id:
                    self._position((x / 1000.0, y / 1000.0, z / 1000.0))
        elif packet.channel == GENERIC and data:
            self._generic(data[0], data[1:])

    def _generic(self, kind: int, data: bytes) -> None:
        if kind == EMERGENCY_STOP:
            self._stop()
        elif kind == EMERGENCY_WATCHDOG:
            self._feed()
        elif kind == POSE and len(data) == 28:
            values = struct.unpack("<7f", data)
            self._pose(values[:3], values[3:])
        elif kind == POSE_PACKED:
            for at in range(0, len(data) // 11 * 11, 11):
                own, x, y, z, q = struct.unpack_from("<B3hI", data, at)
                if own == self.own_id:
                    self._pose((x / 1000.0, y / 1000.0, z / 1000.0), decompress(q))

    def _position(self, position_m: Sequence[float]) -> None:
        if all(math.isfinite(v) for v in position_m):
            self.last[:3] = position_m
            self.count += 1
            self._stabilizer.measure(position_m, None, self.position_sd_m, self.attitude_sd_rad)

    def _pose(self, position_m: Sequence[float], quaternion: Sequence[float]) -> None:
        length = math.sqrt(sum(q * q for q in quaternion)) if all(math.isfinite(q) for q in quaternion) else 0.0
        if all(math.isfinite(v) for v in position_m) and 1e-3 < length < 1e3:
            self.last[:3], self.last[3:] = position_m, quaternion
            self.count += 1
            self._stabilizer.measure(position_m, quaternion, self.position_sd_m, self.attitude_sd_rad)
