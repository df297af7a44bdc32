"""Rotations: quaternions x, y, z, w, body to world (see ``frames``); batched over leading rows.

Exponential and logarithm come from SciPy. This file has what SciPy lacks, or computes per object. For 3,000 rows
SciPy's product takes 28 times as long, Euler angles 4 (from them 13), Slerp 3. Slerp also refuses two rows of one
timestamp.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """(..., 4) unit quaternions -> (..., 3, 3) rotation matrices body to world."""
    return np.asarray(Rotation.from_quat(quaternion).as_matrix())


def exp(rotation_vector: np.ndarray) -> np.ndarray:
    """(..., 3) rotation vectors [rad] -> (..., 4) quaternions."""
    return np.asarray(Rotation.from_rotvec(rotation_vector).as_quat())


def log(quaternion: np.ndarray) -> np.ndarray:
    """(..., 4) quaternions -> (..., 3) rotation vectors [rad], length at most pi."""
    return np.asarray(Rotation.from_quat(quaternion).as_rotvec())


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions, (..., 4) with broadcasting: R(multiply(a, b)) = R(a) R(b)."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    out[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return out


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of (..., 3) vectors with broadcasting; ``numpy.cross`` takes ten times as long for one row."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def conjugate(quaternion: np.ndarray) -> np.ndarray:
    """Inverse of unit quaternions, (..., 4)."""
    turned: np.ndarray = np.asarray(quaternion, float) * np.array([-1.0, -1.0, -1.0, 1.0])
    return turned


def rotate(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Body vectors (..., 3) into the world by quaternions (..., 4), with broadcasting."""
    q, v = np.asarray(quaternion, float), np.asarray(vector, float)
    t = 2.0 * cross(q[..., :3], v)
    turned: np.ndarray = v + q[..., 3:] * t + cross(q[..., :3], t)
    return turned


def rotate_inverse(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """World vectors (..., 3) into the body by quaternions (..., 4), with broadcasting."""
    return rotate(conjugate(quaternion), vector)


def geodesic_angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle of the rotation between (..., 4) quaternions [rad, 0..pi]; q and -q are the same rotation.

    Uses atan2 of vector and scalar part, exact to rounding also for tiny angles, where arccos is not. The vector part
    is summed in pairs that cancel, so that equal rotations have an angle of exactly 0.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    vector = a[..., 3:] * b[..., :3] - b[..., 3:] * a[..., :3] - cross(a[..., :3], b[..., :3])
    angle: np.ndarray = 2.0 * np.arctan2(np.linalg.norm(vector, axis=-1), np.abs(np.sum(a * b, axis=-1)))
    return angle


def make_continuous(quaternion: np.ndarray) -> np.ndarray:
    """(n, 4) -> the same rotations with signs chosen so that neighbours have a positive dot product."""
    q = np.array(quaternion, dtype=float)
    if len(q) > 1:
        flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
        q[1:] *= np.cumprod(flips)[:, None]
    return q


def euler_zyx(quaternion: np.ndarray) -> np.ndarray:
    """(..., 4) quaternions -> (..., 3) roll, pitch, yaw [rad]; atan2/arcsin form, no error at pitch 90 deg."""
    q = np.asarray(quaternion, float)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    xx, yy, zz = x * x, y * y, z * z
    norm = xx + yy + zz + w * w
    out = np.empty((*q.shape[:-1], 3))
    out[..., 0] = np.arctan2(2 * (w * x + y * z), norm - 2 * (xx + yy))
    out[..., 1] = np.arcsin(np.minimum(np.maximum(2 * (w * y - z * x) / norm, -1.0), 1.0))
    out[..., 2] = np.arctan2(2 * (w * z + x * y), norm - 2 * (yy + zz))
    return out


def from_euler_zyx(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> np.ndarray:
    """Roll, pitch, yaw [rad], each (...) -> (..., 4) quaternions."""
    cr, sr = np.cos(np.asarray(roll) / 2), np.sin(np.asarray(roll) / 2)
    cp, sp = np.cos(np.asarray(pitch) / 2), np.sin(np.asarray(pitch) / 2)
    cy, sy = np.cos(np.asarray(yaw) / 2), np.sin(np.asarray(yaw) / 2)
    return np.stack([sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                     cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy], axis=-1)


def hat(vector: np.ndarray) -> np.ndarray:
    """(..., 3) -> (..., 3, 3) skew matrices: hat(a) b = a x b."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def wrap_angle(angle: ArrayLike) -> Any:
    """Angles [rad] into [-pi, pi)."""
    return (np.asarray(angle, float) + np.pi) % (2.0 * np.pi) - np.pi


def interpolate(time_s: np.ndarray, quaternion: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Rotations at ``at_s`` (m,) by great-circle interpolation of (n, 4) at rising ``time_s`` (n,); ends are held."""
    t = np.asarray(time_s, float)
    q = make_continuous(quaternion)
    at = np.clip(np.asarray(at_s, float), t[0], t[-1])
    if len(t) == 1:
        return np.broadcast_to(q, (len(at), 4)).copy()
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    s = (at - t[i]) / (t[i + 1] - t[i])
    return multiply(q[i], exp(s[:, None] * log(multiply(conjugate(q[i]), q[i + 1]))))
