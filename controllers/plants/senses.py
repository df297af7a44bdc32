"""What a vehicle of the plant believes of its state: poses that come late, seldom or not, an IMU, an estimator.

``Late`` is the estimate as recordings over a good radio show it (the truth, late, with slow errors) and the faster
one; ``kalman_senses.Onboard`` runs the firmware's Kalman filter on simulated IMU and poses, so that its errors come
from its own equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numba as nb
import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics.model import POSITION, QUATERNION, RATE, VELOCITY
from nanobench_tools.practice.estimator import ATTITUDE_LAG_S, ERRORS, POSITION_LAG_S, VELOCITY_LAG_S, correlated_noise
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.settings import number

from .plant import STEP_S, Plant

TICK_S = 0.01
SUBSTEPS = round(TICK_S / STEP_S)


@dataclass(frozen=True)
class Sensing:
    """Properties of the sensing of a plant.

    - delay_s: from the truth to the estimated position, including the pose's way (recordings: 20 ms). Attitude and
      velocity are as much sooner as in the recordings.
    - error: size of the slow errors over the recordings'; noise: of gyro and accelerometer over the recordings'.
    - outages: (start_s, end_s) without poses.
    - pose_hz and pose_noise_m: inputs of the firmware's filter (``Late`` has both in its errors).
    - shut (ticks, n) bool: the radio is silent in this tick of 10 ms, and poses wait (the firmware's filter only)."""

    delay_s: np.ndarray | float = POSITION_LAG_S
    error: np.ndarray | float = 1.0
    noise: np.ndarray | float = 1.0
    outages: tuple[tuple[float, float], ...] = ()
    pose_hz: float = 100.0
    pose_noise_m: float = number("control.senses.sensing_pose_noise_m")
    shut: np.ndarray | None = None


DRIFT_M_S2 = number("control.senses.drift_m_s2")
DRIFT_M_S = number("control.senses.drift_m_s")
"""Spread of the acceleration error and of the velocity error with which an estimate goes on without poses. With these
0.05 m are lost in a second (recordings, dead reckoning over 1 s: median 0.04-0.05 m)."""
BACK_S = number("control.senses.back_s")


@nb.njit(cache=True, nogil=True)
def _read(ring: np.ndarray, newest: int, lags: np.ndarray, out: np.ndarray) -> None:
    """out (17, n) from ring (depth, 17, n): position, velocity, quaternion each as old as lags (3, n) says, in
    steps."""
    depth, _, n = ring.shape
    for first, last, which in ((0, 3, 0), (3, 6, 1), (6, 10, 2)):
        for i in range(n):
            at = (newest - lags[which, i]) % depth
            for c in range(first, last):
                out[c, i] = ring[at, c, i]


class Late:
    """The truth as old as ``Sensing.delay_s`` says, with the recordings' slow errors; drawn from ``rngs``, one for
    each vehicle. Read every 10 ms; ``gyro`` every step."""

    def __init__(self, plant: Plant, sensing: Sensing, rngs: Sequence[np.random.Generator], ticks: int) -> None:
        n = len(plant)
        self.sensing, self._plant = sensing, plant
        share = np.broadcast_to(np.asarray(sensing.delay_s, float), (n,)) / POSITION_LAG_S
        lags = np.array([POSITION_LAG_S, VELOCITY_LAG_S, ATTITUDE_LAG_S])[:, None] * share
        self._lags = np.round(lags / plant.step_s).astype(np.int64)
        self._ring = np.repeat(plant.state[None], int(self._lags.max()) + 1, axis=0)
        self._newest = 0
        size = np.broadcast_to(np.asarray(sensing.error, float), (n,))
        self._errors = np.zeros((ticks, 9, n), np.float32)
        for i, rng in enumerate(rngs):
            for channels, sigma, time_s in ERRORS:
                width = channels.stop - channels.start
                self._errors[:, channels, i] = size[i] * sigma * correlated_noise(rng, ticks, width, time_s)
        self._noise = Noise(rngs, sensing.noise, n, 3)
        drawn = np.stack([rng.standard_normal((2, 3)) for rng in rngs], axis=-1)
        self._drift = drawn * np.array([DRIFT_M_S, DRIFT_M_S2])[:, None, None]
        self._away = np.zeros((2, 3, n))
        self._out = np.zeros((17, n))

    def step(self) -> None:
        """After every step of the plant."""
        self._newest = (self._newest + 1) % len(self._ring)
        self._ring[self._newest] = self._plant.state

    def read(self, tick: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """position, velocity (n, 3) world, quaternion (n, 4) believed at a tick."""
        _read(self._ring, self._newest, self._lags, self._out)
        error = self._errors[min(tick, len(self._errors) - 1)]
        self._wander(tick * TICK_S)
        position = self._out[POSITION] + error[0:3] + self._away[0]
        velocity = self._out[VELOCITY] + error[3:6] + self._away[1]
        return position.T, velocity.T, so3.multiply(so3.exp(error[6:9].T.astype(float)), self._out[QUATERNION].T)

    def gyro(self) -> np.ndarray:
        """(n, 3) rad/s body, now."""
        turning = self._plant.motor.mean(axis=0)
        sigma = VEHICLE["gyro_noise_rad_s"].value + VEHICLE["gyro_vibration_rad_s"].value * turning
        return np.asarray(self._plant.state[RATE].T + self._noise.next() * sigma[:, None])

    def _wander(self, time_s: float) -> None:
        outages = self.sensing.outages
        if any(start <= time_s < end for start, end in outages):
            if any(start <= time_s < start + TICK_S for start, _ in outages):
                self._away[1] = self._drift[0]
            self._away[0] += TICK_S * self._away[1]
            self._away[1] += TICK_S * self._drift[1]
        elif outages:
            self._away *= 1.0 - TICK_S / BACK_S


class Noise:
    """Unit normal numbers (n, width) times ``scale``, new at every step; drawn STEPS at once from one generator
    each."""

    STEPS = 500

    def __init__(self, rngs: Sequence[np.random.Generator], scale: np.ndarray | float, n: int, width: int) -> None:
        self._rngs, self._width, self._at = rngs, width, 0
        self._scale = np.broadcast_to(np.asarray(scale, np.float32), (n,))[:, None]
        self._block = np.zeros((0, n, width), np.float32)

    def next(self) -> np.ndarray:
        """Of the next step; valid until the one after."""
        at = self._at % self.STEPS
        if at == 0:
            shape = (self.STEPS, self._width)
            self._block = np.stack([r.standard_normal(shape, dtype=np.float32) for r in self._rngs], axis=1)
            self._block *= self._scale
        self._at += 1
        return np.asarray(self._block[at])
