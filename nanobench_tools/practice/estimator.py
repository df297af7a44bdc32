"""The onboard estimator of the practice flights: the truth, a little late and a little wrong.

Lags and sizes are those of the published recordings after re-timing: position 20 ms, attitude 15 ms, velocity 5 ms
behind the gyro. Errors: position 0.4-1 mm, attitude a few tenths of a degree that wander slowly.
"""

from collections import deque

import numpy as np
from scipy.signal import lfilter

from .. import so3
from ..settings import number, setting
from .rigid_bodies import POSITION, QUATERNION, VELOCITY, Plant
from .timeline import TICK_S

POSITION_LAG_S = number("practice.estimator.position_lag_s")
ATTITUDE_LAG_S = number("practice.estimator.attitude_lag_s")
VELOCITY_LAG_S = number("practice.estimator.velocity_lag_s")
POSITION_M_S = setting("practice.estimator.position_m_s")
VELOCITY_M_S_S = setting("practice.estimator.velocity_m_s_s")
TILT_RAD_S = setting("practice.estimator.tilt_rad_s")
YAW_RAD_S = setting("practice.estimator.yaw_rad_s")
ERRORS = (  # channels, standard deviation, correlation time
    (slice(0, 3), *POSITION_M_S),
    (slice(3, 6), *VELOCITY_M_S_S),
    (slice(6, 8), *TILT_RAD_S),
    (slice(8, 9), *YAW_RAD_S),
)


def correlated_noise(rng: np.random.Generator, ticks: int, channels: int, time_s: float) -> np.ndarray:
    """First-order Gauss-Markov noise (ticks, channels) of unit variance at 100 Hz with correlation time ``time_s``."""
    keep = np.exp(-TICK_S / time_s)
    white = rng.standard_normal((ticks, channels))
    white[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=0))


class OnboardEstimator:
    """Estimated states of n vehicles; ``remember`` after every plant step, ``read`` at a 100 Hz tick."""

    def __init__(self, plant: Plant, rngs: list[np.random.Generator], ticks: int, step_s: float,
                 scale: float = 1.0) -> None:
        n = len(rngs)
        self._errors = np.zeros((ticks, 9, n))
        for i, rng in enumerate(rngs):
            for channels, sigma, time_s in ERRORS:
                width = channels.stop - channels.start
                self._errors[:, channels, i] = scale * sigma * correlated_noise(rng, ticks, width, time_s)
        self._lags = [round(lag / step_s) for lag in (POSITION_LAG_S, ATTITUDE_LAG_S, VELOCITY_LAG_S)]
        depth = max(self._lags) + 1
        self._past: deque[np.ndarray] = deque([plant.state] * depth, maxlen=depth)

    def remember(self, state: np.ndarray) -> None:
        """``state`` (17, n) of the plant after a step."""
        self._past.append(state)

    def read(self, tick: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """position (n, 3), velocity (n, 3) world, quaternion (n, 4) as the vehicle believes them at this tick."""
        e = self._errors[tick]
        late_p, late_q, late_v = (self._past[-1 - lag] for lag in self._lags)
        q = so3.multiply(so3.exp(e[6:9].T), late_q[QUATERNION].T)
        return (late_p[POSITION] + e[0:3]).T, (late_v[VELOCITY] + e[3:6]).T, q
