"""How sure the fixed-lag smoother is at a row: the covariance of its newest state, carried over the IMU to the row."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nanobench_tools import so3

from .covariance import LATE, LATER

POSE, VELOCITY, ACC_BIAS, GYRO_BIAS, SLOW = slice(0, 6), slice(6, 9), slice(9, 12), slice(12, 15), 15
"""Where the covariance of a state holds its parts; of a pose turn and way, both in the body."""


@dataclass
class Carried:
    """Collected on the way:

    - ``states`` of the newest state of each time [(covariance (n, n), rotation (3, 3))];
    - for every row, the state it is based on and the increment since. The increment is seconds, turn, way and gain in
      the body of the state, and their covariance (9, 9)."""

    states: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    owner: list[int] = field(default_factory=list)
    since: list[tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)

    def row(self, increment: Any) -> None:
        """One row, ``increment`` of gtsam after the newest state."""
        self.owner.append(len(self.states) - 1)
        self.since.append((increment.deltaTij(), increment.deltaRij().matrix(), increment.deltaPij(),
                           increment.deltaVij(), increment.preintMeasCov()[:9, :9]))

    def covariance(self, velocity: np.ndarray, slow: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """(n, 9, 9) of position and velocity (world) and attitude (body) as reported at the n rows.

        These have velocity (n, 3) m/s, slow quantities (n, d) and rate (n, 3) rad/s."""
        n, size = len(self.owner), self.states[0][0].shape[0]
        before, rotation = (np.array([state[k] for state in self.states])[self.owner] for k in (0, 1))
        dt, turn, way, gain, own = (np.array([one[k] for one in self.since]) for k in range(5))
        dt = dt[:, None, None]
        eye = np.broadcast_to(np.eye(3), (n, 3, 3))
        by = np.zeros((n, 9, size))
        by[:, :3, 0:3], by[:, 3:6, 0:3] = -rotation @ so3.hat(way), -rotation @ so3.hat(gain)
        by[:, :3, 3:6] = rotation
        by[:, :3, VELOCITY], by[:, 3:6, VELOCITY] = dt * eye, eye
        by[:, :3, ACC_BIAS], by[:, 3:6, ACC_BIAS] = -0.5 * dt**2 * rotation, -dt * rotation
        by[:, :3, SLOW + LATE] = velocity
        out = np.swapaxes(so3.matrix(so3.exp(slow[:, :3])), 1, 2)
        by[:, 6:9, 0:3], by[:, 6:9, GYRO_BIAS] = out @ np.swapaxes(turn, 1, 2), -dt * out
        by[:, 6:9, SLOW : SLOW + 3] = eye
        by[:, 6:9, SLOW + LATE] = by[:, 6:9, SLOW + LATER] = rate
        since = np.zeros((n, 9, 9))  # from (turn, way, gain) to (position, velocity, attitude)
        since[:, :3, 3:6] = since[:, 3:6, 6:9] = rotation
        since[:, 6:9, :3] = out
        return np.asarray(by @ before @ np.swapaxes(by, 1, 2) + since @ own @ np.swapaxes(since, 1, 2))
