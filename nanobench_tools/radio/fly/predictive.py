"""Predictive controllers over a radio: a plan's motor commands, as the rates that make the vehicle's loops produce
them.

The vehicle gets collective thrust and body rates; its rate loops (500 Hz, PID) turn the rates into counts of the mixer.
For a command w + e / kp they put out the plan's moment. Here e is the planned roll and pitch in counts of the mixer,
less the integrals by then. The predicted rate at the time of arrival is w. So the loops' gain cancels for any weight
of the vehicle, and lasting moments (drag, a weak motor) are not commanded twice.

A gain that is too high here ends in a cycle between the bounds of the rates. The mixer takes thrust from all motors for
it, and as the battery drops, so does the vehicle. (``firmware.pid``, ``firmware.motors.mix_legacy`` and ``cap``.)
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...firmware.pid import KI, KP, LOOPS, defaults
from ...firmware.thrust_curve import THRUST_MAX_N, thrust_of_voltage
from ...methods import Reference, VehicleState
from . import setpoint_packets
from .heading import yaw_rate
from .pilot import PERIOD_S, PID

MOST_RATE_RAD_S = 8.0
_LOOP = defaults()["block"][0, LOOPS.index("rollrate")]
COUNTS_PER_RAD_S = float(np.degrees(_LOOP[KP]))
"""What the loops of roll and pitch put out for an error; their integrals grow by INTEGRAL_1_S of that a second."""
INTEGRAL_1_S = float(_LOOP[KI] / _LOOP[KP])
TO_ROLL_PITCH = 0.5 * np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0]])
"""Counts of motors 1..4 -> roll and pitch (forward-left-up) that ``mix_legacy`` makes them of."""


class Predictive(Protocol):
    """As ``mpc.predictive_base.Mpc``; ``foreseen``: states (n, 17) so many seconds after the command acts."""

    name: str

    def reset(self, n: int) -> None: ...

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray: ...

    def foreseen(self, seconds: float) -> np.ndarray: ...


class PlannedPilot:
    """Flies what ``make`` gives for a link delay [s]."""

    kind, onboard, hosted = "thrust-rates", PID, True

    def __init__(self, make: Callable[[float], Predictive]) -> None:
        self._make = make
        self.controller = make(0.0)
        self.name = self.controller.name

    def link_delay(self, seconds: float) -> None:
        self.controller = self._make(max(seconds, 0.0))

    def reset(self) -> None:
        self.controller.reset(1)
        self._held = np.zeros(2)

    def packet(self, time_s: float, state: VehicleState, reference: Reference) -> bytes:
        ratios = np.asarray(self.controller.command(time_s, state, reference))[0]
        counts = thrust_of_voltage(ratios * state.battery_V[0]) / THRUST_MAX_N * setpoint_packets.MOST_COUNTS
        now = self.controller.foreseen(0.0)[0, 10:12]
        commanded = now + (TO_ROLL_PITCH @ counts - self._held) / COUNTS_PER_RAD_S
        commanded = np.clip(commanded, -MOST_RATE_RAD_S, MOST_RATE_RAD_S)
        self._held = self._held + PERIOD_S * INTEGRAL_1_S * COUNTS_PER_RAD_S * (commanded - now)
        return setpoint_packets.rates(float(counts.mean()), np.array([*commanded, yaw_rate(state, reference)]))
