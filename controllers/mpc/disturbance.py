"""Disturbance observer: the force and moment that the model does not explain.

A Luenberger observer of the state and of a steady force and moment (both per mass and inertia). It is the source of
offset-free predictive control (Pannocchia, Rawlings 2003, doi:10.1002/aic.690490213). Measurements have different
ages: each is compared with the prediction for its own time. A correction is also applied to past states, so that no
error is counted twice.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numba as nb
import numpy as np

from nanobench_tools.physics.model import Model
from nanobench_tools.settings import number, setting
from nanobench_tools.slices import put

from .casadi_code import Call
from .prediction_model import DISTURBANCES, STATES, rollout_function


@dataclass(frozen=True)
class Tuning:
    """Tuning of the observer.

    ``ages_s``: ages of position, velocity, attitude and rate when they arrive. ``share``: fraction of an innovation
    that is applied at once, of the same four. ``place_1_s``: speed at which position, velocity and force follow
    positions alone (three equal poles; 0: not at all). ``force_1_s``, ``moment_1_s``: speed at which velocities correct
    the force and rates the moment. ``most``: bounds of both [m/s^2, rad/s^2].

    Velocities are ignored by default. The firmware's filter overestimates them by 7 % under aerodynamic forces, and
    underestimates them by up to 13 % over a radio with gaps (docs/control.md).
    """

    ages_s: tuple[float, float, float, float] = setting("control.disturbance.tuning_ages_s")
    share: tuple[float, float, float, float] = setting("control.disturbance.tuning_share")
    place_1_s: float = number("control.disturbance.tuning_place_1_s")
    force_1_s: float = number("control.disturbance.tuning_force_1_s")
    moment_1_s: float = number("control.disturbance.tuning_moment_1_s")
    most: tuple[float, float] = setting("control.disturbance.tuning_most")


@nb.njit(cache=True)
def _turn(q: np.ndarray, v: np.ndarray) -> None:
    """q times the quaternion of the small rotation vector v (3), normalised, in place."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    a, b, c = 0.5 * v[0], 0.5 * v[1], 0.5 * v[2]
    q[0], q[1], q[2] = x + w * a + y * c - z * b, y + w * b + z * a - x * c, z + w * c + x * b - y * a
    q[3] = w - x * a - y * b - z * c
    q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])


@nb.njit(cache=True)
def _between(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """2 vec(q^-1 p) of the shorter way (3)."""
    x, y, z, w = -q[0], -q[1], -q[2], q[3]
    out = np.empty(3)
    out[0] = w * p[0] + x * p[3] + y * p[2] - z * p[1]
    out[1] = w * p[1] + y * p[3] + z * p[0] - x * p[2]
    out[2] = w * p[2] + z * p[3] + x * p[1] - y * p[0]
    return out * (2.0 if w * p[3] - x * p[0] - y * p[1] - z * p[2] >= 0.0 else -2.0)


@nb.njit(cache=True)
def _correct(past: np.ndarray, head: int, ages: np.ndarray, share: np.ndarray, pull: np.ndarray, learn: np.ndarray,
             most: np.ndarray, measured: np.ndarray, new_pose: np.ndarray, good: np.ndarray, d: np.ndarray) -> None:
    """``past`` (K, n, 17): a ring with the present at ``head``. ``measured`` (n, 13). ages in steps. ``pull``: gain
    from a position error to velocity and force."""
    count = past.shape[0]
    gap = np.empty(13)
    for i in range(past.shape[1]):
        if not good[i]:
            continue
        for group, (a, b) in enumerate(((0, 3), (3, 6), (6, 10), (10, 13))):
            whole = int(ages[group])
            part = ages[group] - whole
            now, old = past[(head - whole) % count, i], past[(head - whole - 1) % count, i]
            if group != 2:
                for k in range(a, b):
                    gap[k] = measured[i, k] - (now[k] + part * (old[k] - now[k]))
            else:
                q = now[6:10] + part * (old[6:10] - now[6:10])
                put(gap[6:], _between(q, measured[i, 6:10]))
        if not new_pose[i]:
            gap[:9] = 0.0
        turn = share[2] * gap[6:9]
        for k in range(count):
            x = past[k, i]
            for j in range(3):
                x[j] += share[0] * gap[j]
                x[3 + j] += share[1] * gap[3 + j] + pull[0] * gap[j]
                x[10 + j] += share[3] * gap[10 + j]
            _turn(x[6:10], turn)
        for j in range(3):
            d[i, j] = min(max(d[i, j] + learn[0] * gap[3 + j] + pull[1] * gap[j], -most[0]), most[0])
            d[i, 3 + j] = min(max(d[i, 3 + j] + learn[1] * gap[10 + j], -most[1]), most[1])


class Observer:
    """States (n, 17) and disturbances (n, 6) of n vehicles, as ``prediction_model`` orders them, one step a period.

    ``lengths``: how many commands ``predicted`` will mostly be given; so many are flown by one compiled function.
    """

    def __init__(self, model: Model, period_s: float, tuning: Tuning | None = None,
                 lengths: Iterable[int] = ()) -> None:
        self.period_s, self.tuning = period_s, tuning or Tuning()
        self._flights = {count: Call(rollout_function(model, count)) for count in {1, *lengths} - {0}}
        self._ages = np.array(self.tuning.ages_s) / period_s
        self._share = np.array(self.tuning.share)
        # the pair (state, disturbance) of each channel settles as exp(-t speed) and as exp(-t share / period)
        speeds = np.array([self.tuning.force_1_s, self.tuning.moment_1_s])
        self._learn = (1.0 - np.exp(-speeds * period_s)) * self._share[[1, 3]] / period_s
        w = self.tuning.place_1_s
        self._pull = period_s * np.array([3.0 * w**2, w**3])
        self._most = np.array(self.tuning.most)

    def reset(self, n: int, thrust_N: float) -> None:
        self.state = np.zeros((n, STATES))
        self.state[:, 9], self.state[:, 13:] = 1.0, thrust_N
        self.disturbance = np.zeros((n, DISTURBANCES))
        self._past = np.repeat(self.state[None], int(self._ages.max()) + 2, axis=0)
        self._head = 0
        self.known = np.zeros(n, bool)

    def begin(self, which: np.ndarray, measured: np.ndarray) -> None:
        """Reset vehicles ``which`` (n,) bool to the measurement (n, 13); the estimated disturbance stays."""
        self.state[which, :13] = measured[which]
        self._past[:, which] = self.state[which]
        self.known |= which

    def correct(self, measured: np.ndarray, good: np.ndarray, new_pose: np.ndarray) -> None:
        """measured (n, 13): position, velocity, quaternion, rate. good (n,): vehicles with a measurement. new_pose
        (n,): those with a new pose and velocity. Old ones have no weight."""
        self._past[self._head] = self.state
        _correct(self._past, self._head, self._ages, self._share, self._pull, self._learn, self._most, measured,
                 new_pose, good, self.disturbance)
        self.state = self._past[self._head].copy()

    def advance(self, seconds: np.ndarray, commands: np.ndarray) -> None:
        """To the next period, under thrusts asked (k, n, 4), each for so many seconds (k,)."""
        self.state = self.predicted(seconds, commands)
        self._head = (self._head + 1) % len(self._past)
        self._past[self._head] = self.state

    def predicted(self, seconds: np.ndarray, commands: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """(n, 17) after commanded thrusts (k, n, 4), each for its duration (k,) s. Starts from now or from ``start``
        (n, 17); nan stays nan."""
        found = (self.state if start is None else start).copy()
        count = len(seconds)
        if count not in self._flights:
            for j in range(count):
                found = self.predicted(seconds[j:j + 1], commands[j:j + 1], found)
            return found
        flight = self._flights[count]
        x, u, d, dt = flight.given
        dt[:, 0] = seconds
        for i in range(len(found)):
            x[0], u[:], d[0] = found[i], commands[:, i], self.disturbance[i]
            found[i] = flight()[0][-1]
        return found
