"""What a plan says to a vehicle that flies itself: set-points for its own loops instead of motor commands.

``rates`` body rates and collective thrust; ``full_state`` position to acceleration, attitude and
rates; ``velocity`` velocity and yaw rate. ``OverRadio`` flies rates or velocities: the firmware's cascade runs at 500
Hz on board, the plan reaches it ``delay_s`` later.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.firmware.onboard import STEPS, PidCascade, estimates
from nanobench_tools.firmware.records import ABSOLUTE, DISABLED, SETPOINT, VELOCITY
from nanobench_tools.firmware.thrust_curve import THRUST_MAX_N, thrust_of_voltage
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.settings import number, setting
from nanobench_tools.units import PWM_FULL_SCALE

from .disturbance import Tuning
from .mpc_base import Mpc, Weights
from .mpc_linear import MpcDaqp

LEAD_S = setting("control.mpc_setpoints.lead_s")
"""How far ahead of the time at which it acts a set-point is taken from the plan: what the loop behind it is late by."""
SOFT_WEIGHTS: dict[str, Any] = setting("control.mpc_setpoints.soft_weights")
SOFT = Weights(**SOFT_WEIGHTS)
"""For loops that are slower than the motors which the plan thinks it has."""
SHARE = setting("control.mpc_setpoints.share")
"""As of ``Tuning``, for a vehicle that flies itself."""
DELAY_S = number("control.mpc_setpoints.delay_s")
"""Of the radio, where nothing else is told."""
SLOPE_S = number("control.mpc_setpoints.slope_s")
"""Acceleration is the difference of planned velocities over so long."""


@dataclass(frozen=True)
class Setpoints:
    """Of n vehicles: position_m, velocity_m_s, acceleration_m_s2 (n, 3) world, quaternion (n, 4), rate_rad_s (n, 3)
    body, motor_thrust_N (n, 4) asked, yaw_rate_rad_s (n,)."""

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    motor_thrust_N: np.ndarray

    @property
    def thrust_N(self) -> np.ndarray:
        """Collective (n,)."""
        return np.asarray(self.motor_thrust_N.sum(axis=1))

    @property
    def yaw_rate_rad_s(self) -> np.ndarray:
        """About the world's vertical (n,)."""
        return so3.rotate(self.quaternion, self.rate_rad_s)[:, 2]


def setpoints(mpc: Mpc, lead_s: float) -> Setpoints:
    """From the last plans of ``mpc``, ``lead_s`` after its last command begins to act."""
    x, later = mpc.foreseen(lead_s), mpc.foreseen(lead_s + SLOPE_S)
    return Setpoints(x[:, :3], x[:, 3:6], (later[:, 3:6] - x[:, 3:6]) / SLOPE_S, x[:, 6:10], x[:, 10:13],
                     mpc.plan.thrust_N[:, 0].copy())


def records(found: Setpoints, output: str, counts: np.ndarray) -> np.ndarray:
    """(n,) SETPOINT of the firmware; counts (n,) is the collective thrust of ``rates`` in counts of a motor."""
    out = np.zeros(len(found.position_m), SETPOINT)
    degrees = np.degrees(found.rate_rad_s)
    if output == "rates":
        out["mode_roll"] = out["mode_pitch"] = out["mode_yaw"] = VELOCITY
        out["mode_x"] = out["mode_y"] = out["mode_z"] = DISABLED
        out["rate_deg_s"] = degrees * [1.0, -1.0, 1.0]  # the cascade's pitch is the legacy one
        out["thrust"] = counts
        return out
    if output == "velocity":
        out["mode_x"] = out["mode_y"] = out["mode_z"] = out["mode_yaw"] = VELOCITY
        out["velocity_m_s"] = found.velocity_m_s
        out["rate_deg_s"][:, 2] = np.degrees(found.yaw_rate_rad_s)
        return out
    out["mode_x"] = out["mode_y"] = out["mode_z"] = out["mode_quat"] = ABSOLUTE
    out["position_m"], out["velocity_m_s"] = found.position_m, found.velocity_m_s
    out["acceleration_m_s2"], out["quaternion"], out["rate_deg_s"] = found.acceleration_m_s2, found.quaternion, degrees
    return out


class _Following(PidCascade):
    """The firmware's cascade, told records instead of references."""

    def follow(self, record: np.ndarray, state: VehicleState, reference: Reference) -> np.ndarray:
        """record (n,) SETPOINT -> PWM ratios (n, 4)."""
        state, _ = self.guard.admit(state, reference)
        estimates(state, self._estimate[0])
        self._setpoint[0] = record
        self._step += STEPS
        type(self)._run(np.array([self._step]), self.parameters, self.state, self._setpoint, self._estimate,
                        self._control, self._no_trace)
        return self.guard.release(self._drive(self._control[0], state.battery_V))


class OverRadio:
    """A predictive controller whose ``output`` is flown by the firmware's own loops, motor PWM out at 500 Hz."""

    information = "preview"
    on_board = True
    period_s = 0.002

    def __init__(self, output: str = "rates", delay_s: float = DELAY_S, kind: type[Mpc] = MpcDaqp,
                 **keywords: Any) -> None:
        if output not in LEAD_S:
            raise UsageError(f"unknown output {output!r}; known: {', '.join(LEAD_S)}")
        self.output, self.delay_s = output, delay_s
        # what the plan asks of single motors does not happen: the loops decide, and learn moments themselves
        keywords.setdefault("tuning", Tuning(share=SHARE, moment_1_s=0.0))
        if output == "rates":
            keywords.setdefault("weights", SOFT)
        keywords.setdefault("near_m", 0.0)  # the mixer takes thrust from all motors for a plan that needs them whole
        self.mpc = kind(delay_s=delay_s, **keywords)
        self.name = f"{self.mpc.name}_{output}"
        self._loops = _Following()

    def reset(self, n: int) -> None:
        self.mpc.reset(n)
        self._loops.reset(n)
        self.guard = self.mpc.guard
        self._every = round(self.mpc.period_s / self.period_s)
        self._step = 0
        still = np.zeros(n, SETPOINT)
        self._waiting = deque([still] * round(self.delay_s / self.period_s))
        self._last = still

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 whatever the input."""
        if self._step % self._every == 0:
            self._last = self.setpoint(time_s, state, reference)
        self._step += 1
        self._waiting.append(self._last)
        return self._loops.follow(self._waiting.popleft(), state, reference)

    def setpoint(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """(n,) SETPOINT that a vehicle is sent now; asked for every ``mpc.period_s``."""
        self.mpc.command(time_s, state, reference)
        found = setpoints(self.mpc, LEAD_S[self.output])
        return records(found, self.output, self._counts(found, state.battery_V))

    def _counts(self, found: Setpoints, battery_V: np.ndarray) -> np.ndarray:
        """Collective thrust as the firmware counts it: its own curve at the voltage that gives it by the model."""
        even = np.repeat(found.thrust_N[:, None] / 4.0, 4, axis=1)
        ratio = self.mpc.thrust_map.ratios(even, battery_V)[:, 0]
        return np.clip(thrust_of_voltage(ratio * battery_V) / THRUST_MAX_N, 0.0, 1.0) * PWM_FULL_SCALE
