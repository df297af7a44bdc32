"""Small float32 functions that several controllers of the firmware share (num.c, math3d.h). Compiled, one vehicle."""

import math
from typing import Any

import numba as nb
import numpy as np

F = np.float32
Real = float | np.floating[Any]
"""A float32 number in compiled code; mypy sees what ``math`` returns as float."""
Triple = tuple[Real, Real, Real]
Quaternion = tuple[Real, Real, Real, Real]
Turn = tuple[Triple, Triple, Triple]
"""Rows, or columns, of a rotation matrix."""
ZERO, ONE, TWO = F(0.0), F(1.0), F(2.0)
TURN, HALF_TURN, PI = F(360.0), F(180.0), F(np.pi)
TO_RAD, TO_DEG = PI / HALF_TURN, HALF_TURN / PI
GRAVITY = F(9.81)
ATTITUDE_EVERY, POSITION_EVERY = 2, 10
"""Steps of 1 ms between runs of the attitude loops (500 Hz) and the position loops (100 Hz); stabilizer_types.h."""
ATTITUDE_DT = F(0.002)
_FAR = F(36000.0)
"""Beyond so many degrees the turns are taken off at once and not one by one."""


@nb.njit(inline="always")
def clamped(value: Real, low: Real, high: Real) -> Real:
    """constrain() of num.c; NaN stays NaN."""
    if value < low:
        return low
    return high if value > high else value


@nb.njit()
def counts16(value: Real) -> np.int16:
    """saturateSignedInt16 of attitude_pid_controller.c: towards zero, within +-32767; 0 for what is no number."""
    if value > F(32767.0):
        return np.int16(32767)
    if value < F(-32767.0):
        return np.int16(-32767)
    return np.int16(value) if value == value else np.int16(0)


@nb.njit()
def one_turn(angle: F) -> Real:
    """capAngle of controller_pid.c: degrees into -180..180; 0 for what is not finite, where the firmware hangs."""
    if not math.isfinite(angle):
        return ZERO
    if abs(angle) > _FAR:
        angle = F(angle % TURN)
    while angle > HALF_TURN:
        angle -= TURN
    while angle < -HALF_TURN:
        angle += TURN
    return angle


@nb.njit()
def yaw_of(q: np.ndarray) -> Real:
    """Yaw [rad] of a quaternion (4,) x, y, z, w; quat2rpy of math3d.h."""
    return math.atan2(TWO * (q[3] * q[2] + q[0] * q[1]), ONE - TWO * (q[1] * q[1] + q[2] * q[2]))


@nb.njit()
def rotation_of(q: np.ndarray) -> Turn:
    """Rows of the rotation matrix of a quaternion (4,) x, y, z, w; quat2rotmat of math3d.h."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    return ((ONE - TWO * y * y - TWO * z * z, TWO * x * y - TWO * z * w, TWO * x * z + TWO * y * w),
            (TWO * x * y + TWO * z * w, ONE - TWO * x * x - TWO * z * z, TWO * y * z - TWO * x * w),
            (TWO * x * z - TWO * y * w, TWO * y * z + TWO * x * w, ONE - TWO * x * x - TWO * y * y))


@nb.njit(inline="always")
def dot(a: Triple, b: Triple) -> Real:
    """a . b of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(inline="always")
def cross(a: Triple, b: Triple) -> Triple:
    """a x b of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(inline="always")
def unit(a: Triple, otherwise: Triple) -> Triple:
    """Triple of length one, or ``otherwise`` for the zero triple, which poisons the firmware's integrals."""
    square = dot(a, a)
    if not square > ZERO:
        return otherwise
    scale = ONE / math.sqrt(square)
    return a[0] * scale, a[1] * scale, a[2] * scale
