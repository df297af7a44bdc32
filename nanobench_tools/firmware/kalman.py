"""The Kalman filter's core (kalman_core.c, mm_position.c, mm_pose.c, kalman_core_params_defaults.h of 2025.12.1).

State: position [m, world], velocity [m/s, **body**], attitude error [rad, body]. In addition a quaternion w, x, y, z
(body to world) and its rotation matrix, which changes only in ``finalize``. No biases and no wind: in flight the
horizontal specific force is not used. Products with a zero of a sparse matrix are left out; they change no digit.

Drag is that of 2026.04 (pull request 1584): -b v + b (w x r) per body axis. Here b is ``drag_1_s``
(``kalman.dragB_x`` ...) and r is ``pressure_m`` (``kalman.cop_x`` ...). The firmware documents b in N s/m but
multiplies velocities by it without a mass. Its unit is therefore 1/s. With b = 0, the default, the filter is that of
2025.12.1 to the last digit.
"""

import math
from collections.abc import Callable

import numba as nb
import numpy as np

from .float32 import GRAVITY, ONE, TWO, ZERO, F, Real, Triple
from .kalman_algebra import HALF, attitude_block, bound, bounded, cosine, normalised, sine, transform, turned
from .kept import kept
from .records import Record

X, PX, D0 = 0, 3, 6
"""Where position, velocity and attitude error begin among the nine states."""

PARAMETERS = np.dtype([("sd_xy_m", "f4"), ("sd_z_m", "f4"), ("sd_velocity_m_s", "f4"), ("sd_tilt_rad", "f4"),
                       ("sd_yaw_rad", "f4"), ("acc_xy_m_s2", "f4"), ("acc_z_m_s2", "f4"), ("velocity_m_s", "f4"),
                       ("position_m", "f4"), ("attitude_rad", "f4"), ("gyro_tilt_rad_s", "f4"),
                       ("gyro_yaw_rad_s", "f4"), ("initial_m", "f4", 3), ("initial_yaw_rad", "f4"),
                       ("reversion", "f4"), ("max_position_m", "f4"), ("max_velocity_m_s", "f4"), ("drag_1_s", "f4", 3),
                       ("pressure_m", "f4", 3)], align=True)
"""Group ``kalman``: initial values and their SD, process noise, and how fast an attitude on the ground returns to the
first one. Also the limit of the state beyond which the filter restarts (0: never), drag and its centre of pressure."""

CORE = np.dtype([("state", "f4", 9), ("quaternion", "f4", 4), ("rotation", "f4", (3, 3)), ("covariance", "f4", (9, 9)),
                 ("initial", "f4", 4), ("predicted_ms", "i8"), ("noise_ms", "i8"), ("updated", "i1")], align=True)
"""The filter; ``initial`` is the quaternion it started from, ``updated`` whether there is something to finalize."""

OPERATION = np.dtype([("kind", "i1"), ("flying", "i1"), ("t_ms", "i8"), ("value", "f4", 9)], align=True)
INIT, PREDICT, NOISE, POSITION, POSE, FINALIZE = range(6)
"""Kinds of OPERATION. ``value`` of PREDICT: specific force [m/s^2], rate [rad/s]; POSITION: m, and sd [m] in place 7;
POSE: m, quaternion x, y, z, w, sd [m], sd [rad]."""

POSITION_SD_M, ATTITUDE_SD_RAD = 0.01, 4.5e-3
"""Of a pose, by default (locSrv.extPosStdDev, extQuatStdDev)."""

_MS = F(1000.0)
_SMALL, _LARGE = F(1e-4), F(10.0)
"""Attitude errors are put into the quaternion between these [rad]; outside they are forgotten."""


def defaults(n: int = 1) -> np.ndarray:
    """(n,) PARAMETERS as released."""
    found = np.zeros(n, PARAMETERS)
    found["sd_xy_m"], found["sd_z_m"], found["sd_velocity_m_s"] = 100.0, 1.0, 0.01
    found["sd_tilt_rad"], found["sd_yaw_rad"] = 0.01, 0.01
    found["acc_xy_m_s2"], found["acc_z_m_s2"] = 0.5, 1.0
    found["gyro_tilt_rad_s"], found["gyro_yaw_rad_s"], found["reversion"] = 0.1, 0.1, 0.001
    found["max_position_m"], found["max_velocity_m_s"] = 100.0, 10.0
    return found


@nb.njit()
def initialize(p: Record, s: Record, now_ms: int) -> None:
    """kalmanCoreInit: the rotation matrix stays the identity until the first ``finalize``, at any yaw."""
    for i in range(9):
        s.state[i] = ZERO
        for j in range(9):
            s.covariance[i, j] = ZERO
    for k in range(3):
        s.state[k] = p.initial_m[k]
        for j in range(3):
            s.rotation[k, j] = ONE if j == k else ZERO
        s.covariance[PX + k, PX + k] = p.sd_velocity_m_s * p.sd_velocity_m_s
    half = p.initial_yaw_rad / TWO
    s.initial[0], s.initial[1], s.initial[2], s.initial[3] = cosine(half), ZERO, ZERO, sine(half)
    for k in range(4):
        s.quaternion[k] = s.initial[k]
    s.covariance[0, 0] = s.covariance[1, 1] = p.sd_xy_m * p.sd_xy_m
    s.covariance[2, 2] = p.sd_z_m * p.sd_z_m
    s.covariance[D0, D0] = s.covariance[D0 + 1, D0 + 1] = p.sd_tilt_rad * p.sd_tilt_rad
    s.covariance[D0 + 2, D0 + 2] = p.sd_yaw_rad * p.sd_yaw_rad
    s.predicted_ms = s.noise_ms = now_ms
    s.updated = 0


@nb.njit()
def predict(p: Record, s: Record, acc: np.ndarray, rate: np.ndarray, now_ms: int, flying: bool) -> None:
    """kalmanCorePredict: acc (3,) specific force [m/s^2], rate (3,) [rad/s], both held since the last prediction."""
    dt = F(now_ms - s.predicted_ms) / _MS
    r, v = s.rotation, (s.state[PX], s.state[PX + 1], s.state[PX + 2])
    a = np.zeros((9, 9), np.float32)
    for i in range(3):
        a[i, i] = ONE
        for j in range(3):
            a[i, PX + j] = r[i, j] * dt
        a[i, D0] = (v[1] * r[i, 2] - v[2] * r[i, 1]) * dt
        a[i, D0 + 1] = (-v[0] * r[i, 2] + v[2] * r[i, 0]) * dt
        a[i, D0 + 2] = (v[0] * r[i, 1] - v[1] * r[i, 0]) * dt
    a[3, 3], a[3, 4], a[3, 5] = ONE, rate[2] * dt, -rate[1] * dt
    a[4, 3], a[4, 4], a[4, 5] = -rate[2] * dt, ONE, rate[0] * dt
    a[5, 3], a[5, 4], a[5, 5] = rate[1] * dt, -rate[0] * dt, ONE
    a[3, 7], a[3, 8] = GRAVITY * r[2, 2] * dt, -GRAVITY * r[2, 1] * dt
    a[4, 6], a[4, 8] = -GRAVITY * r[2, 2] * dt, GRAVITY * r[2, 0] * dt
    a[5, 6], a[5, 7] = GRAVITY * r[2, 1] * dt, -GRAVITY * r[2, 0] * dt
    for i in range(3):
        a[PX + i, PX + i] -= dt * p.drag_1_s[i]
    attitude_block(a, (rate[0] * dt / TWO, rate[1] * dt / TWO, rate[2] * dt / TWO))
    transform(a, s.covariance)
    _move(p, s, acc, rate, v, dt, flying)
    q = turned(s.quaternion, (dt * rate[0], dt * rate[1], dt * rate[2]))
    if not flying:
        keep, back = ONE - p.reversion, p.reversion
        q = (keep * q[0] + back * s.initial[0], keep * q[1] + back * s.initial[1],
             keep * q[2] + back * s.initial[2], keep * q[3] + back * s.initial[3])
    normalised(q, s.quaternion)
    s.predicted_ms, s.updated = now_ms, 1


@nb.njit(inline="always")
def _move(p: Record, s: Record, acc: np.ndarray, rate: np.ndarray, v: Triple, dt: Real, flying: bool) -> None:
    """Position and velocity over one prediction; v (3,) is the old velocity. In flight thrust and drag push."""
    x, r, dt2 = s.state, s.rotation, dt * dt
    ax, ay = (ZERO, ZERO) if flying else (acc[0], acc[1])
    dx, dy, dz = v[0] * dt + ax * dt2 / TWO, v[1] * dt + ay * dt2 / TWO, v[2] * dt + acc[2] * dt2 / TWO
    for i in range(3):
        fall = GRAVITY * dt2 / TWO if i == 2 else ZERO
        x[i] += r[i, 0] * dx + r[i, 1] * dy + r[i, 2] * dz - fall
    b, c = p.drag_1_s, p.pressure_m
    bx, by, bz = (b[0], b[1], b[2]) if flying else (ZERO, ZERO, ZERO)
    x[PX] += dt * (ax + rate[2] * v[1] - rate[1] * v[2] - GRAVITY * r[2, 0]
                   - bx * v[0] + bx * (rate[1] * c[2] - rate[2] * c[1]))
    x[PX + 1] += dt * (ay - rate[2] * v[0] + rate[0] * v[2] - GRAVITY * r[2, 1]
                       - by * v[1] + by * (rate[2] * c[0] - rate[0] * c[2]))
    x[PX + 2] += dt * (acc[2] + rate[1] * v[0] - rate[0] * v[1] - GRAVITY * r[2, 2]
                       - bz * v[2] + bz * (rate[0] * c[1] - rate[1] * c[0]))


@nb.njit()
def add_noise(p: Record, s: Record, now_ms: int) -> None:
    """kalmanCoreAddProcessNoise; nothing if no time has passed."""
    dt = F(now_ms - s.noise_ms) / _MS
    if not dt > ZERO:
        return
    for k in range(3):
        acc = p.acc_z_m_s2 if k == 2 else p.acc_xy_m_s2
        gyro = p.gyro_yaw_rad_s if k == 2 else p.gyro_tilt_rad_s
        place, speed = acc * dt * dt + p.velocity_m_s * dt + p.position_m, acc * dt + p.velocity_m_s
        turn = gyro * dt + p.attitude_rad
        s.covariance[k, k] += place * place
        s.covariance[PX + k, PX + k] += speed * speed
        s.covariance[D0 + k, D0 + k] += turn * turn
    bound(s.covariance)
    s.noise_ms = now_ms


@nb.njit(error_model="numpy")
def update(s: Record, k: int, error: Real, sd: Real) -> None:
    """kalmanCoreScalarUpdate for a measurement of state k that is off by ``error``, Joseph form."""
    c = s.covariance
    noise = sd * sd
    gain, old = np.empty(9, np.float32), np.empty(9, np.float32)
    spread = c[k, k] + noise
    for i in range(9):
        gain[i], old[i] = c[i, k] / spread, c[k, i]
        s.state[i] += gain[i] * error
    for i in range(9):
        for j in range(9):
            c[i, j] = (gain[i] - ONE) * old[j] if i == k else gain[i] * old[j] - c[i, j]
    for i in range(9):
        old[i] = c[i, k]
    for i in range(9):
        for j in range(9):
            c[i, j] = old[i] * (gain[j] - ONE) if j == k else old[i] * gain[j] - c[i, j]
    for i in range(9):
        for j in range(i, 9):
            value = bounded(HALF * c[i, j] + HALF * c[j, i] + gain[i] * noise * gain[j], i == j)
            c[i, j] = c[j, i] = value
    s.updated = 1


@nb.njit()
def position(s: Record, place: np.ndarray, sd: Real) -> None:
    """kalmanCoreUpdateWithPosition: x, y and z one after the other."""
    for k in range(3):
        update(s, k, place[k] - s.state[k], sd)


@nb.njit(error_model="numpy")
def pose(s: Record, place: np.ndarray, q: np.ndarray, position_sd: Real, attitude_sd: Real) -> None:
    """kalmanCoreUpdateWithPose: the position, then the turn from the estimate to ``q`` (4,) x, y, z, w.

    A quaternion half a turn away says nothing finite; the firmware would take it in and be lost, here it is left.
    """
    position(s, place, position_sd)
    w, x, y, z = s.quaternion[0], -s.quaternion[1], -s.quaternion[2], -s.quaternion[3]
    scale = w * q[3] - x * q[0] - y * q[1] - z * q[2]
    error = (TWO * (w * q[0] + x * q[3] + y * q[2] - z * q[1]) / scale,
             TWO * (w * q[1] - x * q[2] + y * q[3] + z * q[0]) / scale,
             TWO * (w * q[2] + x * q[1] - y * q[0] + z * q[3]) / scale)
    if math.isfinite(error[0]) and math.isfinite(error[1]) and math.isfinite(error[2]):
        for k in range(3):
            update(s, D0 + k, error[k], attitude_sd)


@nb.njit()
def finalize(s: Record) -> bool:
    """kalmanCoreFinalize: the attitude error goes into the quaternion, or is forgotten; False if nothing is new."""
    if s.updated == 0:
        return False
    d = (s.state[D0], s.state[D0 + 1], s.state[D0 + 2])
    most = max(abs(d[0]), abs(d[1]), abs(d[2]))
    if _SMALL < most < _LARGE:
        normalised(turned(s.quaternion, d), s.quaternion)
        a = np.zeros((9, 9), np.float32)
        for k in range(6):
            a[k, k] = ONE
        attitude_block(a, (d[0] / TWO, d[1] / TWO, d[2] / TWO))
        transform(a, s.covariance)
    r, w, x, y, z = s.rotation, s.quaternion[0], s.quaternion[1], s.quaternion[2], s.quaternion[3]
    r[0, 0], r[0, 1], r[0, 2] = w * w + x * x - y * y - z * z, TWO * x * y - TWO * w * z, TWO * x * z + TWO * w * y
    r[1, 0], r[1, 1], r[1, 2] = TWO * x * y + TWO * w * z, w * w - x * x + y * y - z * z, TWO * y * z - TWO * w * x
    r[2, 0], r[2, 1], r[2, 2] = TWO * x * z - TWO * w * y, TWO * y * z + TWO * w * x, w * w - x * x - y * y + z * z
    for k in range(3):
        s.state[D0 + k] = ZERO
    bound(s.covariance)
    s.updated = 0
    return True


@kept
def run_operations(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def run_operations(operations: np.ndarray, parameters: np.ndarray, core: np.ndarray, trace: np.ndarray) -> None:
        """``operations`` (m,) OPERATION in turn on one filter, core (1,) CORE; trace (m,) takes it after each."""
        if not sources:
            return
        p, s = parameters[0], core[0]
        for i in range(len(operations)):
            o = operations[i]
            v = o.value
            if o.kind == INIT:
                initialize(p, s, o.t_ms)
            elif o.kind == PREDICT:
                predict(p, s, v[0:3], v[3:6], o.t_ms, o.flying != 0)
            elif o.kind == NOISE:
                add_noise(p, s, o.t_ms)
            elif o.kind == POSITION:
                position(s, v[0:3], v[7])
            elif o.kind == POSE:
                pose(s, v[0:3], v[3:7], v[7], v[8])
            else:
                finalize(s)
            trace[i] = core[0]

    return run_operations
