"""From a controller's output to the four motors: mixer, battery compensation, cap, and the vehicle's filtered voltage.

Sources: power_distribution_quadrotor.c (mixers, cap), motors.c (compensation), stabilizer.c (order, voltage filter).
Motors 1..4 are front right, back right, back left, front left. Compiled, one vehicle at a time, float32 where the
firmware's rounding can be seen in the counts.
"""

from collections.abc import Callable
from typing import Any

import numba as nb
import numpy as np

from .float32 import TWO, ZERO, F, Real
from .kept import kept
from .records import CONTROL, WRENCH, Record
from .thrust_curve import THRUST_MAX_N, THRUST_MIN_N, VOLTAGE_MIN_V, voltage_of_thrust

VOLTAGE_SHARE = F(0.01)
"""Share of a new voltage in the filtered one, every millisecond."""
VOLTAGE_START_V = F(4.2)
FULL = 65535
ARM_M, YAW_ARM_M = F(0.70710678118) * F(0.046), F(0.0069928948992470565)
"""Lever of a motor about x and y, torque of a motor per newton (platform_defaults_cf2.h)."""
BUILD = np.array([[THRUST_MAX_N, THRUST_MIN_N]], np.float32)
"""(1, 2): newton that a motor is thought to give at 65535 counts, and below which it is given none."""
EARLIER_BUILD = np.array([[0.1125, 0.02]], np.float32)
"""The same before 2025.12.1 (platform_defaults_cf2.h of 2025.12). Some recordings were flown with it, although their
sheets differ."""
_VOLTAGE_MIN = F(VOLTAGE_MIN_V)
_voltage_of_thrust = nb.njit(voltage_of_thrust)


@nb.njit()
def mix_legacy(control: Record, motor: np.ndarray) -> None:
    """control CONTROL -> counts (4,) int32, not capped: roll and pitch are halved, yaw is not."""
    thrust, r, p, y = control.thrust, F(int(control.roll / TWO)), F(int(control.pitch / TWO)), F(control.yaw)
    motor[0], motor[1] = int(thrust - r + p + y), int(thrust - r - p - y)
    motor[2], motor[3] = int(thrust + r - p + y), int(thrust + r + p - y)


@nb.njit()
def mix_wrench(wrench: Record, build: np.ndarray, motor: np.ndarray) -> None:
    """wrench WRENCH, build (2,) -> counts (4,) int32, not capped; a motor that would have to pull stands still."""
    quarter = F(0.25)
    r, p = quarter / ARM_M * wrench.torque_N_m[0], quarter / ARM_M * wrench.torque_N_m[1]
    y, f = quarter * wrench.torque_N_m[2] / YAW_ARM_M, quarter * wrench.thrust_N
    for i, force in enumerate((f - r - p - y, f - r + p + y, f + r + p - y, f + r - p + y)):
        motor[i] = int(max(force, ZERO) / build[0] * F(FULL))


@kept
def compensated(sources: str) -> Any:
    @nb.vectorize(cache=True)  # type: ignore[no-untyped-call, untyped-decorator]
    def compensated(counts: Real, filtered_V: Real, thrust_max_N: Real, thrust_min_N: Real) -> Real:
        """A motor's command [counts], the filtered battery [V] and the build's limits [N] -> PWM counts, not capped.

        Float32 in and out: arrays that broadcast, or numbers in compiled code.
        """
        if not sources:
            return filtered_V
        thrust = F(counts) / F(FULL) * thrust_max_N
        if filtered_V < _VOLTAGE_MIN or thrust < thrust_min_N:
            return ZERO
        return F(FULL) * (F(_voltage_of_thrust(thrust)) / filtered_V)

    return compensated


@nb.njit()
def cap(motor: np.ndarray) -> None:
    """(4,) int32 in place: what the strongest has too much is taken from all, and none goes below zero."""
    over = max(motor[0], motor[1], motor[2], motor[3]) - FULL
    for i in range(4):
        motor[i] = max(motor[i] - max(over, 0), 0)


@nb.njit()
def filter_voltage(filtered_V: Real, battery_V: Real) -> Real:
    """The filtered voltage one millisecond later."""
    return filtered_V + VOLTAGE_SHARE * (battery_V - filtered_V)


@nb.njit()
def drive(filtered_V: Real, build: np.ndarray, motor: np.ndarray) -> None:
    """What has been mixed (4,) int32 -> PWM counts, in place: compensation, whole counts, cap, in this order."""
    for i in range(4):
        motor[i] = int(compensated(F(motor[i]), filtered_V, build[0], build[1]))
    cap(motor)


@kept
def drive_legacy(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def drive_legacy(milliseconds: int, control: np.ndarray, battery_V: np.ndarray, filtered_V: np.ndarray,
                     build: np.ndarray, motor: np.ndarray) -> None:
        """control (n,) CONTROL, battery_V (n,) float32 held for so many ms -> motor (n, 4) int32.

        build (n, 2), or (1, 2) for all; filtered_V (n,) goes on, and is left as it was by what is no voltage.
        """
        if not sources:
            return
        for i in range(len(control)):
            for _ in range(milliseconds):
                if battery_V[i] == battery_V[i]:
                    filtered_V[i] = filter_voltage(filtered_V[i], battery_V[i])
            mix_legacy(control[i], motor[i])
            drive(filtered_V[i], build[i if len(build) > 1 else 0], motor[i])

    return drive_legacy


@kept
def drive_wrench(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def drive_wrench(milliseconds: int, wrench: np.ndarray, battery_V: np.ndarray, filtered_V: np.ndarray,
                     build: np.ndarray, motor: np.ndarray) -> None:
        """``drive_legacy`` for wrench (n,) WRENCH."""
        if not sources:
            return
        for i in range(len(wrench)):
            for _ in range(milliseconds):
                if battery_V[i] == battery_V[i]:
                    filtered_V[i] = filter_voltage(filtered_V[i], battery_V[i])
            own = build[i if len(build) > 1 else 0]
            mix_wrench(wrench[i], own, motor[i])
            drive(filtered_V[i], own, motor[i])

    return drive_wrench


class MotorOutput:
    """The motors of n vehicles behind either mixer; remembers the filtered voltage. ``build`` (n, 2) or (1, 2)."""

    def __init__(self, n: int, period_s: float, build: np.ndarray = BUILD) -> None:
        self.milliseconds = round(period_s * 1000.0)
        self.filtered_V = np.full(n, VOLTAGE_START_V)
        self.build = np.asarray(build, np.float32)
        self._counts = np.zeros((n, 4), np.int32)

    def __call__(self, command: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        """command (n,) CONTROL or WRENCH, battery (n,) V -> PWM ratios (n, 4)."""
        into = {CONTROL: drive_legacy, WRENCH: drive_wrench}[command.dtype]
        into(self.milliseconds, command, np.asarray(battery_V, np.float32), self.filtered_V, self.build,
             self._counts)
        return self._counts / FULL
