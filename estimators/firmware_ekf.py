"""The vehicle's Kalman filter, run again on a recording with its poses and IMU alone."""

from collections.abc import Mapping, Sequence

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.kalman import ATTITUDE_SD_RAD, CORE, POSITION_SD_M, defaults
from nanobench_tools.firmware.kalman_task import MEASUREMENT, RUN, TASK, run_task
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")

HOLE_S = number("imu.firmware_ekf.hole_s")
END_S = number("imu.firmware_ekf.end_s")
FLYING_S = 2.0
"""The supervisor believes in a flight for so long after a motor last turned (supervisor.c)."""
_FIRST_MS = 1000
"""Tick of the first run."""


class FirmwareEkf:
    """The vehicle's own Kalman filter, run again: core and 1 kHz task of firmware 2025.12.1
    (``nanobench_tools.firmware.kalman``).

    The logged estimate is not used. The filter starts at position and yaw of the first pose, level and at rest as the
    firmware does. Beyond 10 m/s or 100 m it restarts there. It has no biases, and no drag unless it is given, as on
    board.

    Inputs:

    - the poses in ``mocap``, each applied at its timestamp with no delay;
    - the recorded IMU, a row per 10 ms of the vehicle's samples at 1 ms. Samples between two rows are interpolated
      linearly;
    - the motors, for the flag "flying" (without them it flies from the start).

    The estimate at a row is the task's output up to then, and moves at its 100 Hz. Rows of the IMU are placed on the
    nearest ms, poses and motors on the next one, counted between rows.

    Parameters
    ----------
    parameters : ndarray, optional
        (1,) PARAMETERS: the firmware's parameters with their own start state; default: the firmware's.
    held : bool
        A row of the IMU applies until the next, rather than by linear interpolation.
    pose_sd : tuple of float
        Assumed standard deviations of a pose: m and rad.
    changes : mapping, optional
        Fields of the parameters that differ from the defaults, such as ``drag_1_s``.
    """

    name = "firmware_ekf"
    causal = True

    def __init__(self, parameters: np.ndarray | None = None, held: bool = False,
                 pose_sd: tuple[float, float] = (POSITION_SD_M, ATTITUDE_SD_RAD),
                 changes: Mapping[str, float | Sequence[float]] | None = None) -> None:
        self.parameters, self.held, self.pose_sd, self.changes = parameters, held, pose_sd, dict(changes or {})

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``imu``, the poses in ``mocap`` and, if there, ``motor``.

        Returns
        -------
        Estimate
            At the rows of the IMU from the first pose on.

        Raises
        ------
        InputError
            Without a pose, or without IMU after it.
        """
        imu, mocap = flight["imu"], flight["mocap"]
        given = np.isfinite(mocap[POSE]).all(axis=1) & np.isfinite(mocap.time_s)
        pose_s, poses = mocap.time_s[given], mocap[POSE][given]
        values = imu[IMU] / np.repeat([GRAVITY_M_S2, np.pi / 180.0], 3)
        rows = np.isfinite(imu.time_s) & np.isfinite(values).all(axis=1)
        if len(pose_s):
            rows &= imu.time_s >= pose_s[0]
        time_s, values = imu.time_s[rows], values[rows]
        if not len(pose_s) or len(time_s) < 2:
            raise InputError(flight.provenance.path, "the firmware's filter needs an IMU and a pose to start from")
        rising = np.concatenate(([True], time_s[1:] > np.maximum.accumulate(time_s)[:-1]))
        time_s, values = time_s[rising], values[rising]
        ends = np.flatnonzero(np.diff(time_s) > END_S)
        last = ends[0] + 1 if len(ends) else len(time_s)
        time_s, values = time_s[:last], values[:last]
        clock = _Clock(time_s)
        out, task = np.zeros(len(time_s), CORE), np.zeros(1, TASK)
        run_task(_runs(flight, clock, values, self.held), _measurements(pose_s, poses, clock, self.pose_sd),
                 self._start(poses[0]) if self.parameters is None else self.parameters, task, clock.rows, out)
        q = out["quaternion"][:, [1, 2, 3, 0]].astype(float)
        velocity = np.einsum("nij,nj->ni", out["rotation"], out["state"][:, 3:6]).astype(float)
        return Estimate(time_s, out["state"][:, :3].astype(float), q / np.linalg.norm(q, axis=1, keepdims=True),
                        velocity)

    def _start(self, pose: np.ndarray) -> np.ndarray:
        found = defaults()
        found["initial_m"], found["initial_yaw_rad"] = pose[:3], so3.euler_zyx(pose[None, 3:])[0, 2]
        for name, value in self.changes.items():
            found[name] = value
        return found


class _Clock:
    """Ticks of 1 ms from the first row on; rows (n,) of the IMU lie on whole ones."""

    def __init__(self, time_s: np.ndarray) -> None:
        self.time_s = time_s
        self.rows = np.round((time_s - time_s[0]) * 1000.0).astype(np.int64)

    def next(self, time_s: np.ndarray) -> np.ndarray:
        """The first tick (k,) not before the timestamps (k,): one after a row is at a later tick than that row."""
        begin, end = self.time_s[0], self.time_s[-1]
        outside = np.minimum(time_s - begin, 0.0) + np.maximum(time_s - end, 0.0)
        found = np.interp(time_s, self.time_s, self.rows) + 1000.0 * outside
        return np.asarray(np.ceil(found - 1e-6).astype(np.int64))


def _runs(flight: Flight, clock: _Clock, values: np.ndarray, held: bool) -> np.ndarray:
    """(m,) RUN from the first to the last row (n,) of the IMU; values (n, 6) g, deg/s."""
    rows = clock.rows
    ticks = np.arange(rows[-1] + 1)
    before = np.searchsorted(rows, ticks, side="right") - 1
    after = np.minimum(before + 1, len(rows) - 1)
    if held:
        samples = values[before]
    else:
        samples = np.stack([np.interp(ticks, rows, column) for column in values.T], axis=1)
    samples[(rows[after] - rows[before] > 1000.0 * HOLE_S) & (ticks > rows[before])] = np.nan
    runs = np.zeros(len(ticks), RUN)
    runs["t_ms"] = _FIRST_MS + ticks
    runs["acc_g"], runs["gyro_deg_s"] = samples[:, :3], samples[:, 3:]
    runs["flying"] = _flying(flight, clock, ticks)
    return runs


def _flying(flight: Flight, clock: _Clock, ticks: np.ndarray) -> np.ndarray:
    """(m,) bool: a motor turned within the last FLYING_S."""
    if "motor" not in flight or not len(flight["motor"]):
        return np.ones(len(ticks), dtype=bool)
    motor = flight["motor"]
    turns = (np.nan_to_num(motor.values) > 0.0).any(axis=1) & np.isfinite(motor.time_s)
    on = np.sort(clock.next(motor.time_s[turns]))
    if not len(on):
        return np.zeros(len(ticks), dtype=bool)
    latest = np.searchsorted(on, ticks, side="right") - 1
    return np.asarray((latest >= 0) & (ticks - on[np.maximum(latest, 0)] <= 1000.0 * FLYING_S))


def _measurements(pose_s: np.ndarray, poses: np.ndarray, clock: _Clock, sd: tuple[float, float]) -> np.ndarray:
    """(j,) MEASUREMENT in order of arrival; of the poses before the first run only the newest."""
    tick = clock.next(pose_s)
    order = np.argsort(tick, kind="stable")
    order = order[max(int(np.searchsorted(tick[order], 0, side="right")) - 1, 0):]
    found = np.zeros(len(order), MEASUREMENT)
    found["t_ms"], found["attitude"] = _FIRST_MS + np.maximum(tick[order], 0), 1
    found["position_m"], found["quaternion"] = poses[order, :3], poses[order, 3:]
    found["position_sd_m"], found["attitude_sd_rad"] = sd
    return found
