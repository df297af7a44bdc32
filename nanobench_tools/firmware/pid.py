"""The PID cascade: position -> velocity -> attitude -> rate (controller_pid.c, position_controller_pid.c,
attitude_pid_controller.c, pid.c, filter.c; gains of platform_defaults_cf2.h).

Position and velocity loops at 100 Hz in the yaw frame; attitude and rate loops at 500 Hz. The rule for zero thrust
runs at 1 kHz. Derivatives act on the measurement, integrals are clamped and not stopped by a saturated output.
Velocities and accelerations of an absolute setpoint are not used, thrust is not compensated for tilt.
"""

import math
from collections.abc import Callable

import numba as nb
import numpy as np

from .float32 import (
    ATTITUDE_DT,
    ATTITUDE_EVERY,
    HALF_TURN,
    PI,
    POSITION_EVERY,
    TO_DEG,
    TURN,
    ZERO,
    F,
    Real,
    clamped,
    counts16,
    one_turn,
    yaw_of,
)
from .kept import kept
from .records import ABSOLUTE, VELOCITY, Record

LOOPS = ("X", "Y", "Z", "VX", "VY", "VZ", "roll", "pitch", "yaw", "rollrate", "pitchrate", "yawrate")
"""The twelve PID blocks in the order of ``block``."""
GAINS = ("kp", "ki", "kd", "kff", "integral_limit", "output_limit", "dt_s", "filtered", "b0", "b1", "b2", "a1", "a2")
"""Columns of ``block``; an output limit of 0 is none; b and a are those of the derivative's low pass."""
KP, KI, KD, KFF, I_LIMIT, OUT_LIMIT, DT, FILTERED, B0, B1, B2, A1, A2 = range(len(GAINS))
INTEGRAL, PREVIOUS, D1, D2 = range(4)
_VX, _VZ, _ROLL, _YAW, _RATE = 3, 5, 6, 8, 9

PARAMETERS = np.dtype([("block", "f4", (12, len(GAINS))), ("thrust_base", "f4"), ("thrust_min", "f4"),
                       ("tilt_limit_deg", "f4"), ("yaw_max_delta_deg", "f4")], align=True)
STATE = np.dtype([("block", "f4", (12, 4)), ("velocity_setpoint", "f4", 3), ("attitude_deg", "f4", 3),
                  ("rate_deg_s", "f4", 3), ("thrust", "f4"), ("roll", "i2"), ("pitch", "i2"), ("yaw", "i2")],
                 align=True)
"""All zero at power-up. ``block`` holds integral, last measurement and the low pass of the 12 loops. The desired
values follow: velocity in the yaw frame [m/s], angles [deg], rates [deg/s], thrust and the held outputs [counts]."""


def low_pass(fs_hz: float, fc_hz: float) -> tuple[float, ...]:
    """b0, b1, b2, a1, a2 of the two-pole Butterworth (lpf2pSetCutoffFreq of filter.c)."""
    o = np.tan(np.pi * fc_hz / fs_hz)
    c = 1.0 + 2.0 * np.cos(np.pi / 4.0) * o + o * o
    b0 = o * o / c
    return b0, 2.0 * b0, b0, 2.0 * (o * o - 1.0) / c, (1.0 - 2.0 * np.cos(np.pi / 4.0) * o + o * o) / c


def defaults(n: int = 1) -> np.ndarray:
    """(n,) PARAMETERS as released (platform_defaults_cf2.h; limits of position_controller_pid.c)."""
    slow, fast = (0.01, 1.0, *low_pass(100.0, 20.0)), (0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # kp, ki, kd, kff, limit of the integral, limit of the output
    lateral, height = (2.0, 0.0, 0.0, 0.0, 5000.0, 1.1, *slow), (2.0, 0.5, 0.0, 0.0, 5000.0, 1.1, *slow)
    speed, climb = (25.0, 1.0, 0.0, 0.0, 5000.0, 22.0, *slow), (25.0, 15.0, 0.0, 0.0, 5000.0, 32.767, *slow)
    tilt, yaw = (6.0, 3.0, 0.0, 0.0, 20.0, 0.0, *fast), (6.0, 1.0, 0.35, 0.0, 360.0, 0.0, *fast)
    rate, turn = (250.0, 500.0, 2.5, 0.0, 33.3, 0.0, *fast), (120.0, 16.7, 0.0, 0.0, 166.7, 0.0, *fast)
    found = np.zeros(n, PARAMETERS)
    found["block"] = [lateral, lateral, height, speed, speed, climb, tilt, tilt, yaw, rate, rate, turn]
    found["thrust_base"], found["thrust_min"], found["tilt_limit_deg"] = 36000.0, 20000.0, 20.0
    return found


@nb.njit()
def _update(g: np.ndarray, s: Record, desired: Real, measured: Real, turns: bool) -> Real:
    """pidUpdate of pid.c; g (13,) gains, s (4,) memory; ``turns``: the error and the change are angles."""
    error, change = desired - measured, -(measured - s[PREVIOUS])
    if turns:
        error, change = _short_way(error), _short_way(change)
    derivative = change / g[DT]
    if g[FILTERED] != ZERO:
        derivative = _filtered(g, s, derivative)
    if math.isnan(derivative):
        derivative = ZERO
    s[INTEGRAL] += error * g[DT]
    if g[I_LIMIT] != ZERO:
        s[INTEGRAL] = clamped(s[INTEGRAL], -g[I_LIMIT], g[I_LIMIT])
    s[PREVIOUS] = measured
    out = g[KP] * error + g[KD] * derivative + g[KI] * s[INTEGRAL] + g[KFF] * desired
    return clamped(out, -g[OUT_LIMIT], g[OUT_LIMIT]) if g[OUT_LIMIT] != ZERO else out


@nb.njit()
def _short_way(angle: Real) -> Real:
    """One turn is taken off once (pid.c); angles here are never further apart."""
    if angle > F(180.0):
        return angle - TURN
    return angle + TURN if angle < F(-180.0) else angle


@nb.njit()
def _filtered(g: np.ndarray, s: Record, x: Real) -> Real:
    """lpf2pApply of filter.c, direct form II."""
    d0 = x - s[D1] * g[A1] - s[D2] * g[A2]
    if not math.isfinite(d0):
        d0 = x
    y: Real = d0 * g[B0] + s[D1] * g[B1] + s[D2] * g[B2]
    s[D1], s[D2] = d0, s[D1]
    return y


@nb.njit()
def _forget(s: Record, measured: Real) -> None:
    """pidReset of pid.c: the low pass keeps its state."""
    s[INTEGRAL] = ZERO
    s[PREVIOUS] = measured


@nb.njit()
def _wanted_yaw(p: Record, s: Record, setpoint: Record, estimate: Record) -> None:
    """controller_pid.c, lines 63-91: where the nose should point."""
    if setpoint.mode_yaw == VELOCITY:
        s.attitude_deg[2] = one_turn(s.attitude_deg[2] + setpoint.rate_deg_s[2] * ATTITUDE_DT)
        limit = p.yaw_max_delta_deg
        if limit != ZERO:
            ahead = one_turn(s.attitude_deg[2] - estimate.attitude_deg[2])
            if abs(ahead) > limit:
                s.attitude_deg[2] = estimate.attitude_deg[2] + clamped(ahead, -limit, limit)
    elif setpoint.mode_yaw == ABSOLUTE:
        s.attitude_deg[2] = setpoint.attitude_deg[2]
    elif setpoint.mode_quat == ABSOLUTE:
        s.attitude_deg[2] = yaw_of(setpoint.quaternion) * TO_DEG
    s.attitude_deg[2] = one_turn(s.attitude_deg[2])


@nb.njit()
def _outer(p: Record, s: Record, setpoint: Record, estimate: Record) -> None:
    """positionController and velocityController of position_controller_pid.c."""
    yaw = estimate.attitude_deg[2] * PI / HALF_TURN
    c, sn = math.cos(yaw), math.sin(yaw)
    goal, here, wish, speed = setpoint.position_m, estimate.position_m, setpoint.velocity_m_s, estimate.velocity_m_s
    want = s.velocity_setpoint
    want[0], want[1], want[2] = wish[0], wish[1], wish[2]
    if setpoint.velocity_body == 0:
        want[0], want[1] = wish[0] * c + wish[1] * sn, wish[1] * c - wish[0] * sn
    if setpoint.mode_x == ABSOLUTE:
        want[0] = _update(p.block[0], s.block[0], goal[0] * c + goal[1] * sn, here[0] * c + here[1] * sn, False)
    if setpoint.mode_y == ABSOLUTE:
        want[1] = _update(p.block[1], s.block[1], -goal[0] * sn + goal[1] * c, -here[0] * sn + here[1] * c, False)
    if setpoint.mode_z == ABSOLUTE:
        want[2] = _update(p.block[2], s.block[2], goal[2], here[2], False)
    ahead = _update(p.block[_VX], s.block[_VX], want[0], speed[0] * c + speed[1] * sn, False)
    left = _update(p.block[_VX + 1], s.block[_VX + 1], want[1], -speed[0] * sn + speed[1] * c, False)
    up = _update(p.block[_VZ], s.block[_VZ], want[2], speed[2], False)
    limit = p.tilt_limit_deg
    s.attitude_deg[1] = clamped(-ahead, -limit, limit)
    s.attitude_deg[0] = clamped(-left, -limit, limit)
    thrust = up * F(1000.0) + p.thrust_base
    s.thrust = clamped(max(thrust, p.thrust_min), ZERO, F(65535.0))


@nb.njit()
def _inner(p: Record, s: Record, setpoint: Record, estimate: Record) -> None:
    """Attitude and rate loops (attitude_pid_controller.c), what the setpoint overrides (controller_pid.c 97-131)."""
    if setpoint.mode_z == 0:
        s.thrust = setpoint.thrust
    if setpoint.mode_x == 0 or setpoint.mode_y == 0:
        s.attitude_deg[0], s.attitude_deg[1] = setpoint.attitude_deg[0], setpoint.attitude_deg[1]
    for k in range(3):
        s.rate_deg_s[k] = _update(p.block[_ROLL + k], s.block[_ROLL + k], s.attitude_deg[k], estimate.attitude_deg[k],
                                  k == 2)
    if setpoint.mode_roll == VELOCITY:
        s.rate_deg_s[0] = setpoint.rate_deg_s[0]
        _forget(s.block[_ROLL], estimate.attitude_deg[0])
    if setpoint.mode_pitch == VELOCITY:
        s.rate_deg_s[1] = setpoint.rate_deg_s[1]
        _forget(s.block[_ROLL + 1], estimate.attitude_deg[1])
    gyro = estimate.gyro_deg_s
    s.roll = counts16(_update(p.block[_RATE], s.block[_RATE], s.rate_deg_s[0], gyro[0], False))
    s.pitch = counts16(_update(p.block[_RATE + 1], s.block[_RATE + 1], s.rate_deg_s[1], -gyro[1], False))
    s.yaw = -counts16(_update(p.block[_RATE + 2], s.block[_RATE + 2], s.rate_deg_s[2], gyro[2], False))


@nb.njit()
def _forget_all(s: Record, estimate: Record) -> None:
    """controller_pid.c 150-162: every loop starts anew where the vehicle is; the nose stays where it points."""
    for k in range(12):
        _forget(s.block[k], ZERO)
    for k in range(3):
        s.block[k, PREVIOUS] = estimate.position_m[k]
        s.block[_ROLL + k, PREVIOUS] = estimate.attitude_deg[k]
        s.block[k, D1] = s.block[k, D2] = s.block[_VX + k, D1] = s.block[_VX + k, D2] = ZERO
    s.roll = s.pitch = s.yaw = 0
    s.attitude_deg[2] = estimate.attitude_deg[2]


@nb.njit()
def pid_step(step: int, p: Record, s: Record, setpoint: Record, estimate: Record, control: Record) -> None:
    """controllerPid for one vehicle at ``step`` of the 1 kHz loop (counted from 1); writes ``control``."""
    if step % ATTITUDE_EVERY == 0:
        _wanted_yaw(p, s, setpoint, estimate)
    if step % POSITION_EVERY == 0:
        _outer(p, s, setpoint, estimate)
    if step % ATTITUDE_EVERY == 0:
        _inner(p, s, setpoint, estimate)
    if s.thrust == ZERO:
        _forget_all(s, estimate)
    control.thrust, control.roll, control.pitch, control.yaw = s.thrust, s.roll, s.pitch, s.yaw


@kept
def run_steps(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def run_steps(steps: np.ndarray, parameters: np.ndarray, state: np.ndarray, setpoint: np.ndarray,
                  estimate: np.ndarray, control: np.ndarray, trace: np.ndarray) -> None:
        """``steps`` (m,) of the 1 kHz loop for n vehicles: setpoint, estimate (m, n) in, control (m, n) out.

        state (n,) is carried on; parameters (n,) or (1,) for all; trace (m, n), or (0, n), takes the state after steps.
        """
        if not sources:
            return
        own = len(parameters) > 1
        for k in range(len(steps)):
            for i in range(len(state)):
                pid_step(steps[k], parameters[i if own else 0], state[i], setpoint[k, i], estimate[k, i], control[k, i])
                if len(trace):
                    trace[k, i] = state[i]

    return run_steps

