"""The firmware's Kalman filter as the senses of the plant: simulated IMU and poses in, the vehicle's estimate out.

The filter has no drag and attributes the force of the air to a tilt, so its attitude is wrong by some degrees per m/s.
This follows from its equations (``nanobench_tools.firmware.kalman``); there is no fit.
"""

from collections.abc import Callable, Sequence

import numba as nb
import numpy as np

from nanobench_tools import so3
from nanobench_tools.firmware.kalman import defaults
from nanobench_tools.firmware.kalman_task import MEASUREMENT, RUN, TASK, task_step
from nanobench_tools.firmware.kept import kept
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.settings import number, setting

from .plant import Plant
from .senses import TICK_S, Noise, Sensing

POSE_SD_M, POSE_SD_RAD = 0.001, 0.05
"""SD of a pose in the filter, as Crazyswarm2 sets it (crazyflies.yaml: locSrv.extPosStdDev, extQuatStdDev). Run again
on the recordings, the filter has the logged velocity with these values. With the firmware's 0.01 m and 4.5 mrad it
does not (``benchmarks/studies/onboard_velocity.py``)."""
LEAD_S = number("control.kalman_senses.lead_s")
QUEUE = 64
"""Poses that can wait for the radio; later ones are lost."""
START_SD = setting("control.kalman_senses.start_sd")
FIRST_MS = 1000
IMU_SIGMA = np.array([VEHICLE[name].value for name in ("acc_noise_m_s2", "acc_vibration_m_s2", "gyro_noise_rad_s",
                                                     "gyro_vibration_rad_s")])
"""Of the practice vehicle, whose noise is that of the recordings."""


@kept
def _run_filters(sources: str) -> Callable[..., None]:
    @nb.njit(cache=True, nogil=True)
    def _run_filters(parameters: np.ndarray, task: np.ndarray, run: np.ndarray, measurement: np.ndarray,
                     arrived: np.ndarray, milliseconds: int) -> None:
        """Propagate n filters through several runs with the same sample of the IMU in run (n,) RUN. The first
        ``arrived`` (n,) of measurement (n, QUEUE) MEASUREMENT are used at the first of them."""
        if not sources:
            return
        for i in range(len(task)):
            for k in range(milliseconds):
                run[i].t_ms += 1
                first = arrived[i] if k > 0 else 0
                task_step(parameters[i], task[i], run[i], measurement[i, :arrived[i]], first)

    return _run_filters


@nb.njit(cache=True, nogil=True)
def _feel(state: np.ndarray, before: np.ndarray, motor: np.ndarray, step_s: float, gravity: float, noise: np.ndarray,
          sigma: np.ndarray, acc_g: np.ndarray, gyro_deg_s: np.ndarray, rate: np.ndarray) -> None:
    """An IMU's sample of states (17, n): the mean specific force since the velocities before (3, n) in g, and the rate
    in deg/s. It also writes the rate in rad/s into rate (n, 3).

    noise (n, 6) unit normal; sigma (4,): accelerometer at rest, with turning motors; gyro at rest, with turning motors.
    """
    for i in range(state.shape[1]):
        x, y, z, w = state[6, i], state[7, i], state[8, i], state[9, i]
        fx = (state[3, i] - before[0, i]) / step_s
        fy = (state[4, i] - before[1, i]) / step_s
        fz = (state[5, i] - before[2, i]) / step_s + gravity
        mean = 0.25 * (motor[0, i] + motor[1, i] + motor[2, i] + motor[3, i])
        shake, turn = sigma[0] + sigma[1] * mean, sigma[2] + sigma[3] * mean
        ax = (1 - 2 * (y * y + z * z)) * fx + 2 * (x * y + w * z) * fy + 2 * (x * z - w * y) * fz
        ay = 2 * (x * y - w * z) * fx + (1 - 2 * (x * x + z * z)) * fy + 2 * (y * z + w * x) * fz
        az = 2 * (x * z + w * y) * fx + 2 * (y * z - w * x) * fy + (1 - 2 * (x * x + y * y)) * fz
        acc_g[i, 0], acc_g[i, 1] = (ax + shake * noise[i, 0]) / gravity, (ay + shake * noise[i, 1]) / gravity
        acc_g[i, 2] = (az + shake * noise[i, 2]) / gravity
        for k in range(3):
            rate[i, k] = state[10 + k, i] + turn * noise[i, 3 + k]
            gyro_deg_s[i, k] = rate[i, k] * 57.29577951308232


class Onboard:
    """n filters, begun where the vehicles are. Poses every 1 / pose_hz s arrive LEAD_S later than the estimated
    position is to be (``Sensing.delay_s``), except in outages. While the radio is ``Sensing.shut`` they wait, and come
    all at once. The accelerometer shows the mean of a step. ``belief`` (n, 13): what the filters begin with, else the
    truth. Errors are the filter's own.
    """

    def __init__(self, plant: Plant, sensing: Sensing, rngs: Sequence[np.random.Generator],
                 belief: np.ndarray | None = None) -> None:
        n = len(plant)
        self.sensing, self._plant, self._rngs = sensing, plant, rngs
        delay = np.broadcast_to(np.asarray(sensing.delay_s, float), (n,))
        self._lags = np.round((delay + LEAD_S) / plant.step_s).astype(int)
        self._ring = np.repeat(plant.state[None, :10], int(self._lags.max()) + 1, axis=0)
        self._every = max(1, round(1.0 / sensing.pose_hz / plant.step_s))
        self._per_tick = round(TICK_S / plant.step_s)
        self._open = np.ones(n, bool)
        self._count, self._lane = 0, np.arange(n)
        self._milliseconds = round(1000.0 * plant.step_s)
        self._noise = Noise(rngs, sensing.noise, n, 6)
        self._rate = np.ascontiguousarray(plant.state[RATE].T)
        self._felt = np.empty((2, n, 3), np.float32)
        self._begin(plant.state[:13].T if belief is None else belief)

    def _begin(self, belief: np.ndarray) -> None:
        n = len(belief)
        self._parameters, self._task = defaults(n), np.zeros(n, TASK)
        start = defaults(n)
        for name, sd in START_SD.items():
            start[name] = sd
        start["initial_m"] = belief[:, POSITION]
        self._run, self._measured = np.zeros(n, RUN), np.zeros((n, QUEUE), MEASUREMENT)
        self._queued = np.zeros(n, np.int64)
        self._run["t_ms"], self._run["flying"] = FIRST_MS, 1
        self._run["acc_g"][:, 2] = 1.0
        self._measured["attitude"] = 1
        self._measured["position_sd_m"], self._measured["attitude_sd_rad"] = POSE_SD_M, POSE_SD_RAD
        _run_filters(start, self._task, self._run, self._measured, self._queued, 1)
        core = self._task["core"]
        q = belief[:, QUATERNION]
        turn = np.stack([so3.rotate(q, axis) for axis in np.eye(3)], axis=-1)
        core["quaternion"], core["rotation"] = q[:, [3, 0, 1, 2]], turn
        core["state"][:, 3:6] = so3.rotate_inverse(q, belief[:, VELOCITY])
        self._task["sum"], self._task["samples"] = 0.0, 0

    def step(self) -> None:
        """After every step of the plant."""
        plant = self._plant
        self._count += 1
        newest = self._count % len(self._ring)
        self._ring[newest] = plant.state[:10]
        gravity = plant.model.vehicle.gravity_m_s2
        noise = self._noise.next()
        # contiguous arrays alone: one version of the function is compiled
        state, before, motor = map(np.ascontiguousarray, (plant.state, plant.before_m_s, plant.motor))
        _feel(state, before, motor, plant.step_s, gravity, noise, IMU_SIGMA, self._felt[0], self._felt[1],
              self._rate)
        self._run["acc_g"], self._run["gyro_deg_s"] = self._felt
        lost = any(start <= plant.time_s < end for start, end in self.sensing.outages)
        if self._count % self._every == 0 and not lost:
            self._send(self._ring[(newest - self._lags) % len(self._ring), :, self._lane], noise[:, 2::-1])
        if self.sensing.shut is not None:
            tick = min(self._count // self._per_tick, len(self.sensing.shut) - 1)
            self._open = ~self.sensing.shut[tick]
        _run_filters(self._parameters, self._task, self._run, self._measured, np.where(self._open, self._queued, 0),
                     self._milliseconds)
        self._queued[self._open] = 0

    def _send(self, seen: np.ndarray, noise: np.ndarray) -> None:
        """A pose of every vehicle, state seen (n, 10), joins its queue."""
        lanes = np.flatnonzero(self._queued < QUEUE)
        at = self._queued[lanes]
        self._measured["position_m"][lanes, at] = (seen[:, POSITION] + self.sensing.pose_noise_m * noise)[lanes]
        self._measured["quaternion"][lanes, at] = seen[lanes, QUATERNION]
        self._queued[lanes] += 1

    def read(self, tick: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """position, velocity (n, 3) world, quaternion (n, 4) believed now."""
        core = self._task["core"]
        velocity = np.einsum("nij,nj->ni", core["rotation"], core["state"][:, 3:6])
        q = core["quaternion"][:, [1, 2, 3, 0]].astype(float)
        return core["state"][:, :3].astype(float), velocity.astype(float), q

    def gyro(self) -> np.ndarray:
        """(n, 3) rad/s body, the newest sample."""
        return self._rate
