"""The Mellinger controller (controller_mellinger.c): force from errors of the path, moments from the rotation's error.

Runs at 500 Hz. Uses velocity, acceleration, yaw and rates of an absolute setpoint when they are given. The gains make
forces and counts for a vehicle of 0.029 kg; nothing limits the thrust here, the motors' cap does.
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
    TO_DEG,
    TO_RAD,
    ZERO,
    F,
    Real,
    Triple,
    Turn,
    clamped,
    counts16,
    cross,
    dot,
    rotation_of,
    unit,
    yaw_of,
)
from .kept import kept
from .records import ABSOLUTE, VELOCITY, Record

PARAMETERS = np.dtype([(name, "f4") for name in (
    "mass", "massThrust", "kp_xy", "kd_xy", "ki_xy", "i_range_xy", "kp_z", "kd_z", "ki_z", "i_range_z", "kR_xy",
    "kw_xy", "ki_m_xy", "i_range_m_xy", "kR_z", "kw_z", "ki_m_z", "i_range_m_z", "kd_omega_rp")])
"""Names of the firmware's log and parameter group ``ctrlMel``: forces in N, moments in counts."""
DEFAULTS = (0.029, 132000.0, 0.4, 0.2, 0.05, 2.0, 1.25, 0.4, 0.05, 0.4, 70000.0, 20000.0, 0.0, 1.0, 60000.0, 12000.0,
            500.0, 1500.0, 200.0)
STATE = np.dtype([("integral", "f4", 3), ("integral_m", "f4", 3), ("rate", "f4", 2), ("rate_setpoint", "f4", 2),
                  ("z_wanted", "f4", 3), ("thrust", "f4"), ("roll", "i2"), ("pitch", "i2"), ("yaw", "i2")], align=True)
"""All zero at power-up: integrals of position [m s] and attitude [s], last measured and commanded roll and pitch rates
[rad/s].

Also the desired direction of thrust (world), and the held outputs [counts]."""

LIMIT = F(32000.0)


def defaults(n: int = 1) -> np.ndarray:
    """(n,) PARAMETERS as released."""
    return np.array([DEFAULTS] * n, PARAMETERS)


@nb.njit()
def _force(p: Record, s: Record, setpoint: Record, estimate: Record, rows: Turn) -> Triple:
    """Lines 141-202: the integrals, and the force wanted [N] (or, without a place to be, a direction)."""
    e = (setpoint.position_m[0] - estimate.position_m[0], setpoint.position_m[1] - estimate.position_m[1],
         setpoint.position_m[2] - estimate.position_m[2])
    ev = (setpoint.velocity_m_s[0] - estimate.velocity_m_s[0], setpoint.velocity_m_s[1] - estimate.velocity_m_s[1],
          setpoint.velocity_m_s[2] - estimate.velocity_m_s[2])
    s.integral[0] = clamped(s.integral[0] + e[0] * ATTITUDE_DT, -p.i_range_xy, p.i_range_xy)
    s.integral[1] = clamped(s.integral[1] + e[1] * ATTITUDE_DT, -p.i_range_xy, p.i_range_xy)
    s.integral[2] = clamped(s.integral[2] + e[2] * ATTITUDE_DT, -p.i_range_z, p.i_range_z)
    if setpoint.mode_x == ABSOLUTE:
        a = setpoint.acceleration_m_s2
        return (p.mass * a[0] + p.kp_xy * e[0] + p.kd_xy * ev[0] + p.ki_xy * s.integral[0],
                p.mass * a[1] + p.kp_xy * e[1] + p.kd_xy * ev[1] + p.ki_xy * s.integral[1],
                p.mass * (a[2] + GRAVITY) + p.kp_z * e[2] + p.kd_z * ev[2] + p.ki_z * s.integral[2])
    fx, fy = -math.sin(setpoint.attitude_deg[1] * TO_RAD), -math.sin(setpoint.attitude_deg[0] * TO_RAD)
    fz = ONE
    if setpoint.mode_z == ABSOLUTE:
        fz = p.mass * GRAVITY + p.kp_z * e[2] + p.kd_z * ev[2] + p.ki_z * s.integral[2]
    # along the heading: body x projected on the horizontal plane
    c, sn, _ = unit((rows[0][0], rows[1][0], ZERO), (ONE, ZERO, ZERO))
    return c * fx - sn * fy, sn * fx + c * fy, fz


@nb.njit()
def _heading(setpoint: Record, estimate: Record) -> Real:
    """Lines 178-187: yaw wanted [deg]; a rate of yaw is only led by one step."""
    if setpoint.mode_yaw == VELOCITY:
        led: Real = estimate.attitude_deg[2] + setpoint.rate_deg_s[2] * ATTITUDE_DT
        return led
    if setpoint.mode_yaw == ABSOLUTE:
        asked: Real = setpoint.attitude_deg[2]
        return asked
    return yaw_of(setpoint.quaternion) * TO_DEG if setpoint.mode_quat == ABSOLUTE else ZERO


@nb.njit()
def _turn_error(force: Triple, yaw_deg: Real, columns: Turn) -> tuple[Triple, Triple]:
    """Lines 205-246: z wanted, and vee(Rd^T R - R^T Rd) without the textbook's half, y negated for legacy pitch."""
    yaw = yaw_deg * TO_RAD
    z = unit(force, (ZERO, ZERO, ONE))
    y = unit(cross(z, (math.cos(yaw), math.sin(yaw), ZERO)), (ZERO, ONE, ZERO))
    x = cross(y, z)
    body_x, body_y, body_z = columns
    return z, (dot(z, body_y) - dot(y, body_z), dot(z, body_x) - dot(x, body_z), dot(y, body_x) - dot(x, body_y))


@nb.njit()
def mellinger_step(step: int, p: Record, s: Record, setpoint: Record, estimate: Record, control: Record) -> None:
    """controllerMellingerFirmware for one vehicle at ``step`` of the 1 kHz loop; writes ``control``."""
    if step % ATTITUDE_EVERY == 0:
        _run(p, s, setpoint, estimate)
    control.thrust, control.roll, control.pitch, control.yaw = s.thrust, s.roll, s.pitch, s.yaw


@nb.njit()
def _run(p: Record, s: Record, setpoint: Record, estimate: Record) -> None:
    rows = rotation_of(estimate.quaternion)
    columns = ((rows[0][0], rows[1][0], rows[2][0]), (rows[0][1], rows[1][1], rows[2][1]),
               (rows[0][2], rows[1][2], rows[2][2]))
    force = _force(p, s, setpoint, estimate, rows)
    z, e = _turn_error(force, _heading(setpoint, estimate), columns)
    s.z_wanted[0], s.z_wanted[1], s.z_wanted[2] = z
    rate = (estimate.gyro_deg_s[0] * TO_RAD, -estimate.gyro_deg_s[1] * TO_RAD, estimate.gyro_deg_s[2] * TO_RAD)
    commanded = (setpoint.rate_deg_s[0] * TO_RAD, setpoint.rate_deg_s[1] * TO_RAD, setpoint.rate_deg_s[2] * TO_RAD)
    e_rate = (commanded[0] - rate[0], -commanded[1] - rate[1], commanded[2] - rate[2])
    d_roll = ((commanded[0] - s.rate_setpoint[0]) - (rate[0] - s.rate[0])) / ATTITUDE_DT
    d_pitch = (-(commanded[1] - s.rate_setpoint[1]) - (rate[1] - s.rate[1])) / ATTITUDE_DT
    s.rate[0], s.rate[1], s.rate_setpoint[0], s.rate_setpoint[1] = rate[0], rate[1], commanded[0], commanded[1]
    for k, limit in enumerate((p.i_range_m_xy, p.i_range_m_xy, p.i_range_m_z)):
        s.integral_m[k] = clamped(s.integral_m[k] - e[k] * ATTITUDE_DT, -limit, limit)
    moment_x = -p.kR_xy * e[0] + p.kw_xy * e_rate[0] + p.ki_m_xy * s.integral_m[0] + p.kd_omega_rp * d_roll
    moment_y = -p.kR_xy * e[1] + p.kw_xy * e_rate[1] + p.ki_m_xy * s.integral_m[1] + p.kd_omega_rp * d_pitch
    moment_z = -p.kR_z * e[2] + p.kw_z * e_rate[2] + p.ki_m_z * s.integral_m[2]
    s.thrust = setpoint.thrust if setpoint.mode_z == 0 else p.massThrust * dot(force, columns[2])
    if s.thrust > ZERO:
        s.roll, s.pitch = counts16(clamped(moment_x, -LIMIT, LIMIT)), counts16(clamped(moment_y, -LIMIT, LIMIT))
        s.yaw = counts16(clamped(-moment_z, -LIMIT, LIMIT))
    else:
        s.roll = s.pitch = s.yaw = 0
        for k in range(3):
            s.integral[k] = s.integral_m[k] = ZERO


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
                p = parameters[i if own else 0]
                mellinger_step(steps[k], p, state[i], setpoint[k, i], estimate[k, i], control[k, i])
                if len(trace):
                    trace[k, i] = state[i]

    return run_steps

