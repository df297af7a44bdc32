"""The task around the Kalman filter's core (estimator_kalman.c, axis3fSubSampler.c, kalman_supervisor.c of 2025.12.1).

One run per step of the 1 kHz loop: predictions at 100 Hz from averages of the IMU, process noise and measurements in
every run. A state out of bounds causes a restart. Measurements carry no time stamp and no delay is compensated. The
queue's limit of 20 measurements is not copied. NaN is refused before it comes in. The firmware does not check, and
never recovers from a pose with NaN.
"""

import math
from collections.abc import Callable

import numba as nb
import numpy as np

from .float32 import GRAVITY, TO_RAD, ZERO, F
from .kalman import CORE, PX, add_noise, finalize, initialize, pose, position, predict
from .kept import kept
from .records import Record

PREDICT_EVERY_MS = 10

RUN = np.dtype([("t_ms", "i8"), ("flying", "i1"), ("acc_g", "f4", 3), ("gyro_deg_s", "f4", 3)], align=True)
"""A run of the task: its tick, the supervisor's word, and the sample that arrived in it (not finite: none did)."""

MEASUREMENT = np.dtype([("t_ms", "i8"), ("attitude", "i1"), ("position_m", "f4", 3), ("quaternion", "f4", 4),
                        ("position_sd_m", "f4"), ("attitude_sd_rad", "f4")], align=True)
"""A pose (``attitude`` 1; quaternion x, y, z, w) or a position, in order of arrival. The run at its tick uses it."""

TASK = np.dtype([("core", CORE), ("sum", "f4", 6), ("samples", "i4"), ("mean", "f4", 6), ("next_ms", "i8"),
                 ("started", "i1"), ("reset", "i1"), ("refused", "i4"), ("resets", "i4")], align=True)
"""All zero at power-up. ``sum`` and ``mean`` of accelerometer (g; m/s^2) and gyro (deg/s; rad/s)."""


@nb.njit(inline="always")
def _finite(values: np.ndarray) -> bool:
    good = True
    for value in values:
        good = good and math.isfinite(value)
    return good


@nb.njit(inline="always")
def _average(s: Record) -> None:
    """axis3fSubSamplerFinalize: the last average stays if no sample came."""
    if s.samples == 0:
        return
    for k in range(6):
        s.mean[k] = s.sum[k] * (GRAVITY if k < 3 else TO_RAD) / F(s.samples)
        s.sum[k] = ZERO
    s.samples = 0


@nb.njit(inline="always")
def _within(core: Record, p: Record) -> bool:
    """kalmanSupervisorIsStateWithinBounds; a state that is no number is not, other than in the firmware."""
    for k in range(3):
        if p.max_position_m > ZERO and not abs(core.state[k]) <= p.max_position_m:
            return False
        if p.max_velocity_m_s > ZERO and not abs(core.state[PX + k]) <= p.max_velocity_m_s:
            return False
    return True


@nb.njit()
def _measure(s: Record, core: Record, m: Record) -> None:
    if not _finite(m.position_m) or (m.attitude != 0 and not _finite(m.quaternion)):
        s.refused += 1
    elif m.attitude != 0:
        pose(core, m.position_m, m.quaternion, m.position_sd_m, m.attitude_sd_rad)
    else:
        position(core, m.position_m, m.position_sd_m)


@nb.njit()
def task_step(p: Record, s: Record, run: Record, measurements: np.ndarray, first: int) -> int:
    """One run of the task; takes the measurements from ``first`` on up to its tick, gives the index after them."""
    core, now = s.core, run.t_ms
    if s.started == 0:
        s.started, s.next_ms = 1, now
        initialize(p, core, now)
    elif s.reset != 0:
        initialize(p, core, now)
        for k in range(6):
            s.sum[k] = s.mean[k] = ZERO
        s.samples, s.reset = 0, 0
        s.resets += 1
    if now >= s.next_ms:
        _average(s)
        predict(p, core, s.mean[:3], s.mean[3:], now, run.flying != 0)
        s.next_ms = now + PREDICT_EVERY_MS
    add_noise(p, core, now)
    while first < len(measurements) and measurements[first].t_ms <= now:
        _measure(s, core, measurements[first])
        first += 1
    if _finite(run.acc_g) and _finite(run.gyro_deg_s):
        for k in range(3):
            s.sum[k] += run.acc_g[k]
            s.sum[3 + k] += run.gyro_deg_s[k]
        s.samples += 1
    finalize(core)
    if not _within(core, p):
        s.reset = 1
    return first


@kept
def run_task(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def run_task(runs: np.ndarray, measurements: np.ndarray, parameters: np.ndarray, task: np.ndarray, rows: np.ndarray,
                 out: np.ndarray) -> None:
        """``runs`` (m,) RUN of one filter, task (1,) TASK carried on; out (k,) CORE takes it after the runs ``rows``.

        measurements (j,) MEASUREMENT in order of arrival; parameters (1,) PARAMETERS; rows (k,) rising indices of runs.
        """
        if not sources:
            return
        first, row = 0, 0
        for i in range(len(runs)):
            first = task_step(parameters[0], task[0], runs[i], measurements, first)
            while row < len(rows) and rows[row] == i:
                out[row] = task[0].core
                row += 1

    return run_task
