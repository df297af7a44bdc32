"""The compiled filter of the inertial methods: an error-state Kalman filter with optional aids.

Error dynamics after Sola, "Quaternion kinematics for the error-state Kalman filter" (2017), section 5 (local angular
error). Covariances are propagated along the few entries of the transition that differ from the identity, and updated
one scalar at a time in Joseph's form. Everything is in the vehicle's clock: a pose of time t belongs to the row with
timestamp t + ``late``. The constant part and wander of ``late`` are states, and the estimate is propagated by it.
"""

import numba as nb
import numpy as np

from nanobench_tools.settings import setting
from nanobench_tools.slices import put, put_matrix
from nanobench_tools.units import GRAVITY_M_S2

P, V, Q, BA, BG, MOUNT, SLOPE, AIR, LATE, WANDER = 0, 3, 6, 10, 13, 16, 19, 20, 22, 23
"""Layout of a state (24,), in this order:

- position and velocity (world), quaternion, biases of accelerometer and gyro;
- rotation of the tracked frame, drift of the vertical accelerometer's bias, air flow (as specific force, body x and
  y);
- delay of the vehicle's timestamps and its wander."""

STATE, ERROR = 24, 23
NOMINAL_S = 0.01
"""Between poses, for which the SDs of their attitude are meant."""
_P, _V, _T, _BA, _BG, _M, _S, _A, _L, _W = 0, 3, 6, 9, 12, 15, 18, 19, 21, 22
"""The same in the error state (23,), where attitude has three."""

NAMES = (
    "gyro_noise", "acc_noise",                          # rad/s and m/s^2 per root Hz
    "gyro_walk", "acc_walk",                            # per root second
    "position_sd", "roll_pitch_sd", "yaw_sd",           # of a pose, m and rad
    "drag", "drag_cross", "drag_quadratic", "drag_sd",  # 1/s, 1/s, 1/m; m/s^2 of one row
    "air_sd", "air_s",                                  # m/s^2 and correlation time of the air flow
    "slope_mean", "slope_sd",                           # m/s^3
    "late_sd", "wander_sd", "wander_s",                 # s
    "start_tilt_sd", "start_velocity_sd", "acc_bias_sd", "gyro_bias_sd", "mount_sd",
    "acc_bias_z_sd", "vertical_noise", "pitch_sd",
    "lift_bias_sd",                                     # m/s^2, by which vibration changes the bias at take-off
    "late_moves",                                       # whether the estimate is moved on by the lateness found
    "stamp",                                            # s per root Hz: stamps' wander makes noise of what changes
    "drawn",                                            # variance of a row without a packet is larger by this factor
    "mount_walk",                                       # rad per root second
    "start_position_sd",                                # m, of the first pose
    "change_s",                                         # s over which a signal's slope is taken (stamp_noise)
    "tilt_s",                                           # s over which errors of a pose's attitude are correlated
)
DEFAULTS = setting("estimators.inertial_core.defaults")
SETTINGS = {name: DEFAULTS[name] for name in NAMES}
(GYRO_NOISE, ACC_NOISE, GYRO_WALK, ACC_WALK, POSITION_SD, ROLL_PITCH_SD, YAW_SD, DRAG, DRAG_CROSS, DRAG_QUADRATIC,
 DRAG_SD, AIR_SD, AIR_S, SLOPE_MEAN, SLOPE_SD, LATE_SD, WANDER_SD, WANDER_S,
 START_TILT_SD, START_VELOCITY_SD, ACC_BIAS_SD, GYRO_BIAS_SD, MOUNT_SD, ACC_BIAS_Z_SD, VERTICAL_NOISE, PITCH_SD,
 LIFT_BIAS_SD, LATE_MOVES, STAMP, DRAWN, MOUNT_WALK, START_POSITION_SD, CHANGE_S, TILT_S) = range(len(NAMES))


@nb.njit(cache=True)
def rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q[0], q[1], q[2], q[3]
    r = np.empty((3, 3))
    r[0, 0], r[0, 1], r[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return r


@nb.njit(cache=True)
def turned(q: np.ndarray, ax: float, ay: float, az: float) -> np.ndarray:
    """q times the rotation by a vector [rad], of unit length."""
    half = 0.5 * np.sqrt(ax * ax + ay * ay + az * az)
    s = 0.5 if half < 1e-9 else 0.5 * np.sin(half) / half
    dx, dy, dz, dw = s * ax, s * ay, s * az, np.cos(half)
    x, y, z, w = q[0], q[1], q[2], q[3]
    r = np.empty(4)
    r[0], r[1] = w * dx + x * dw + y * dz - z * dy, w * dy - x * dz + y * dw + z * dx
    r[2], r[3] = w * dz + x * dy - y * dx + z * dw, w * dw - x * dx - y * dy - z * dz
    unit: np.ndarray = r / np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
    return unit


@nb.njit(cache=True)
def small_angle(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Twice the vector part of conj(q) * w: the rotation from q to w, in the body."""
    sign = 2.0 if w[0] * q[0] + w[1] * q[1] + w[2] * q[2] + w[3] * q[3] >= 0.0 else -2.0
    a = np.empty(3)
    a[0] = sign * (q[3] * w[0] - q[0] * w[3] - q[1] * w[2] + q[2] * w[1])
    a[1] = sign * (q[3] * w[1] + q[0] * w[2] - q[1] * w[3] - q[2] * w[0])
    a[2] = sign * (q[3] * w[2] - q[0] * w[1] + q[1] * w[0] - q[2] * w[3])
    return a


@nb.njit(cache=True)
def stamp_noise(time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, i: int, back_row: int,
                stamp: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared densities of the accelerometer x, y and z and of the gyro. They follow from the wander ``stamp`` [s per
    root Hz] of timestamps at row i. A timestamp off by d makes an error of d times the slope (here since
    ``back_row``), white since d changes fast."""
    square = (stamp / max(time_s[i] - time_s[back_row], 1e-3)) ** 2
    level = (0.5 * ((acc[i, 0] - acc[back_row, 0]) ** 2 + (acc[i, 1] - acc[back_row, 1]) ** 2)) * square
    upright = (acc[i, 2] - acc[back_row, 2]) ** 2 * square
    turn = ((gyro[i, 0] - gyro[back_row, 0]) ** 2 + (gyro[i, 1] - gyro[back_row, 1]) ** 2
            + (gyro[i, 2] - gyro[back_row, 2]) ** 2) / 3.0 * square
    return level, upright, turn


@nb.njit(cache=True)
def tilt_factor(pose_s: np.ndarray, j: int, tilt_s: float) -> float:
    """Factor on the variance of roll and pitch of pose j; 1 for poses 10 ms apart, for which the SDs are meant. Errors
    are correlated over ``tilt_s``, so that poses in quick succession count as fewer."""
    apart_s = max(pose_s[j] - pose_s[j - 1], 1e-3) if j > 0 else 1.0
    return (1.0 + tilt_s / apart_s) / (1.0 + tilt_s / NOMINAL_S)


@nb.njit(cache=True)
def _transition(c: np.ndarray, out: np.ndarray, dt: float, rot: np.ndarray, fx: float, fy: float, fz: float, wx: float,
                wy: float, wz: float, air: float, wander: float) -> None:
    """out = (F c)^T for the transition F of one step."""
    n = ERROR
    for j in range(n):
        tx, ty, tz = c[_T, j], c[_T + 1, j], c[_T + 2, j]
        bx, by, bz = c[_BA, j], c[_BA + 1, j], c[_BA + 2, j]
        # velocity: -R (f x theta) - R ba
        gx, gy, gz = fy * tz - fz * ty + bx, fz * tx - fx * tz + by, fx * ty - fy * tx + bz
        for k in range(3):
            out[j, _P + k] = c[_P + k, j] + dt * c[_V + k, j]
            out[j, _V + k] = c[_V + k, j] - dt * (rot[k, 0] * gx + rot[k, 1] * gy + rot[k, 2] * gz)
            out[j, _BG + k] = c[_BG + k, j]
            out[j, _M + k] = c[_M + k, j]
        out[j, _T] = tx - dt * (wy * tz - wz * ty + c[_BG, j])
        out[j, _T + 1] = ty - dt * (wz * tx - wx * tz + c[_BG + 1, j])
        out[j, _T + 2] = tz - dt * (wx * ty - wy * tx + c[_BG + 2, j])
        out[j, _BA], out[j, _BA + 1] = bx, by
        out[j, _BA + 2] = bz + dt * c[_S, j]
        out[j, _S] = c[_S, j]
        out[j, _A], out[j, _A + 1] = air * c[_A, j], air * c[_A + 1, j]
        out[j, _L], out[j, _W] = c[_L, j], wander * c[_W, j]


@nb.njit(cache=True)
def _scalar(c: np.ndarray, x: np.ndarray, h: np.ndarray, innovation: float, variance: float, ph: np.ndarray,
            gain: np.ndarray) -> float:
    """One scalar measurement on covariance c (n, n) and error x (n,), in place; its normalised squared innovation."""
    n = ERROR
    for i in range(n):
        ph[i] = 0.0
    for k in range(n):
        hk = h[k]
        if hk != 0.0:
            for i in range(n):
                ph[i] += hk * c[k, i]
            innovation -= hk * x[k]
    s = variance
    for k in range(n):
        s += h[k] * ph[k]
    for i in range(n):
        gain[i] = ph[i] / s
        x[i] += gain[i] * innovation
    # Joseph: (I - g h) C (I - g h)^T + g r g^T = C - g ph^T - ph g^T + s g g^T
    for i in range(n):
        gi, pi = gain[i], ph[i]
        for j in range(i + 1):
            value = c[i, j] - gi * ph[j] - pi * gain[j] + s * gi * gain[j]
            c[i, j] = value
            c[j, i] = value
    return innovation * innovation / s


@nb.njit(cache=True)
def start(pose: np.ndarray, settings: np.ndarray, state: np.ndarray, cov: np.ndarray) -> None:
    """state (24,) and cov (23, 23), in place, at rest at a pose (7,)."""
    state[:] = 0.0
    put(state[P:], pose[:3])
    put(state[Q:], pose[3:])
    state[SLOPE] = settings[SLOPE_MEAN]
    cov[:] = 0.0
    sd = np.zeros(ERROR)
    for k in range(3):
        sd[_P + k], sd[_V + k] = settings[START_POSITION_SD], settings[START_VELOCITY_SD]
        sd[_T + k], sd[_M + k] = settings[START_TILT_SD], settings[MOUNT_SD]
        sd[_BA + k], sd[_BG + k] = settings[ACC_BIAS_Z_SD if k == 2 else ACC_BIAS_SD], settings[GYRO_BIAS_SD]
    sd[_S] = settings[SLOPE_SD]
    sd[_A] = sd[_A + 1] = settings[AIR_SD]
    sd[_L], sd[_W] = settings[LATE_SD], settings[WANDER_SD]
    for k in range(ERROR):
        cov[k, k] = sd[k] ** 2 + 1e-14


@nb.njit(cache=True)
def _stated(c: np.ndarray, on: float, v: np.ndarray, moves: np.ndarray, out: np.ndarray) -> None:
    """out (9, 9): covariance of the returned position, velocity and attitude, from c (n, n). Position is propagated by
    ``on`` seconds with velocity v (3,), and the delay of the timestamps is uncertain, too."""
    seen = np.empty((3, ERROR))
    for k in range(3):
        for j in range(ERROR):
            seen[k, j] = c[_P + k, j] + on * c[_V + k, j] + moves * v[k] * (c[_L, j] + c[_W, j])
    put_matrix(out, c[:9, :9])
    for k in range(3):
        for j in range(3):
            out[k, j] = seen[k, _P + j] + on * seen[k, _V + j] + moves * v[j] * (seen[k, _L] + seen[k, _W])
            out[k, 3 + j] = out[3 + j, k] = seen[k, _V + j]
            out[k, 6 + j] = out[6 + j, k] = seen[k, _T + j]


@nb.njit(cache=True)
def run(stamps_s: np.ndarray, time_s: np.ndarray, acc: np.ndarray, gyro: np.ndarray, drawn: np.ndarray,
        flying: np.ndarray, measured: np.ndarray, pose_of: np.ndarray, pose_s: np.ndarray, poses: np.ndarray,
        settings: np.ndarray, first: int, state: np.ndarray, cov: np.ndarray, sums: np.ndarray, turns: np.ndarray,
        out: np.ndarray, sds: np.ndarray) -> None:
    """Filters rows ``first`` .. of (n,) rows, from ``state`` and ``cov``. These end as after the last row.

    ``stamps_s``, ``time_s`` (n,): the rows' stamps, and those on which the IMU is integrated. ``flying`` (n,) bool:
    drag counts. acc, gyro (n, 3); ``drawn`` (n,): share of the row that carries no packet. ``told`` (n, 6) or (0, 6):
    body velocity x, y from another source [m/s] and its SD [m/s]. Then its derivative by the accelerometer's bias [s].
    ``pose_of`` (n + 1,): poses pose_of[i]..pose_of[i + 1] have arrived by row i. ``pose_s`` (m,): when they were
    measured. ``poses`` (m, 7). sums (n, 6), turns (n, 4): room for the integrals of the IMU alone. ``out`` (n, 11):
    position, velocity, quaternion and the squared innovation of the positions of the row's poses (nan: none).
    ``sds`` (n, 9, 9): covariance of the position, velocity and attitude in ``out``, or (0, 9, 9) for none.
    """
    n = len(time_s)
    other = np.empty((ERROR, ERROR))
    h, x, ph, gain = np.zeros(ERROR), np.zeros(ERROR), np.empty(ERROR), np.empty(ERROR)
    drag, cross, quadratic = settings[DRAG], settings[DRAG_CROSS], settings[DRAG_QUADRATIC]
    back_row = 0
    for i in range(first, n):
        dt = 0.0
        if i > 0:
            dt = time_s[i] - time_s[i - 1]
        q = state[Q:Q + 4]
        rot = rotation(q)
        if dt > 0.0:
            f = np.empty(3)
            w = np.empty(3)
            for k in range(3):
                f[k] = 0.5 * (acc[i, k] + acc[i - 1, k]) - state[BA + k]
                w[k] = 0.5 * (gyro[i, k] + gyro[i - 1, k]) - state[BG + k]
            half = rotation(turned(q, 0.5 * dt * w[0], 0.5 * dt * w[1], 0.5 * dt * w[2]))
            for k in range(3):
                a = half[k, 0] * f[0] + half[k, 1] * f[1] + half[k, 2] * f[2]
                if k == 2:
                    a -= GRAVITY_M_S2
                state[P + k] += dt * state[V + k] + 0.5 * dt * dt * a
                state[V + k] += dt * a
                sums[i, k] = sums[i - 1, k] + dt * sums[i - 1, 3 + k] + 0.5 * dt * dt * a
                sums[i, 3 + k] = sums[i - 1, 3 + k] + dt * a
            put(state[Q:], turned(q, dt * w[0], dt * w[1], dt * w[2]))
            put(turns[i], turned(turns[i - 1], dt * w[0], dt * w[1], dt * w[2]))
            state[BA + 2] += dt * state[SLOPE]
            air = np.exp(-dt / settings[AIR_S])
            wander = np.exp(-dt / settings[WANDER_S])
            state[AIR] *= air
            state[AIR + 1] *= air
            state[WANDER] *= wander
            _transition(cov, other, dt, half, f[0], f[1], f[2], w[0], w[1], w[2], air, wander)
            _transition(other, cov, dt, half, f[0], f[1], f[2], w[0], w[1], w[2], air, wander)
            while back_row < i - 1 and time_s[i] - time_s[back_row + 1] >= settings[CHANGE_S]:
                back_row += 1
            level, upright, turn = stamp_noise(time_s, acc, gyro, i, back_row, settings[STAMP])
            more = 1.0 + settings[DRAWN] * drawn[i]
            for k in range(3):
                cov[_V + k, _V + k] += (settings[ACC_NOISE] ** 2 * more + level) * dt
                cov[_T + k, _T + k] += (settings[GYRO_NOISE] ** 2 * more + turn) * dt
                cov[_M + k, _M + k] += settings[MOUNT_WALK] ** 2 * dt
                cov[_BA + k, _BA + k] += settings[ACC_WALK] ** 2 * dt
                cov[_BG + k, _BG + k] += settings[GYRO_WALK] ** 2 * dt
            if flying[i] and not flying[i - 1]:
                for k in range(3):
                    cov[_BA + k, _BA + k] += settings[LIFT_BIAS_SD] ** 2
            cov[_V + 2, _V + 2] += ((settings[VERTICAL_NOISE] ** 2 - settings[ACC_NOISE] ** 2) * more + upright
                                    - level) * dt
            for k in range(2):
                cov[_A + k, _A + k] += settings[AIR_SD] ** 2 * (1.0 - air * air)
            cov[_W, _W] += settings[WANDER_SD] ** 2 * (1.0 - wander * wander)
        elif i > 0:
            put(sums[i], sums[i - 1])
            put(turns[i], turns[i - 1])
        else:
            sums[i], turns[i], turns[i, 3] = 0.0, 0.0, 1.0
        x[:] = 0.0
        nis, count = 0.0, 0
        rot = rotation(state[Q:Q + 4])
        for j in range(pose_of[i], pose_of[i + 1]):
            late = state[LATE] + state[WANDER]
            at = pose_s[j] + late
            back = time_s[i] - at
            m = i
            while m > 0 and time_s[m - 1] >= at:
                m -= 1
            part = 0.0
            lo = max(m - 1, 0)
            if m > lo:
                part = min(max((at - time_s[lo]) / max(time_s[m] - time_s[lo], 1e-9), 0.0), 1.0)
            past = np.empty(3)
            speed = np.empty(3)
            for k in range(3):
                place = sums[lo, k] + part * (sums[m, k] - sums[lo, k])
                sv = sums[lo, 3 + k] + part * (sums[m, 3 + k] - sums[lo, 3 + k])
                if at > time_s[i]:
                    place, sv = sums[i, k] + (at - time_s[i]) * sums[i, 3 + k], sums[i, 3 + k]
                past[k] = state[P + k] - state[V + k] * back + sums[i, 3 + k] * back - (sums[i, k] - place)
                speed[k] = state[V + k] - (sums[i, 3 + k] - sv)
            # the attitude then: turned back by what the gyro says
            near = m if part > 0.5 else lo
            b, e = turns[i], turns[near]
            angle = small_angle(b, e)
            then = turned(state[Q:Q + 4], angle[0], angle[1], angle[2])
            if at > time_s[i]:
                then = state[Q:Q + 4].copy()
            off = small_angle(then, poses[j, 3:])
            for k in range(3):
                h[:] = 0.0
                h[_P + k], h[_V + k] = 1.0, -back
                if settings[LATE_SD] > 0.0:
                    h[_L] = speed[k]
                if settings[WANDER_SD] > 0.0:
                    h[_W] = speed[k]
                nis += _scalar(cov, x, h, poses[j, k] - past[k], settings[POSITION_SD] ** 2, ph, gain)
                count += 1
            for k in range(3):
                h[:] = 0.0
                h[_T + k], h[_M + k] = 1.0, 1.0
                if settings[LATE_SD] > 0.0:
                    h[_L] = gyro[i, k] - state[BG + k]
                if settings[WANDER_SD] > 0.0:
                    h[_W] = gyro[i, k] - state[BG + k]
                sd = settings[YAW_SD] if k == 2 else (settings[PITCH_SD] if k == 1 else settings[ROLL_PITCH_SD])
                less = 1.0 if k == 2 else tilt_factor(pose_s, j, settings[TILT_S])
                _scalar(cov, x, h, off[k] - state[MOUNT + k], sd ** 2 * less, ph, gain)
        if drag > 0.0 or len(measured) > 0:
            bv = np.empty(3)
            for k in range(3):
                bv[k] = rot[0, k] * state[V] + rot[1, k] * state[V + 1] + rot[2, k] * state[V + 2]
            if drag > 0.0 and flying[i]:
                for k in range(2):
                    d, g = np.zeros(3), drag + 2.0 * quadratic * abs(bv[k])
                    d[k] = g
                    d[1 - k] = cross
                    force = drag * bv[k] + quadratic * abs(bv[k]) * bv[k] + cross * bv[1 - k]
                    h[:] = 0.0
                    for m in range(3):
                        h[_V + m] = -(rot[m, 0] * d[0] + rot[m, 1] * d[1] + rot[m, 2] * d[2])
                    # body velocity changes by bv x theta
                    h[_T] = -(d[1] * bv[2] - d[2] * bv[1])
                    h[_T + 1] = -(d[2] * bv[0] - d[0] * bv[2])
                    h[_T + 2] = -(d[0] * bv[1] - d[1] * bv[0])
                    h[_BA + k] = 1.0
                    if settings[AIR_SD] > 0.0:
                        h[_A + k] = 1.0
                    _scalar(cov, x, h, acc[i, k] - state[BA + k] - state[AIR + k] + force, settings[DRAG_SD] ** 2, ph,
                            gain)
            if len(measured) > 0 and flying[i]:
                for k in range(2):
                    d = np.zeros(3)
                    d[k] = 1.0
                    h[:] = 0.0
                    for m in range(3):
                        h[_V + m] = rot[m, k]
                    h[_T] = d[1] * bv[2] - d[2] * bv[1]
                    h[_T + 1] = d[2] * bv[0] - d[0] * bv[2]
                    h[_T + 2] = d[0] * bv[1] - d[1] * bv[0]
                    h[_BA + k] = h[_A + k] = measured[i, 4 + k]
                    off = measured[i, 4 + k] * (state[BA + k] + state[AIR + k])
                    _scalar(cov, x, h, measured[i, k] - off - bv[k], measured[i, 2 + k] ** 2, ph, gain)
        for k in range(3):
            state[P + k] += x[_P + k]
            state[V + k] += x[_V + k]
            state[BA + k] += x[_BA + k]
            state[BG + k] += x[_BG + k]
            state[MOUNT + k] += x[_M + k]
        put(state[Q:], turned(state[Q:Q + 4], x[_T], x[_T + 1], x[_T + 2]))
        state[SLOPE] += x[_S]
        state[AIR] += x[_A]
        state[AIR + 1] += x[_A + 1]
        state[LATE] += x[_L]
        state[WANDER] += x[_W]
        on = stamps_s[i] - time_s[i] + settings[LATE_MOVES] * (state[LATE] + state[WANDER])
        for k in range(3):
            out[i, k] = state[P + k] + on * state[V + k]
            out[i, 3 + k] = state[V + k]
        put(out[i][6:], state[Q:Q + 4])
        out[i, 10] = nis if count else np.nan
        if len(sds):
            _stated(cov, on, state[V:V + 3], settings[LATE_MOVES], sds[i])
