"""A right-invariant extended Kalman filter on the recorded IMU, with drag as velocity information.

Error on SE_2(3) in the world frame, whose propagation depends on the estimate only through the biases. Biases are
appended, and the small constant rotation from the IMU to the tracked frame, as in the error-state filter.

References
----------
- Barrau, Bonnabel 2017, "The invariant extended Kalman filter as a stable observer", IEEE Transactions on Automatic
  Control 62(4).
- Hartley et al. 2020, "Contact-aided invariant extended Kalman filtering for robot state estimation", IJRR 39(4).
"""

from collections.abc import Mapping
from typing import ClassVar

import numba as nb
import numpy as np

from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import setting
from nanobench_tools.slices import put, put_matrix
from nanobench_tools.units import GRAVITY_M_S2

from . import inertial_core as core
from .inertial import rows_of, settings_of, values_of
from .inertial_core import rotation, small_angle, turned

ERROR = 18
"""Attitude, velocity, position (world), biases of gyro and accelerometer, rotation of the tracked frame."""

LOST_M_S = 1000.0
"""Maximum plausible speed. Beyond it (as in a log whose values continue along a line after the last packet) the
estimate ends."""


class InvariantEkf:
    """Right-invariant filter of poses, gyro, accelerometer and drag.

    States: attitude, velocity, position, biases and the tracked frame. A late pose is used at the row of its arrival,
    propagated with the filter's velocity and rate.

    Attributes
    ----------
    settings : mapping
        As of the other inertial methods, SI.
    """

    name = "invariant_ekf"
    causal = True
    settings: ClassVar[Mapping[str, float]] = setting("estimators.invariant_ekf.invariant_ekf")

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``imu`` and the poses in ``mocap``.

        Returns
        -------
        Estimate
            At the rows of the IMU, with covariance (n, 9, 9) and innovations of the poses; it ends where the filter is
            lost.

        Raises
        ------
        InputError
            As of the other inertial methods.
        """
        rows = rows_of(flight, radio=False)
        values = values_of(settings_of(self.settings, flight))
        n = len(rows.time_s)
        p, v, q, nis, cov = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 4)), np.empty(n), np.empty((n, 9, 9))
        _filter(rows.time_s, rows.acc, rows.gyro, rows.flying, rows.arrived, rows.pose_s, rows.poses, values, p, v, q,
                nis, cov)
        lost = ~(np.abs(v).max(axis=1) < LOST_M_S)
        n = int(np.argmax(lost)) if lost.any() else n
        nis = nis[:n][np.isfinite(nis[:n])]
        return Estimate(rows.time_s[:n], p[:n], q[:n], v[:n], cov[:n], nis, np.full(len(nis), 3))


@nb.njit(cache=True)
def _skew(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@nb.njit(cache=True)
def _jacobian(angle: np.ndarray) -> np.ndarray:
    """Left Jacobian of SO(3), to the second order in the rotation vector ``angle``."""
    k = _skew(angle)
    found = np.empty((3, 3))
    square = angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2]
    for i in range(3):
        for j in range(3):
            on = 1.0 - square / 6.0 if i == j else 0.0
            found[i, j] = on + 0.5 * k[i, j] + angle[i] * angle[j] / 6.0
    return found


@nb.njit(cache=True)
def _times(matrix: np.ndarray, v: np.ndarray) -> np.ndarray:
    """matrix (3, 3) times v (3,); for so few numbers a call of the library of linear algebra takes longer."""
    out = np.empty(3)
    for k in range(3):
        out[k] = matrix[k, 0] * v[0] + matrix[k, 1] * v[1] + matrix[k, 2] * v[2]
    return out


@nb.njit(cache=True)
def _crossed(v: np.ndarray, rot: np.ndarray, out: np.ndarray) -> None:
    """out (3, 3) = v x each column of rot."""
    for k in range(3):
        out[0, k] = v[1] * rot[2, k] - v[2] * rot[1, k]
        out[1, k] = v[2] * rot[0, k] - v[0] * rot[2, k]
        out[2, k] = v[0] * rot[1, k] - v[1] * rot[0, k]


@nb.njit(cache=True)
def _transition(c: np.ndarray, out: np.ndarray, dt: float, rot: np.ndarray, v_rot: np.ndarray,
                p_rot: np.ndarray) -> None:
    """out = (F c)^T for the transition F of one step. Gravity turns an error of attitude into one of velocity. Biases
    enter by the adjoint with the parts rot, v x rot and p x rot (3, 3)."""
    g = GRAVITY_M_S2 * dt
    for j in range(ERROR):
        for k in range(ERROR):
            out[j, k] = c[k, j]
        wx, wy, wz, fx, fy, fz = c[9, j], c[10, j], c[11, j], c[12, j], c[13, j], c[14, j]
        out[j, 3] += g * c[1, j]
        out[j, 4] -= g * c[0, j]
        out[j, 6] += 0.5 * dt * g * c[1, j]
        out[j, 7] -= 0.5 * dt * g * c[0, j]
        for k in range(3):
            out[j, k] -= dt * (rot[k, 0] * wx + rot[k, 1] * wy + rot[k, 2] * wz)
            out[j, 3 + k] -= dt * (v_rot[k, 0] * wx + v_rot[k, 1] * wy + v_rot[k, 2] * wz + rot[k, 0] * fx
                                   + rot[k, 1] * fy + rot[k, 2] * fz)
            out[j, 6 + k] += dt * (c[3 + k, j] - p_rot[k, 0] * wx - p_rot[k, 1] * wy - p_rot[k, 2] * wz)


@nb.njit(cache=True)
def _noise(cov: np.ndarray, turn: float, level: float, upright: float, rot: np.ndarray, v_rot: np.ndarray,
           p_rot: np.ndarray) -> None:
    """Adds that of a step to cov, in place: variances of the turn, and of the gain in velocity x, y and z (body)."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                cov[i, j] += turn * rot[i, k] * rot[j, k]
                cov[3 + i, 3 + j] += turn * v_rot[i, k] * v_rot[j, k]
                cov[3 + i, 3 + j] += (upright if k == 2 else level) * rot[i, k] * rot[j, k]
                cov[6 + i, 6 + j] += turn * p_rot[i, k] * p_rot[j, k]
                tv, tp = turn * rot[i, k] * v_rot[j, k], turn * rot[i, k] * p_rot[j, k]
                vp = turn * v_rot[i, k] * p_rot[j, k]
                cov[i, 3 + j] += tv
                cov[3 + j, i] += tv
                cov[i, 6 + j] += tp
                cov[6 + j, i] += tp
                cov[3 + i, 6 + j] += vp
                cov[6 + j, 3 + i] += vp


@nb.njit(cache=True)
def _filter(time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, flying: np.ndarray, arrived: np.ndarray,
            pose_s: np.ndarray, poses: np.ndarray, settings: np.ndarray, ps: np.ndarray, vs: np.ndarray,
            qs: np.ndarray, nis: np.ndarray, sds: np.ndarray) -> None:
    """Fill the reports of n rows:

    - position and velocity (n, 3), quaternion (n, 4);
    - the squared innovation of the positions of a row's poses (n,) (nan without any);
    - the covariance (n, 9, 9) of position and velocity (world) and attitude (body).
    """
    n = len(time_s)
    p, q, v = poses[0, :3].copy(), poses[0, 3:].copy(), np.zeros(3)
    bg, ba, mount = np.zeros(3), np.zeros(3), np.zeros(3)
    cov = np.zeros((ERROR, ERROR))
    for k in range(3):
        cov[k, k], cov[3 + k, 3 + k] = settings[core.START_TILT_SD] ** 2, settings[core.START_VELOCITY_SD] ** 2
        cov[6 + k, 6 + k], cov[9 + k, 9 + k] = settings[core.START_POSITION_SD] ** 2, settings[core.GYRO_BIAS_SD] ** 2
        cov[12 + k, 12 + k] = settings[core.ACC_BIAS_SD if k < 2 else core.ACC_BIAS_Z_SD] ** 2
        cov[15 + k, 15 + k] = settings[core.MOUNT_SD] ** 2
    # where the first pose is does not depend on how the vehicle is turned there
    place = _skew(p)
    put_matrix(cov[6:9, 0:3], place * settings[core.START_TILT_SD] ** 2)
    put_matrix(cov[0:3, 6:9], cov[6:9, 0:3].T)
    for i in range(3):
        for j in range(3):
            cov[6 + i, 6 + j] += np.sum(place[i] * place[j]) * settings[core.START_TILT_SD] ** 2
    other, v_rot, p_rot, half_out = np.empty((ERROR, ERROR)), np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9))
    x, h, ph, gain = np.zeros(ERROR), np.zeros(ERROR), np.empty(ERROR), np.empty(ERROR)
    drag, back_row = settings[core.DRAG], 0
    for i in range(n):
        if i > 0:
            dt = time_s[i] - time_s[i - 1]
            f, w = 0.5 * (acc[i] + acc[i - 1]) - ba, 0.5 * (gyro[i] + gyro[i - 1]) - bg
            rot = rotation(turned(q, 0.5 * dt * w[0], 0.5 * dt * w[1], 0.5 * dt * w[2]))
            a = _times(rot, f)
            a[2] -= GRAVITY_M_S2
            _crossed(v, rot, v_rot)
            _crossed(p, rot, p_rot)
            _transition(cov, other, dt, rot, v_rot, p_rot)
            _transition(other, cov, dt, rot, v_rot, p_rot)
            while back_row < i - 1 and time_s[i] - time_s[back_row + 1] >= settings[core.CHANGE_S]:
                back_row += 1
            level, upright, turn = core.stamp_noise(time_s, acc, gyro, i, back_row, settings[core.STAMP])
            _noise(cov, (settings[core.GYRO_NOISE] ** 2 + turn) * dt, (settings[core.ACC_NOISE] ** 2 + level) * dt,
                   (settings[core.VERTICAL_NOISE] ** 2 + upright) * dt, rot, v_rot, p_rot)
            for k in range(3):
                cov[9 + k, 9 + k] += settings[core.GYRO_WALK] ** 2 * dt
                cov[12 + k, 12 + k] += settings[core.ACC_WALK] ** 2 * dt
                cov[15 + k, 15 + k] += settings[core.MOUNT_WALK] ** 2 * dt
                cov[6 + k, 6 + k] += 1e-10 * dt
            p = p + dt * v + 0.5 * dt * dt * a
            v = v + dt * a
            q = turned(q, dt * w[0], dt * w[1], dt * w[2])
        x[:] = 0.0
        rot = rotation(q)
        nis[i] = 0.0 if arrived[i + 1] > arrived[i] else np.nan
        for j in range(arrived[i], arrived[i + 1]):
            late = time_s[i] - pose_s[j]
            now, rate = poses[j, :3] + late * v, late * (gyro[i] - bg)
            off = small_angle(q, turned(poses[j, 3:], rate[0], rate[1], rate[2]))
            place = _skew(p - late * v)
            for k in range(3):
                h[:] = 0.0
                h[6 + k], h[3 + k] = 1.0, -late
                put(h, -place[k])
                nis[i] += _scalar(cov, x, h, now[k] - p[k], settings[core.POSITION_SD] ** 2, ph, gain)
            for k in range(3):
                h[:] = 0.0
                put(h, rot[:, k])
                h[15 + k] = 1.0
                sd = settings[core.YAW_SD if k == 2 else (core.PITCH_SD if k == 1 else core.ROLL_PITCH_SD)]
                _scalar(cov, x, h, off[k] - mount[k], sd ** 2, ph, gain)
        if flying[i] and drag > 0.0:
            for k in range(2):
                h[:] = 0.0
                put(h[3:], -drag * rot[:, k])
                h[12 + k] = 1.0
                body = rot[0, k] * v[0] + rot[1, k] * v[1] + rot[2, k] * v[2]
                _scalar(cov, x, h, acc[i, k] - ba[k] + drag * body, settings[core.DRAG_SD] ** 2, ph, gain)
        turn_by = rotation(turned(np.array([0.0, 0.0, 0.0, 1.0]), x[0], x[1], x[2]))
        jacobian = _jacobian(x[0:3])
        p, v = _times(turn_by, p) + _times(jacobian, x[6:9]), _times(turn_by, v) + _times(jacobian, x[3:6])
        back = _times(rot.T, x[0:3])
        q = turned(q, back[0], back[1], back[2])
        bg, ba, mount = bg + x[9:12], ba + x[12:15], mount + x[15:18]
        put(ps[i], p)
        put(vs[i], v)
        put(qs[i], q)
        rot = rotation(q)
        _given_out(cov, half_out, p, v, rot)
        _given_out(half_out, sds[i], p, v, rot)


@nb.njit(cache=True)
def _given_out(c: np.ndarray, out: np.ndarray, p: np.ndarray, v: np.ndarray, rot: np.ndarray) -> None:
    """out (9, 9) = (B c)^T. B gives errors of position, velocity (world) and attitude (body) from the invariant ones,
    to first order. A world rotation theta moves the position by theta x p. Applied twice, it gives the covariance."""
    for j in range(9):
        x, y, z = c[0, j], c[1, j], c[2, j]
        out[j, 0] = c[6, j] + y * p[2] - z * p[1]
        out[j, 1] = c[7, j] + z * p[0] - x * p[2]
        out[j, 2] = c[8, j] + x * p[1] - y * p[0]
        out[j, 3] = c[3, j] + y * v[2] - z * v[1]
        out[j, 4] = c[4, j] + z * v[0] - x * v[2]
        out[j, 5] = c[5, j] + x * v[1] - y * v[0]
        for k in range(3):
            out[j, 6 + k] = rot[0, k] * x + rot[1, k] * y + rot[2, k] * z


@nb.njit(cache=True)
def _scalar(cov: np.ndarray, x: np.ndarray, h: np.ndarray, innovation: float, variance: float, ph: np.ndarray,
            gain: np.ndarray) -> float:
    """One scalar measurement, in place, Joseph's form; its normalised squared innovation."""
    ph[:] = 0.0
    for k in range(ERROR):
        if h[k] != 0.0:
            innovation -= h[k] * x[k]
            for i in range(ERROR):
                ph[i] += h[k] * cov[k, i]
    s = variance
    for k in range(ERROR):
        s += h[k] * ph[k]
    for i in range(ERROR):
        gain[i] = ph[i] / s
        x[i] += gain[i] * innovation
    for i in range(ERROR):
        for j in range(i + 1):
            cov[i, j] += s * gain[i] * gain[j] - gain[i] * ph[j] - ph[i] * gain[j]
            cov[j, i] = cov[i, j]
    return innovation * innovation / s
