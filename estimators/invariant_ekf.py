"""A right-invariant extended Kalman filter on the recorded IMU, with drag as velocity information.

Error on SE_2(3) in the world frame: its propagation does not depend on the estimate but for the biases. After Barrau
and Bonnabel, "The invariant extended Kalman filter as a stable observer" (IEEE TAC 2017), and Hartley et al.,
"Contact-aided invariant extended Kalman filtering for robot state estimation" (IJRR 2020), with biases appended.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.units import GRAVITY_M_S2

from .inertial import rows_of
from .inertial_core import rotation, small_angle, turned

GYRO_NOISE, ACC_NOISE, GYRO_WALK, ACC_WALK = 0.03, 0.03, 1e-4, 3e-3
POSITION_SD_M, ATTITUDE_SD_RAD = 0.01, 0.1
DRAG_1_S, DRAG_SD_M_S2 = 0.40, 0.2


class InvariantEkf:
    """States: attitude, velocity, position and the biases; a late pose is used at the row of its arrival, moved on
    with the velocity and the rate that the filter has."""

    name = "invariant_ekf"
    causal = True

    def estimate(self, flight: Flight) -> Estimate:
        """InputError as of the other inertial rows."""
        rows = rows_of(flight, radio=False)
        noise = np.hypot(POSITION_SD_M, float(flight.metadata.get("pose_noise_m", 0.0)))
        p, v, q = _filter(rows.time_s, rows.acc, rows.gyro, rows.flying, rows.arrived, rows.pose_s, rows.poses, noise)
        return Estimate(rows.time_s, p, q, v)


@nb.njit(cache=True)
def _skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@nb.njit(cache=True)
def _jacobian(angle: np.ndarray) -> np.ndarray:
    """Left Jacobian of SO(3), to the second order in the rotation vector ``angle``."""
    k = _skew(angle)
    return np.eye(3) + 0.5 * k + k @ k / 6.0


@nb.njit(cache=True)
def _filter(time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, flying: np.ndarray, arrived: np.ndarray,
            pose_s: np.ndarray, poses: np.ndarray, noise_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity (n, 3), quaternion (n, 4). Error: attitude, velocity, position (world), biases."""
    n = len(time_s)
    ps, vs, qs = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 4))
    p, q, v, bg, ba = poses[0, :3].copy(), poses[0, 3:].copy(), np.zeros(3), np.zeros(3), np.zeros(3)
    cov = np.diag(np.array([1e-2] * 3 + [0.25] * 3 + [1e-3] * 3 + [1e-3] * 3 + [0.09] * 3))
    eye = np.eye(15)
    g = np.array([0.0, 0.0, -GRAVITY_M_S2])
    for i in range(n):
        if i > 0:
            dt = time_s[i] - time_s[i - 1]
            f, w = 0.5 * (acc[i] + acc[i - 1]) - ba, 0.5 * (gyro[i] + gyro[i - 1]) - bg
            rot = rotation(turned(q, 0.5 * dt * w[0], 0.5 * dt * w[1], 0.5 * dt * w[2]))
            a = rot @ f + g
            step = eye.copy()
            step[3:6, 0:3] += _skew(g) * dt
            step[6:9, 0:3] += 0.5 * _skew(g) * dt * dt
            for k in range(3):
                step[6 + k, 3 + k] += dt
            adjoint = np.zeros((9, 6))
            adjoint[0:3, 0:3], adjoint[3:6, 0:3], adjoint[6:9, 0:3] = rot, _skew(v) @ rot, _skew(p) @ rot
            adjoint[3:6, 3:6] = rot
            step[0:9, 9:15] -= adjoint * dt
            cov = step @ cov @ step.T
            noise = np.diag(np.array([GYRO_NOISE**2] * 3 + [ACC_NOISE**2] * 3)) * dt
            cov[0:9, 0:9] += adjoint @ noise @ adjoint.T
            for k in range(3):
                cov[9 + k, 9 + k] += GYRO_WALK**2 * dt
                cov[12 + k, 12 + k] += ACC_WALK**2 * dt
                cov[6 + k, 6 + k] += 1e-10 * dt
            p = p + dt * v + 0.5 * dt * dt * a
            v = v + dt * a
            q = turned(q, dt * w[0], dt * w[1], dt * w[2])
        x = np.zeros(15)
        rot = rotation(q)
        for j in range(arrived[i], arrived[i + 1]):
            late = time_s[i] - pose_s[j]
            now, rate = poses[j, :3] + late * v, late * (gyro[i] - bg)
            off = rot @ small_angle(q, turned(poses[j, 3:], rate[0], rate[1], rate[2]))
            place = _skew(p)
            for k in range(3):
                h = np.zeros(15)
                h[6 + k] = 1.0
                h[0:3] = -place[k]
                cov, x = _scalar(cov, x, h, now[k] - p[k], noise_m**2)
            for k in range(3):
                h = np.zeros(15)
                h[k] = 1.0
                cov, x = _scalar(cov, x, h, off[k], ATTITUDE_SD_RAD**2)
        if flying[i]:
            body = rot.T @ v
            for k in range(2):
                h = np.zeros(15)
                h[3:6] = -DRAG_1_S * rot[:, k]
                h[12 + k] = 1.0
                cov, x = _scalar(cov, x, h, acc[i, k] - ba[k] + DRAG_1_S * body[k], DRAG_SD_M_S2**2)
        turn = rotation(turned(np.array([0.0, 0.0, 0.0, 1.0]), x[0], x[1], x[2]))
        jacobian = _jacobian(x[0:3])
        p, v = turn @ p + jacobian @ x[6:9], turn @ v + jacobian @ x[3:6]
        back = rot.T @ x[0:3]
        q = turned(q, back[0], back[1], back[2])
        bg, ba = bg + x[9:12], ba + x[12:15]
        ps[i], vs[i], qs[i] = p, v, q
    return ps, vs, qs


@nb.njit(cache=True)
def _scalar(cov: np.ndarray, x: np.ndarray, h: np.ndarray, innovation: float,
            variance: float) -> tuple[np.ndarray, np.ndarray]:
    """One scalar measurement; Joseph's form."""
    ph = cov @ h
    s = h @ ph + variance
    gain = ph / s
    x = x + gain * (innovation - h @ x)
    cov = cov - np.outer(gain, ph) - np.outer(ph, gain) + s * np.outer(gain, gain)
    return 0.5 * (cov + cov.T), x
