"""Dead reckoning by an error-state extended Kalman filter on the recorded IMU, with drag as velocity information.

State: position, velocity (world), attitude, biases of accelerometer and gyro, and the small constant rotation from the
IMU to the tracked body frame. Propagation and error dynamics after Sola, "Quaternion kinematics for the error-state
Kalman filter" (2017), section 5 (local angular error). A quadrotor's accelerometer feels no thrust across its rotor
axis, only drag, so its x and y say -k v (Leishman et al., "Quadrotors and accelerometers", IEEE Control Systems 2014).
"""

from __future__ import annotations

import numba as nb
import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.units import GRAVITY_M_S2

ACC = ("acc_x", "acc_y", "acc_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")

GYRO_NOISE, ACC_NOISE = 0.03, 0.03
"""rad/s and m/s^2 per root Hz: ten times the sensor's, for vibration, bursts of the radio and their times."""

GYRO_WALK, ACC_WALK = 1e-4, 1e-2
POSITION_SD_M, ATTITUDE_SD_RAD = 0.01, 0.1
"""Of a given pose; the attitude counts little, because tilt and gravity agree in it to half a degree only."""

MOUNT_SD_RAD, ACC_BIAS_SD, GYRO_BIAS_SD = 0.05, 0.3, 0.03
"""Before anything is seen: rotation of the tracked frame, biases in m/s^2 and rad/s."""

DRAG_1_S, DRAG_SD_M_S2 = 0.40, 0.6
"""Linear drag of a 40 g Crazyflie over its mass, and the scatter of the accelerometer about it, row by row."""

STALE_S = 0.02
"""A pose counts at the row that follows it by less than this."""


class ErrorStateEkf:
    """Poses are used while they come; afterwards position follows from gyro, accelerometer and drag alone."""

    name = "error_state_ekf"
    causal = True
    drag_1_s = DRAG_1_S

    def estimate(self, flight: Flight) -> Estimate:
        """InputError without IMU or without a second of poses."""
        imu, mocap = flight["imu"], flight["mocap"]
        good = np.isfinite(imu[ACC]).all(axis=1) & np.isfinite(imu[GYRO]).all(axis=1)
        time_s = imu.time_s[good]
        begin = np.searchsorted(time_s, mocap.time_s[0]) if len(mocap) else 0
        if len(mocap) < 20 or begin + 2 > len(time_s) or mocap.time_s[-1] - mocap.time_s[0] < 1.0:
            raise InputError(flight.provenance.path, "dead reckoning needs an IMU and a second of poses to start from")
        rising = np.concatenate(([True], np.diff(time_s) > 0.0))
        time_s, acc, gyro = (v[rising][begin:] for v in (time_s, imu[ACC][good], imu[GYRO][good]))
        at = np.searchsorted(mocap.time_s, time_s, side="right") - 1
        fresh = (time_s - mocap.time_s[at] < STALE_S) & np.concatenate(([True], np.diff(at) > 0))
        poses = mocap[POSE]
        poses[:, 3:] = so3.make_continuous(poses[:, 3:])
        p, v, q = _filter(time_s, acc, gyro, fresh, poses[at], self.drag_1_s)
        return Estimate(time_s, p, q, v)


class Strapdown(ErrorStateEkf):
    """The same filter without drag: after the last pose, plain integration of the IMU."""

    name = "strapdown"
    drag_1_s = 0.0


@nb.njit(cache=True)
def _rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


@nb.njit(cache=True)
def _turned(q: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """q times the rotation by the vector ``angle`` [rad], of unit length."""
    half = 0.5 * np.sqrt(angle @ angle)
    s = 0.5 if half < 1e-9 else 0.5 * np.sin(half) / half
    dx, dy, dz, dw = s * angle[0], s * angle[1], s * angle[2], np.cos(half)
    x, y, z, w = q
    r = np.array([w * dx + x * dw + y * dz - z * dy, w * dy - x * dz + y * dw + z * dx,
                  w * dz + x * dy - y * dx + z * dw, w * dw - x * dx - y * dy - z * dz])
    return r / np.sqrt(r @ r)


@nb.njit(cache=True)
def _skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@nb.njit(cache=True)
def _filter(time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, fresh: np.ndarray, poses: np.ndarray,
            drag: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity (n, 3), quaternion (n, 4) at the rows; the value at a row uses nothing later."""
    n = len(time_s)
    positions, velocities, quaternions = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 4))
    p, q, v = poses[0, :3].copy(), poses[0, 3:].copy(), np.zeros(3)
    ba, bg, mount = np.zeros(3), np.zeros(3), np.zeros(3)
    cov = np.diag(np.array([1e-4] * 3 + [0.25] * 3 + [1e-2] * 3 + [ACC_BIAS_SD**2] * 3 + [GYRO_BIAS_SD**2] * 3
                           + [MOUNT_SD_RAD**2] * 3))
    up = np.array([0.0, 0.0, GRAVITY_M_S2])
    eye = np.eye(18)
    for i in range(n):
        if i > 0:
            dt = time_s[i] - time_s[i - 1]
            rot = _rotation(q)
            force = 0.5 * (acc[i] + acc[i - 1]) - ba
            rate = 0.5 * (gyro[i] + gyro[i - 1]) - bg
            a = rot @ force - up
            p = p + v * dt + 0.5 * a * dt * dt
            v = v + a * dt
            q = _turned(q, rate * dt)
            f = eye.copy()
            for k in range(3):
                f[k, 3 + k] = dt
            f[3:6, 6:9] = -(rot @ _skew(force)) * dt
            f[3:6, 9:12] = -rot * dt
            f[6:9, 6:9] = eye[:3, :3] - _skew(rate) * dt
            f[6:9, 12:15] = -eye[:3, :3] * dt
            cov = f @ cov @ f.T
            for k in range(3):
                cov[3 + k, 3 + k] += ACC_NOISE**2 * dt
                cov[6 + k, 6 + k] += GYRO_NOISE**2 * dt
                cov[9 + k, 9 + k] += ACC_WALK**2 * dt
                cov[12 + k, 12 + k] += GYRO_WALK**2 * dt
        rot = _rotation(q)
        h = np.zeros((8, 18))
        innovation, variance, used = np.zeros(8), np.ones(8), np.zeros(8, np.bool_)
        if fresh[i]:
            w = poses[i, 3:]
            sign = 1.0 if w @ q >= 0.0 else -1.0
            # vector part of conj(q) * w, twice: the small angle from the estimate to the pose, in the body
            angle = 2.0 * sign * np.array([q[3] * w[0] - q[0] * w[3] - q[1] * w[2] + q[2] * w[1],
                                           q[3] * w[1] + q[0] * w[2] - q[1] * w[3] - q[2] * w[0],
                                           q[3] * w[2] - q[0] * w[1] + q[1] * w[0] - q[2] * w[3]])
            for k in range(3):
                h[k, k], h[3 + k, 6 + k], h[3 + k, 15 + k] = 1.0, 1.0, 1.0
                innovation[k], innovation[3 + k] = poses[i, k] - p[k], angle[k] - mount[k]
                variance[k], variance[3 + k] = POSITION_SD_M**2, ATTITUDE_SD_RAD**2
                used[k], used[3 + k] = True, True
        if drag > 0.0:
            body = rot.T @ v
            turn = _skew(body)
            for k in range(2):
                h[6 + k, 3:6] = -drag * rot[:, k]
                h[6 + k, 6:9] = -drag * turn[k]
                h[6 + k, 9 + k] = 1.0
                innovation[6 + k] = acc[i, k] - ba[k] + drag * body[k]
                variance[6 + k] = DRAG_SD_M_S2**2
                used[6 + k] = True
        x = np.zeros(18)
        for k in range(8):
            if used[k]:
                ph = cov @ h[k]
                gain = ph / (h[k] @ ph + variance[k])
                x = x + gain * (innovation[k] - h[k] @ x)
                cov = cov - np.outer(gain, ph)
        cov = 0.5 * (cov + cov.T)
        p, v, q = p + x[:3], v + x[3:6], _turned(q, x[6:9])
        ba, bg, mount = ba + x[9:12], bg + x[12:15], mount + x[15:18]
        positions[i], velocities[i], quaternions[i] = p, v, q
    return positions, velocities, quaternions
