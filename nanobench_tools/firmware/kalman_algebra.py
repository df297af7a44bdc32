"""Covariances, small turns and the tabled sine of the firmware's Kalman filter (kalman_core.c, CMSIS-DSP), float32."""

import math
from typing import Any

import numba as nb
import numpy as np

from .float32 import ONE, TWO, ZERO, F, Quaternion, Real, Triple

HALF = F(0.5)
_EPS = F(1e-6)
_MOST, _LEAST = F(100.0), F(1e-6)
"""Bounds of the covariance: of any element, of the diagonal."""
_TURNS, _STEPS = F(0.159154943092), F(512.0)
_SINE = np.round(np.sin(2.0 * np.pi * np.arange(513) / 512.0), 8).astype(np.float32)


@nb.njit()
def _looked_up(turns: np.floating[Any]) -> Real:
    """The sine of so many turns, straight between 512 steps (arm_sin_f32 of CMSIS-DSP)."""
    if not abs(turns) < F(1e6):
        return ZERO
    place = _STEPS * (turns - F(math.floor(turns)))
    index = int(place)
    if index >= 512:
        index, place = 0, place - _STEPS
    part = place - F(index)
    found: Real = (ONE - part) * _SINE[index] + part * _SINE[index + 1]
    return found


@nb.njit()
def sine(angle: Real) -> Real:
    """Of an angle [rad]; 0 where it is not finite."""
    return _looked_up(angle * _TURNS)


@nb.njit()
def cosine(angle: Real) -> Real:
    """Of an angle [rad]; 0 where it is not finite."""
    return _looked_up(angle * _TURNS + F(0.25))


@nb.njit(inline="always")
def bounded(value: Real, diagonal: bool) -> Real:
    if math.isnan(value) or value > _MOST:
        return _MOST
    return _LEAST if diagonal and value < _LEAST else value


@nb.njit()
def bound(covariance: np.ndarray) -> None:
    """Makes it symmetric and keeps it within bounds."""
    for i in range(9):
        for j in range(i, 9):
            value = bounded(HALF * covariance[i, j] + HALF * covariance[j, i], i == j)
            covariance[i, j] = covariance[j, i] = value


@nb.njit()
def attitude_block(a: np.ndarray, d: Triple) -> None:
    """Writes I - [d]x + [d]x^2 / 2 where A turns attitude errors; d is half the turn."""
    x, y, z = d[0], d[1], d[2]
    a[6, 6], a[6, 7], a[6, 8] = ONE - y * y / TWO - z * z / TWO, z + x * y / TWO, -y + x * z / TWO
    a[7, 6], a[7, 7], a[7, 8] = -z + x * y / TWO, ONE - x * x / TWO - z * z / TWO, x + y * z / TWO
    a[8, 6], a[8, 7], a[8, 8] = y + x * z / TWO, -x + y * z / TWO, ONE - x * x / TWO - y * y / TWO


@nb.njit()
def transform(a: np.ndarray, covariance: np.ndarray) -> None:
    """covariance = A covariance A'; row i of A is zero before its own block, and within it but for i in the first."""
    first = np.empty((9, 9), np.float32)
    for i in range(9):
        begin = 6 if i >= 6 else 3
        for j in range(9):
            total = a[i, i] * covariance[i, j] if i < 3 else ZERO
            for k in range(begin, 9):
                total += a[i, k] * covariance[k, j]
            first[i, j] = total
    for j in range(9):
        begin = 6 if j >= 6 else 3
        for i in range(9):
            total = first[i, j] * a[j, j] if j < 3 else ZERO
            for k in range(begin, 9):
                total += first[i, k] * a[j, k]
            covariance[i, j] = total


@nb.njit()
def turned(q: np.ndarray, v: Triple) -> Quaternion:
    """q times the rotation by v [rad], not normalised."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + _EPS
    c, sn = cosine(angle / TWO), sine(angle / TWO)
    x, y, z = sn * v[0] / angle, sn * v[1] / angle, sn * v[2] / angle
    return (c * q[0] - x * q[1] - y * q[2] - z * q[3], x * q[0] + c * q[1] + z * q[2] - y * q[3],
            y * q[0] - z * q[1] + c * q[2] + x * q[3], z * q[0] + y * q[1] - x * q[2] + c * q[3])


@nb.njit()
def normalised(q: Quaternion, into: np.ndarray) -> None:
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) + _EPS
    for k in range(4):
        into[k] = q[k] / norm
