"""A pilot turns the estimated state and the reference of a tick into one set-point.

Three kinds: the vehicle's own controllers, which get positions; controllers that make set-points themselves (method
``setpoint``, as predictive ones do); and others. The others are any controller of the project that commands motors
(``motor_commands``).
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...firmware.records import SETPOINT
from ...methods import Reference, VehicleState
from . import setpoint_packets

PERIOD_S = 0.01
PID, MELLINGER = 1, 2
"""Values of ``stabilizer.controller`` (controller.h of firmware 2025.12.1)."""


class Streams(Protocol):
    """A controller that makes set-points: records of the firmware for n vehicles, asked for every PERIOD_S."""

    name: str

    def reset(self, n: int) -> None: ...

    def setpoint(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray: ...


class Pilot(Protocol):
    """``onboard``: required value of stabilizer.controller. ``hosted``: the host follows the path, so that the
    vehicle's log does not contain the reference. ``kind`` of set-points. ``reset`` before it flies. ``link_delay``:
    called before ``reset`` with the delay until a set-point acts."""

    name: str
    kind: str
    onboard: int
    hosted: bool

    def link_delay(self, seconds: float) -> None: ...

    def reset(self) -> None: ...

    def packet(self, time_s: float, state: VehicleState, reference: Reference) -> bytes: ...


class OnboardPilot:
    """The vehicle's own controller ``onboard``, told references of ``lead_s`` later as ``kind``."""

    def __init__(self, name: str, onboard: int, kind: str = "position", lead_s: float = 0.0) -> None:
        self.name, self.onboard, self.kind, self.lead_s = name, onboard, kind, lead_s
        self.hosted = lead_s > 0.0 or kind == "velocity"

    def link_delay(self, seconds: float) -> None:
        """Streaming earlier is not for these: they fly as they were flown in the recordings."""

    def reset(self) -> None:
        """Nothing is remembered."""

    def packet(self, time_s: float, state: VehicleState, reference: Reference) -> bytes:
        if self.lead_s > 0.0 and reference.ahead is not None:
            later = reference.ahead(np.array([self.lead_s]))
            reference = Reference(later.position_m[0], later.yaw_rad[0], later.velocity_m_s[0],
                                  later.acceleration_m_s2[0], None if later.jerk_m_s3 is None else later.jerk_m_s3[0],
                                  None if later.yaw_rate_rad_s is None else later.yaw_rate_rad_s[0])
        return setpoint_packets.of_reference(self.kind, reference)


class StreamingPilot:
    """A controller with ``setpoint``; made by ``make(link delay)`` once the delay is known."""

    onboard, hosted = PID, True

    def __init__(self, name: str, kind: str, make: Callable[[float], Streams]) -> None:
        self.name, self.kind, self._make = name, kind, make
        self.controller = make(0.0)

    def link_delay(self, seconds: float) -> None:
        self.controller = self._make(seconds)

    def reset(self) -> None:
        self.controller.reset(1)

    def packet(self, time_s: float, state: VehicleState, reference: Reference) -> bytes:
        record = np.asarray(self.controller.setpoint(time_s, state, reference))
        if record.dtype != SETPOINT or record.shape != (1,):
            raise ValueError(f"setpoint returned {record.dtype} of shape {record.shape}, not one SETPOINT record")
        return setpoint_packets.of_record(record[0])


def finite(packet: bytes) -> bool:
    """Whether all numbers of a set-point are finite: nan survives packing."""
    numbers = [v for value in setpoint_packets.decoded(packet).values() if not isinstance(value, str)
               for v in (value if isinstance(value, tuple) else (value,))]
    return bool(np.isfinite(numbers).all())
