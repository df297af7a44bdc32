"""The room's cameras: the true pose of the served vehicle, with noise, at their own rate and later than it was."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ..mocap.pose_datagram import pack


@dataclass(frozen=True)
class MocapOptions:
    """rate_hz; noise_m of every coordinate and noise_rad of the rotation vector, white; delay_s from the exposure until
    the pose is sent; seed. Raises InputError for what cannot be."""

    rate_hz: float = 100.0
    noise_m: float = 0.0003
    noise_rad: float = 0.002
    delay_s: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate_hz <= 500.0:
            raise InputError("motion capture", f"{self.rate_hz:g} Hz", "give 1 to 500")
        for name, highest in (("noise_m", 1.0), ("noise_rad", 1.0), ("delay_s", 10.0)):
            if not 0.0 <= getattr(self, name) <= highest:
                raise InputError("motion capture", f"{name} {getattr(self, name):g}", f"give 0 to {highest:g}")


class MotionCapture:
    """Exposures at multiples of 1 / rate_hz of the host's clock from ``start_s`` on."""

    def __init__(self, options: MocapOptions, start_s: float) -> None:
        self._options, self._rng = options, np.random.default_rng([options.seed, 3])
        self._start_s, self._count = start_s, 1
        self._waiting: deque[tuple[float, bytes]] = deque()

    @property
    def next_s(self) -> float:
        """Time of the next exposure."""
        return self._start_s + self._count / self._options.rate_hz

    def expose(self, position_m: np.ndarray, quaternion: np.ndarray) -> None:
        """Takes the pose at ``next_s``."""
        o, at, drawn = self._options, self.next_s, self._rng.standard_normal(6)
        place = position_m + o.noise_m * drawn[:3]
        turned = _turned(quaternion.tolist(), (0.5 * o.noise_rad * drawn[3:]).tolist())
        self._waiting.append((at + o.delay_s, pack(at, place, turned)))
        self._count += 1

    def skip_to(self, time_s: float) -> None:
        """No exposures before a time."""
        self._count = max(self._count, int((time_s - self._start_s) * self._options.rate_hz) + 1)

    def sent_s(self) -> float:
        """When the next datagram leaves; inf without any."""
        return self._waiting[0][0] if self._waiting else np.inf

    def due(self, time_s: float) -> list[bytes]:
        """Datagrams that have left by a time."""
        found = []
        while self._waiting and self._waiting[0][0] <= time_s:
            found.append(self._waiting.popleft()[1])
        return found


def _turned(q: list[float], half: list[float]) -> np.ndarray:
    """A quaternion turned about the body by the small angles 2 ``half`` [rad]."""
    x, y, z, w = q
    a, b, c = half
    found = np.array([x + w * a + y * c - z * b, y + w * b + z * a - x * c, z + w * c + x * b - y * a,
                      w - x * a - y * b - z * c])
    return found / math.sqrt(found @ found)
