"""The two onboard controllers of the vehicle, batched over n vehicles in double precision.

Sources: crazyflie-firmware 2025.12.1: controller_pid.c, position_controller_pid.c, attitude_pid_controller.c,
controller_mellinger.c, power_distribution_quadrotor.c, stabilizer.c; gains of platform_defaults_cf2.h. Left out
against the firmware: float32, the 1 kHz output hold, and the filters that do nothing at the default gains.
Angles inside the PID cascade are degrees with the firmware's legacy pitch (nose up positive), as its gains are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from .. import so3
from ..errors import UsageError
from ..methods import Reference, VehicleState
from ..units import GRAVITY_M_S2, PWM_FULL_SCALE
from .plant import rotation_columns
from .thrust_curve import compensated_ratio

Batch = TypeVar("Batch", VehicleState, Reference)
Actuation = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
PERIOD_S = 0.002
POSITION_EVERY = 5
"""The position and velocity loops run at every fifth attitude step: 100 Hz."""
BATTERY_FILTER = 1.0 - 0.99**2
"""Share of a new voltage in the filtered one per step (stabilizer.c: 0.01 per millisecond)."""
BATTERY_FILTER_START_V = 4.2


@dataclass(frozen=True)
class ControllerLog:
    """What the log group ``controller`` shows: desired roll, pitch, yaw (n, 3) rad FLU, cmd_thrust (n,) ratio.

    written (n,) bool: vehicles whose controller fills the group at all.
    """

    attitude_rad: np.ndarray
    cmd_thrust: np.ndarray
    written: np.ndarray


def mix(thrust: np.ndarray, roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Counts (n,) in the firmware's legacy signs -> whole counts of the four motors (4, n), not capped.

    Roll and pitch are halved, yaw is not (power_distribution_quadrotor.c).
    """
    r, p = np.trunc(roll / 2.0), np.trunc(pitch / 2.0)
    return np.trunc(np.stack([thrust - r + p + yaw, thrust - r - p - yaw, thrust + r - p + yaw, thrust + r + p - yaw]))


def cap(counts: np.ndarray) -> np.ndarray:
    """What the strongest of the four motors has too much is taken from all (4, n); none goes below zero."""
    return np.maximum(counts - np.maximum(counts.max(axis=0) - PWM_FULL_SCALE, 0.0), 0.0)


class MotorOutput:
    """Mixer, battery compensation and cap shared by both controllers (stabilizer.c, motors.c)."""

    def __init__(self, n: int) -> None:
        self.filtered_V = np.full(n, BATTERY_FILTER_START_V)

    def __call__(self, thrust, roll, pitch, yaw, battery_V: np.ndarray) -> np.ndarray:
        """Counts (n,), legacy signs, battery (n,) V -> PWM ratios (n, 4)."""
        self.filtered_V = self.filtered_V + BATTERY_FILTER * (battery_V - self.filtered_V)
        ratio = compensated_ratio(mix(thrust, roll, pitch, yaw) / PWM_FULL_SCALE, self.filtered_V)
        return (cap(np.trunc(PWM_FULL_SCALE * ratio)) / PWM_FULL_SCALE).T


class _Pid:
    """The firmware's PID block, k axes of n vehicles: derivative on the measurement, integral clamped."""

    def __init__(self, n: int, dt_s: float, kp, ki, kd=0.0, integral_limit=5000.0, output_limit=np.inf) -> None:
        self.dt_s, self.kp, self.ki, self.kd = dt_s, *(np.reshape(np.asarray(g, float), (-1, 1)) for g in (kp, ki, kd))
        self.integral_limit, self.output_limit = (np.reshape(np.asarray(x, float), (-1, 1))
                                                  for x in (integral_limit, output_limit))
        self.integral = np.zeros((self.kp.shape[0], n))
        self.previous = np.zeros((self.kp.shape[0], n))

    def __call__(self, error: np.ndarray, measured: np.ndarray | None = None, wrap=None) -> np.ndarray:
        """error, measured (k, n) -> output (k, n); ``wrap`` maps differences of angles into one turn."""
        self.integral = np.clip(self.integral + error * self.dt_s, -self.integral_limit, self.integral_limit)
        out = self.kp * error + self.ki * self.integral
        if measured is not None:
            change = measured - self.previous
            self.previous = measured
            out = out - self.kd * (change if wrap is None else wrap(change)) / self.dt_s
        return np.clip(out, -self.output_limit, self.output_limit)

    def forget(self, which: np.ndarray, measured: np.ndarray | float) -> None:
        """Starts anew at ``measured`` for some vehicles (n,) bool, as the firmware does while it asks for no thrust."""
        self.integral[:, which] = 0.0
        self.previous = np.where(which, measured, self.previous)


def _wrap_deg(angle: np.ndarray) -> np.ndarray:
    return (angle + 180.0) % 360.0 - 180.0


class PidCascade:
    """Position -> velocity -> attitude -> rate -> motors, as in controller_pid.c. Uses position setpoints only."""

    name = "pid"
    information = "as flown"
    period_s = PERIOD_S
    thrust_base, thrust_min = 36000.0, 20000.0

    def reset(self, n: int) -> None:
        slow = POSITION_EVERY * PERIOD_S
        self._position = _Pid(n, slow, (2.0, 2.0, 2.0), (0.0, 0.0, 0.5), output_limit=1.1)
        self._velocity = _Pid(n, slow, (25.0, 25.0, 25.0), (1.0, 1.0, 15.0), output_limit=(22.0, 22.0, 32.767))
        self._attitude = _Pid(n, PERIOD_S, (6.0, 6.0, 6.0), (3.0, 3.0, 1.0), (0.0, 0.0, 0.35), (20.0, 20.0, 360.0))
        self._rate = _Pid(n, PERIOD_S, (250.0, 250.0, 120.0), (500.0, 500.0, 16.7), (2.5, 2.5, 0.0),
                          (33.3, 33.3, 166.7), 32767.0)
        self._output = MotorOutput(n)
        self._count = 1  # the stabilizer counts its steps from 1: the position loop first runs 10 ms after the start
        self._desired = np.zeros((3, n))
        self._thrust = np.zeros(n)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4). ``time_s`` is not used: like the firmware it counts its own steps."""
        return self._output(*self.actuation(state, reference), state.battery_V)

    def actuation(self, state: VehicleState, reference: Reference) -> Actuation:
        """thrust, roll, pitch, yaw (n,) in counts as the mixer takes them; one step of 2 ms."""
        attitude = np.degrees(so3.euler_zyx(state.quaternion).T)
        attitude[1] = -attitude[1]
        if self._count % POSITION_EVERY == 0:
            self._outer(state, reference, np.radians(attitude[2]))
        self._count += 1
        self._desired[2] = np.degrees(reference.yaw_rad)
        error = self._desired - attitude
        error[2] = _wrap_deg(error[2])
        rate = np.degrees(state.rate_rad_s.T)
        rate[1] = -rate[1]
        roll, pitch, yaw = np.trunc(self._rate(self._attitude(error, attitude, _wrap_deg) - rate, rate))
        if (self._thrust == 0.0).any():
            flying = self._thrust != 0.0
            for loop in (self._position, self._velocity, self._attitude, self._rate):
                loop.forget(~flying, attitude if loop is self._attitude else 0.0)
            roll, pitch, yaw = roll * flying, pitch * flying, yaw * flying
        return self._thrust, roll, pitch, -yaw

    def _outer(self, state: VehicleState, reference: Reference, yaw: np.ndarray) -> None:
        """Position and velocity loops in the yaw frame; no thrust compensation for tilt, no feed-forward."""
        c, s = np.cos(yaw), np.sin(yaw)

        def in_yaw_frame(world: np.ndarray) -> np.ndarray:
            x, y, z = world.T
            return np.stack([c * x + s * y, c * y - s * x, z])

        wanted = self._position(in_yaw_frame(reference.position_m - state.position_m))
        out = self._velocity(wanted - in_yaw_frame(state.velocity_m_s))
        self._desired[:2] = np.clip(-out[1::-1], -20.0, 20.0)
        self._thrust = np.clip(1000.0 * out[2] + self.thrust_base, self.thrust_min, PWM_FULL_SCALE)

    @property
    def log(self) -> ControllerLog:
        """What the last command wanted."""
        angles = np.radians(self._desired.T)
        angles[:, 1] = -angles[:, 1]
        return ControllerLog(angles, self._thrust / PWM_FULL_SCALE, np.ones(len(angles), dtype=bool))


class MellingerLike:
    """controller_mellinger.c: force from position and velocity errors, attitude by rotation-matrix error.

    Uses the reference's velocity and acceleration when they are given. Believes in 0.029 kg: the vehicle hangs low.
    """

    name = "mellinger"
    information = "as flown"
    period_s = PERIOD_S
    mass_kg, mass_thrust = 0.029, 132000.0
    kp, kd, ki = (np.array(g)[:, None] for g in ((0.4, 0.4, 1.25), (0.2, 0.2, 0.4), (0.05, 0.05, 0.05)))
    i_range = np.array([2.0, 2.0, 0.4])[:, None]
    k_r, k_w, k_i_z, i_range_m_z = (70000.0, 70000.0, 60000.0), (20000.0, 20000.0, 12000.0), 500.0, 1500.0
    kd_omega = 200.0

    def reset(self, n: int) -> None:
        self._integral = np.zeros((3, n))
        self._integral_m = np.zeros(n)
        self._previous = np.zeros((2, n))
        self._output = MotorOutput(n)
        self._yaw = np.zeros(n)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        return self._output(*self.actuation(state, reference), state.battery_V)

    @property
    def log(self) -> ControllerLog:
        """Nothing: this controller does not write the group."""
        n = len(self._yaw)
        return ControllerLog(np.zeros((n, 3)), np.zeros(n), np.zeros(n, dtype=bool))

    def actuation(self, state: VehicleState, reference: Reference) -> Actuation:
        """thrust, roll, pitch, yaw (n,) in counts as the mixer takes them; one step of 2 ms."""
        error = (reference.position_m - state.position_m).T
        self._integral = np.clip(self._integral + error * PERIOD_S, -self.i_range, self.i_range)
        wanted = reference.acceleration_m_s2.T + np.array([[0.0], [0.0], [GRAVITY_M_S2]])
        force = (self.mass_kg * wanted + self.kp * error + self.kd * (reference.velocity_m_s - state.velocity_m_s).T
                 + self.ki * self._integral)
        body_x, body_y, body_z = rotation_columns(state.quaternion.T)
        thrust = self.mass_thrust * _dot(force, body_z)
        z = force / np.sqrt(_dot(force, force))
        y = _cross(z, (np.cos(reference.yaw_rad), np.sin(reference.yaw_rad), 0.0))
        y = y / np.sqrt(_dot(y, y))
        x = _cross(y, z)
        # e = vee(Rd^T R - R^T Rd) without the textbook's one half; the y part is negated for the legacy frame
        e_r = np.stack([_dot(z, body_y) - _dot(y, body_z), _dot(z, body_x) - _dot(x, body_z),
                        _dot(y, body_x) - _dot(x, body_y)])
        rate = state.rate_rad_s.T * np.array([[1.0], [-1.0], [1.0]])
        change = -(rate[:2] - self._previous) / PERIOD_S
        self._previous = rate[:2]
        self._integral_m = np.clip(self._integral_m - e_r[2] * PERIOD_S, -self.i_range_m_z, self.i_range_m_z)
        moment = [-k * e - w * rate_axis for k, e, w, rate_axis in zip(self.k_r, e_r, self.k_w, rate, strict=True)]
        roll, pitch = (np.trunc(np.clip(m + self.kd_omega * d, -32000.0, 32000.0))
                       for m, d in zip(moment[:2], change, strict=True))
        yaw = np.trunc(np.clip(-(moment[2] + self.k_i_z * self._integral_m), -32000.0, 32000.0))
        flying = thrust > 0.0
        return np.maximum(thrust, 0.0), roll * flying, pitch * flying, yaw * flying


class OnboardFleet:
    """Several onboard controllers in one batch: vehicle i flies behind ``CONTROLLERS[names[i]]``."""

    information = "as flown"
    period_s = PERIOD_S

    def __init__(self, names: Sequence[str]) -> None:
        unknown = sorted(set(names) - set(CONTROLLERS))
        if unknown:
            raise UsageError(f"unknown controller {unknown[0]!r}; known: {', '.join(CONTROLLERS)}")
        self.name = "+".join(sorted(set(names)))
        self._rows = {name: np.flatnonzero(np.array(names) == name) for name in CONTROLLERS if name in names}
        self._parts = {name: CONTROLLERS[name]() for name in self._rows}

    def reset(self, n: int) -> None:
        for name, rows in self._rows.items():
            self._parts[name].reset(len(rows))

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        out = np.empty((len(state.position_m), 4))
        for name, rows in self._rows.items():
            out[rows] = self._parts[name].command(time_s, _of(rows, state), _of(rows, reference))
        return out

    @property
    def log(self) -> ControllerLog:
        """The log groups of all."""
        n = sum(map(len, self._rows.values()))
        log = ControllerLog(np.zeros((n, 3)), np.zeros(n), np.zeros(n, dtype=bool))
        for name, rows in self._rows.items():
            part = self._parts[name].log
            for field in fields(log):
                getattr(log, field.name)[rows] = getattr(part, field.name)
        return log


def _of(rows: np.ndarray, batch: Batch) -> Batch:
    """The vehicles ``rows`` of a batch."""
    return type(batch)(*(getattr(batch, field.name)[rows] for field in fields(batch)))


def _dot(a, b) -> np.ndarray:
    """Column dot products (3, n), (3, n) -> (n,), summed in a fixed order."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a, b) -> np.ndarray:
    """Column cross products (3, n), (3, n) -> (3, n)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


CONTROLLERS: dict[str, type[PidCascade] | type[MellingerLike]] = {"pid": PidCascade, "mellinger": MellingerLike}
"""The controllers of the vehicle by the name the audit gives them."""
