"""The path between the states of a smoother: the IMU carried from a state to any time near it.

Increments since the start of each interval (rotation, velocity and position in the frame of its first state, without
gravity) depend on the biases alone. From them, the motion at a time follows from the state before it or from the one
after it. The reported path goes from the first to the second over the interval.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba as nb
import numpy as np
from scipy.spatial.transform import Rotation

from nanobench_tools import so3
from nanobench_tools.units import GRAVITY_M_S2

from .smoother_rows import Rows

UP = np.array([0.0, 0.0, GRAVITY_M_S2])


@dataclass(frozen=True)
class State:
    """At K times.

    - rotation (K, 3, 3): of the IMU; position, velocity (K, 3): world; biases acc, gyro (K, 3).
    - slow (K, d): quantities that change as random walks; others {letter: (K, d)}."""

    rotation: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acc_bias: np.ndarray
    gyro_bias: np.ndarray
    slow: np.ndarray
    others: dict[str, np.ndarray] = field(default_factory=dict)

    def then(self, later: State) -> State:
        """This and the states after its last, with which ``later`` begins."""
        def joined(name: str) -> np.ndarray:
            return np.concatenate([getattr(self, name), getattr(later, name)[1:]])

        return State(joined("rotation"), joined("position"), joined("velocity"), joined("acc_bias"),
                     joined("gyro_bias"), joined("slow"))


@dataclass(frozen=True)
class Motion:
    """position, velocity (m, 3) world, quaternion (m, 4) of the IMU, rate (m, 3) body."""

    position: np.ndarray
    velocity: np.ndarray
    quaternion: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class Steps:
    """The IMU between states.

    - time_s (K,): of the states; grid_s (n + 1,): all rows and states.
    - acc, gyro (n, 3): held over the step after each.
    - first, lengths (K - 1,): of the steps of each interval."""

    time_s: np.ndarray
    grid_s: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    first: np.ndarray
    lengths: np.ndarray


def steps_of(rows: Rows, time_s: np.ndarray) -> Steps:
    """The rows between the states at ``time_s`` (K,), means of neighbours held between them."""
    inner = rows.time_s[(rows.time_s > time_s[0]) & (rows.time_s < time_s[-1])]
    grid = np.unique(np.concatenate([time_s, inner]))
    at = np.stack([np.interp(grid, rows.time_s, column) for column in np.column_stack([rows.acc, rows.gyro]).T], axis=1)
    acc, gyro = np.split(0.5 * (at[1:] + at[:-1]), 2, axis=1)
    first = np.searchsorted(grid, time_s)
    return Steps(time_s, grid, acc, gyro, first[:-1], np.diff(first))


class Path:
    """Increments of all intervals for the biases of ``state``."""

    def __init__(self, steps: Steps, state: State) -> None:
        self.steps, self.state = steps, state
        owner = np.repeat(np.arange(len(steps.first)), steps.lengths)
        self.rate = steps.gyro - state.gyro_bias[owner]
        self.force = steps.acc - state.acc_bias[owner]
        step_s = np.diff(steps.grid_s)
        turn = small_turn(self.rate * step_s[:, None])
        self.turn, self.gain, self.way, *self.ends = increments(steps.first, steps.lengths, step_s, self.force, turn)
        self.quaternion = quaternion_of(state.rotation)

    def _increments(self, interval: np.ndarray, at_s: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rotation, velocity, position since the start of ``interval`` (m,), and the rate, at times in or near it."""
        steps = self.steps
        row = np.searchsorted(steps.grid_s, at_s, side="right") - 1
        row = np.clip(row, steps.first[interval], steps.first[interval] + steps.lengths[interval] - 1)
        dt = (at_s - steps.grid_s[row])[:, None]
        a = turned(self.turn[row], self.force[row])
        way = self.way[row] + self.gain[row] * dt + 0.5 * a * dt * dt
        return so3.multiply(self.turn[row], so3.exp(self.rate[row] * dt)), self.gain[row] + a * dt, way, self.rate[row]

    def near(self, owner: np.ndarray, at_s: np.ndarray) -> Motion:
        """At times (m,), from the states ``owner`` (m,) alone: forward from them, or backward."""
        state, time_s = self.state, self.steps.time_s
        ahead = (at_s >= time_s[owner]) & (owner < len(time_s) - 1) | (owner == 0)
        interval = np.where(ahead, owner, owner - 1)
        turn, gain, way, rate = self._increments(interval, at_s)
        tau = (at_s - time_s[owner])[:, None]
        q, v, p = (end[interval] for end in self.ends)
        back = ~ahead
        origin = self.quaternion[owner]
        origin[back] = so3.multiply(origin[back], so3.conjugate(q[back]))
        span = np.where(back, time_s[owner] - time_s[interval], 0.0)[:, None]
        v, p = np.where(back[:, None], v, 0.0), np.where(back[:, None], p, 0.0)
        # from the owner back to the start of its interval, and from there to the time
        v0 = state.velocity[owner] + UP * span - turned(origin, v)
        p0 = state.position[owner] - v0 * span + 0.5 * UP * span**2 - turned(origin, p)
        since = tau + span
        return Motion(p0 + v0 * since - 0.5 * UP * since**2 + turned(origin, way),
                      v0 - UP * since + turned(origin, gain), so3.multiply(origin, turn), rate)

    def at(self, at_s: np.ndarray) -> Motion:
        """At any times (m,): from the state before each to the one after it as time goes from one to the other."""
        time_s = self.steps.time_s
        before = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2)
        share = ((at_s - time_s[before]) / np.diff(time_s)[before]).clip(0.0, 1.0)[:, None]
        a, b = self.near(before, at_s), self.near(before + 1, at_s)
        over = share**2 * (3.0 - 2.0 * share)
        turn = so3.log(so3.multiply(so3.conjugate(a.quaternion), b.quaternion))
        return Motion(a.position + (b.position - a.position) * over, a.velocity + (b.velocity - a.velocity) * over,
                      so3.multiply(a.quaternion, so3.exp(turn * over)), a.rate)


@nb.njit(cache=True)
def increments(first: np.ndarray, lengths: np.ndarray, step_s: np.ndarray, force: np.ndarray,
               turn: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rotation (n, 4), velocity and position (n, 3) before each of n steps since the start of its interval. Then the
    same over the whole of each interval (K, .); force (n, 3) held over a step, turn (n, 4) of the step."""
    k, n = len(first), len(step_s)
    q, v, p = np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3))
    q_end, v_end, p_end = np.empty((k, 4)), np.empty((k, 3)), np.empty((k, 3))
    for i in range(k):
        x, y, z, w = 0.0, 0.0, 0.0, 1.0
        speed, place = np.zeros(3), np.zeros(3)
        for at in range(first[i], first[i] + lengths[i]):
            q[at, 0], q[at, 1], q[at, 2], q[at, 3] = x, y, z, w
            v[at], p[at] = speed, place
            a, b, c = force[at, 0], force[at, 1], force[at, 2]
            tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
            dt = step_s[at]
            push = (a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx)
            for j in range(3):
                place[j] += speed[j] * dt + 0.5 * push[j] * dt * dt
                speed[j] += push[j] * dt
            dx, dy, dz, dw = turn[at, 0], turn[at, 1], turn[at, 2], turn[at, 3]
            x, y, z, w = (w * dx + x * dw + y * dz - z * dy, w * dy - x * dz + y * dw + z * dx,
                          w * dz + x * dy - y * dx + z * dw, w * dw - x * dx - y * dy - z * dz)
        q_end[i, 0], q_end[i, 1], q_end[i, 2], q_end[i, 3] = x, y, z, w
        v_end[i], p_end[i] = speed, place
    return q, v, p, q_end, v_end, p_end


def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """``so3.rotate`` of (n, 4) and (n, 3), column by column: a third of the time for a few hundred rows."""
    (x, y, z, w), (a, b, c) = q.T, v.T
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.stack([a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx], axis=1)


def small_turn(angle: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) of small rotation vectors (n, 3), to fourth order."""
    square = np.sum(angle * angle, axis=1, keepdims=True)
    return np.concatenate([angle * (0.5 - square / 48.0), 1.0 - square / 8.0 + square**2 / 384.0], axis=1)


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotation matrices -> (n, 4) quaternions."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat())
