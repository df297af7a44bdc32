"""The geometric controller on SE(3) (controller_lee.c; Lee, Leok, McClamroch 2010, doi:10.1109/CDC.2010.5717652).

Runs at 500 Hz: thrust [N] and torque [N m] in true body axes. Against the paper the firmware leaves out the moment that
the turning wanted needs, -J (w x R^T Rd wd) + J R^T Rd dwd/dt; ``coupling`` 1 puts its first part back in.
"""

import math
from collections.abc import Callable

import numba as nb
import numpy as np

from .float32 import (
    ATTITUDE_DT,
    ATTITUDE_EVERY,
    GRAVITY,
    ONE,
    TO_RAD,
    TWO,
    ZERO,
    F,
    Real,
    Triple,
    Turn,
    clamped,
    cross,
    dot,
    rotation_of,
    unit,
    yaw_of,
)
from .kept import kept
from .records import ABSOLUTE, DISABLED, VELOCITY, Record
from .thrust_curve import THRUST_MAX_N

PARAMETERS = np.dtype([
    ("mass_kg", "f4"), ("inertia_kg_m2", "f4", 3), ("kp_1_s2", "f4", 3), ("kd_1_s", "f4", 3), ("ki_1_s3", "f4", 3),
    ("error_limit_m", "f4"), ("error_limit_m_s", "f4"), ("k_rotation_N_m", "f4", 3), ("k_rate_N_m_s", "f4", 3),
    ("k_integral_N_m_s", "f4", 3), ("coupling", "f4")], align=True)
STATE = np.dtype([("integral", "f4", 3), ("integral_r", "f4", 3), ("rotation", "f4", (3, 3)), ("rate", "f4", 3),
                  ("rate_wanted", "f4", 3), ("thrust_N", "f4"), ("torque_N_m", "f4", 3)], align=True)
"""All zero at power-up: integrals of position [m s] and attitude [s], rotation wanted (rows), rates measured and wanted
[rad/s], the held outputs."""

LEAST_THRUST_N = F(0.01)
LEAST_COUNTS = F(1000.0)
_FULL_N = F(4.0) * F(THRUST_MAX_N)


def defaults(n: int = 1) -> np.ndarray:
    """(n,) PARAMETERS as released."""
    found = np.zeros(n, PARAMETERS)
    found["mass_kg"], found["inertia_kg_m2"] = 0.029, (16.571710e-6, 16.655602e-6, 29.261652e-6)
    found["kp_1_s2"], found["kd_1_s"], found["error_limit_m"], found["error_limit_m_s"] = 7.0, 4.0, 100.0, 100.0
    found["k_rotation_N_m"], found["k_rate_N_m_s"] = (0.007, 0.007, 0.008), (0.00115, 0.00115, 0.002)
    found["k_integral_N_m_s"] = 0.03
    return found


@nb.njit()
def _heading(setpoint: Record, estimate: Record) -> Real:
    """Yaw wanted [rad]."""
    if setpoint.mode_yaw == VELOCITY:
        led: Real = (estimate.attitude_deg[2] + setpoint.rate_deg_s[2] * ATTITUDE_DT) * TO_RAD
        return led
    if setpoint.mode_yaw == ABSOLUTE:
        asked: Real = setpoint.attitude_deg[2] * TO_RAD
        return asked
    return yaw_of(setpoint.quaternion) if setpoint.mode_quat == ABSOLUTE else ZERO


@nb.njit()
def _follow(p: Record, s: Record, setpoint: Record, estimate: Record, yaw: Real, body_z: Triple) -> Turn:
    """Lines 122-174: thrust along the body's z, and the columns of the rotation that turns z along the force wanted.

    Upright where the force wanted points down in the body.
    """
    pull = s.torque_N_m  # lent for three numbers
    for k in range(3):
        e = clamped(setpoint.position_m[k] - estimate.position_m[k], -p.error_limit_m, p.error_limit_m)
        ev = clamped(setpoint.velocity_m_s[k] - estimate.velocity_m_s[k], -p.error_limit_m_s, p.error_limit_m_s)
        s.integral[k] += e * ATTITUDE_DT
        pull[k] = setpoint.acceleration_m_s2[k] + p.kd_1_s[k] * ev + p.kp_1_s2[k] * e + p.ki_1_s3[k] * s.integral[k]
    force = (pull[0], pull[1], pull[2] + GRAVITY)
    s.thrust_N = p.mass_kg * dot(force, body_z)
    if s.thrust_N < LEAST_THRUST_N:
        for k in range(3):
            s.integral[k] = s.integral_r[k] = ZERO
    z: Triple = (ZERO, ZERO, ONE)
    if s.thrust_N > ZERO:
        z = unit(force, z)
    y = unit(cross(z, (math.cos(yaw), math.sin(yaw), ZERO)), (ZERO, ONE, ZERO))
    return cross(y, z), y, z


@nb.njit()
def _hold(setpoint: Record, yaw: Real) -> Turn:
    """Lines 176-196: the rotation wanted from roll, pitch (legacy) and yaw, as columns."""
    roll, pitch = setpoint.attitude_deg[0] * TO_RAD, -setpoint.attitude_deg[1] * TO_RAD
    cr, cp, cy = math.cos(roll), math.cos(pitch), math.cos(yaw)
    sr, sp, sy = math.sin(roll), math.sin(pitch), math.sin(yaw)
    return ((cy * cp, sy * cp, -sp), (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
            (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr))


@nb.njit()
def _run(p: Record, s: Record, setpoint: Record, estimate: Record) -> None:
    rows = rotation_of(estimate.quaternion)
    body = ((rows[0][0], rows[1][0], rows[2][0]), (rows[0][1], rows[1][1], rows[2][1]),
            (rows[0][2], rows[1][2], rows[2][2]))
    yaw = _heading(setpoint, estimate)
    if setpoint.mode_x == ABSOLUTE or setpoint.mode_y == ABSOLUTE or setpoint.mode_z == ABSOLUTE:
        x, y, z = _follow(p, s, setpoint, estimate, yaw, body[2])
    else:
        s.thrust_N = setpoint.thrust / F(65535.0) * _FULL_N if setpoint.mode_z == DISABLED else ZERO
        if setpoint.mode_z == DISABLED and setpoint.thrust < LEAST_COUNTS:
            s.thrust_N = ZERO
            for k in range(3):
                s.torque_N_m[k] = s.integral[k] = s.integral_r[k] = ZERO
            return
        x, y, z = _hold(setpoint, yaw)
    wanted = (x, y, z)
    for k in range(3):
        for j in range(3):
            s.rotation[k, j] = wanted[j][k]
    half = ONE / TWO
    e = (half * (dot(z, body[1]) - dot(y, body[2])), half * (dot(x, body[2]) - dot(z, body[0])),
         half * (dot(y, body[0]) - dot(x, body[1])))
    # how the direction of thrust has to turn for the jerk asked for
    hx = hy = ZERO
    if s.thrust_N != ZERO:
        jerk = (setpoint.jerk_m_s3[0], setpoint.jerk_m_s3[1], setpoint.jerk_m_s3[2])
        scale = p.mass_kg / s.thrust_N
        hx, hy = scale * dot(jerk, x), scale * dot(jerk, y)
    turn = (-hy, hx, setpoint.rate_deg_s[2] * TO_RAD * z[2])
    _torque(p, s, estimate, body, wanted, e, turn)


@nb.njit()
def _torque(p: Record, s: Record, estimate: Record, body: Turn, wanted: Turn, e: Triple, turn: Triple) -> None:
    """Lines 209-249: M = -KR e_R - Kw e_w - KI integral + w x J w, and the coupling where asked for."""
    gyro = estimate.gyro_deg_s
    w = (gyro[0] * TO_RAD, gyro[1] * TO_RAD, gyro[2] * TO_RAD)
    world = (wanted[0][0] * turn[0] + wanted[1][0] * turn[1] + wanted[2][0] * turn[2],
             wanted[0][1] * turn[0] + wanted[1][1] * turn[1] + wanted[2][1] * turn[2],
             wanted[0][2] * turn[0] + wanted[1][2] * turn[1] + wanted[2][2] * turn[2])
    commanded = (dot(body[0], world), dot(body[1], world), dot(body[2], world))
    j = p.inertia_kg_m2
    spin = cross(w, (j[0] * w[0], j[1] * w[1], j[2] * w[2]))
    lead = cross(w, commanded)
    for k in range(3):
        s.rate[k], s.rate_wanted[k] = w[k], commanded[k]
        s.integral_r[k] += e[k] * ATTITUDE_DT
        s.torque_N_m[k] = (-p.k_rotation_N_m[k] * e[k] - p.k_rate_N_m_s[k] * (w[k] - commanded[k])
                           - p.k_integral_N_m_s[k] * s.integral_r[k] + spin[k] - p.coupling * j[k] * lead[k])


@nb.njit()
def lee_step(step: int, p: Record, s: Record, setpoint: Record, estimate: Record, wrench: Record) -> None:
    """controllerLee for one vehicle at ``step`` of the 1 kHz loop; writes ``wrench``."""
    if step % ATTITUDE_EVERY == 0:
        _run(p, s, setpoint, estimate)
    wrench.thrust_N = s.thrust_N
    for k in range(3):
        wrench.torque_N_m[k] = s.torque_N_m[k]


@kept
def run_steps(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def run_steps(steps: np.ndarray, parameters: np.ndarray, state: np.ndarray, setpoint: np.ndarray,
                  estimate: np.ndarray, wrench: np.ndarray, trace: np.ndarray) -> None:
        """``steps`` (m,) of the 1 kHz loop for n vehicles: setpoint, estimate (m, n) in, wrench (m, n) out.

        state (n,) is carried on; parameters (n,) or (1,) for all; trace (m, n), or (0, n), takes the state after steps.
        """
        if not sources:
            return
        own = len(parameters) > 1
        for k in range(len(steps)):
            for i in range(len(state)):
                lee_step(steps[k], parameters[i if own else 0], state[i], setpoint[k, i], estimate[k, i], wrench[k, i])
                if len(trace):
                    trace[k, i] = state[i]

    return run_steps

