"""A flight as a factor graph: preintegrated IMU between states, measurements as vectorised linear factors.

States every tenth of a second: pose (of the IMU), velocity, biases, and a vector of slow quantities. GTSAM's ImuFactor
(Forster et al., "On-manifold preintegration", T-RO 2017) connects states. Everything else is linearised for all states
at once in NumPy and passed as Jacobian factors. A Python function per factor and iteration costs more than the whole
solution. Gauss-Newton with halved steps; convergence is reported.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from nanobench_tools.errors import MissingExtraError
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

from ..drag_ekf import TUNED
from ..imu_noise import NOMINAL_HZ, ImuNoise
from ..inertial_core import DEFAULTS
from .covariance import covariance_of
from .smoother_rows import Rows
from .state_path import Path, State, steps_of

CHANGE_S = DEFAULTS["change_s"]
"""A signal's slope is taken over this: longer than the sensor's own noise, shorter than a manoeuvre."""

INTEGRATION_SD_M = 1e-3
"""Per root second: keeps the covariance of an interval of one row regular."""

LEAST_PACKETS = number("smoothers.factor_graph.least_packets")

LIFT_SD_M_S2 = TUNED["lift_bias_sd"]
"""By how much the accelerometer's biases jump when the motors begin to shake it, as of ``drag_ekf``."""

ITERATIONS, HALVINGS, SMALL_GAIN = 20, 6, 1e-3
"""Converged: the linearised problem promises to lower the cost by less than this share of it."""



def load() -> Any:
    """The package gtsam; MissingExtraError where it is not installed."""
    try:
        import gtsam
    except ImportError as error:
        raise MissingExtraError("gtsam", "smoothers") from error
    return gtsam


@dataclass(frozen=True)
class Linear:
    """A block of K factors.

    residual = measured - predicted (K, m); its negative derivative by the changes that ``keys`` index: letter -> (index
    (K,), (K, m, d)); ``sigma`` (m,) or (K, m).
    """

    keys: list[tuple[str, np.ndarray, np.ndarray]]
    residual: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True)
class Solution:
    """state and the path through it, iterations, converged. ``cost``: half the sum of squares of the weighted
    residuals. ``covariance`` (K, n, n): of pose, velocity, biases and slow quantities of each state; None if
    unknown."""

    state: State
    path: Path
    iterations: int
    converged: bool
    cost: float
    covariance: np.ndarray | None = None


class Problem:
    """Preintegration of the rows between the states, and the steps that carry a state to the rows after it."""

    def __init__(self, rows: Rows, noise: ImuNoise, time_s: np.ndarray) -> None:
        self.gtsam = load()
        self.rows, self.time_s, self.count = rows, time_s, len(time_s)
        self.steps = steps_of(rows, time_s)
        self.step_s = np.diff(self.steps.grid_s).tolist()
        cumulative = np.concatenate(([0.0], np.cumsum(rows.packets)))
        packets = np.diff(cumulative[np.searchsorted(rows.time_s, time_s, side="right")])
        poorer = np.sqrt(np.maximum(np.diff(time_s) * NOMINAL_HZ, 1.0) / np.maximum(packets, LEAST_PACKETS))
        level, upright = self._change(rows.acc[:, :2]), self._change(rows.acc[:, 2:])
        white = np.outer(poorer, [noise.acc_m_s2_sqrtHz] * 2 + [noise.upright])
        self.acc_sd = np.hypot(white, noise.stamp_s_sqrtHz * np.stack([level, level, upright], axis=1))
        self.gyro_sd = np.hypot(noise.gyro_rad_s_sqrtHz * poorer, noise.stamp_s_sqrtHz * self._change(rows.gyro))
        self.params = params_of(self.gtsam, noise)
        edges = np.searchsorted(rows.time_s, time_s, side="right")
        self.lifts = np.array([rows.lift[a:b].any() for a, b in pairwise(edges)], bool)
        self.gyro_walk = noise.gyro_walk_rad_s2_sqrtHz
        self.acc_walk = np.hypot(noise.acc_walk_m_s3_sqrtHz, self.lifts * LIFT_SD_M_S2 / np.sqrt(np.diff(time_s)))
        self.keys = {letter: [self.gtsam.symbol(letter, i) for i in range(self.count)] for letter in "xvbc"}
        self.increments = [self._increment(i) for i in range(self.count - 1)]

    def _change(self, values: np.ndarray) -> np.ndarray:
        """RMS over each interval of the time derivative of (n, d) values, over CHANGE_S, mean of axes."""
        time_s = self.rows.time_s
        ahead = np.clip(np.searchsorted(time_s, time_s + 0.5 * CHANGE_S), 0, len(time_s) - 1)
        back = np.clip(np.searchsorted(time_s, time_s - 0.5 * CHANGE_S), 0, len(time_s) - 1)
        slope = (values[ahead] - values[back]) / np.maximum(time_s[ahead] - time_s[back], 1e-3)[:, None]
        sums = np.concatenate(([0.0], np.cumsum(np.mean(slope**2, axis=1))))
        edges = np.searchsorted(time_s, self.time_s)
        first, last = edges[:-1], np.minimum(np.maximum(edges[1:], edges[:-1] + 1), len(time_s))
        return np.sqrt((sums[last] - sums[first]) / np.maximum(last - first, 1))

    def _increment(self, i: int) -> Any:
        """Preintegrated interval i, with its own noise."""
        eye = np.eye(3)
        self.params.setAccelerometerCovariance(np.diag(self.acc_sd[i] ** 2))
        self.params.setGyroscopeCovariance(eye * self.gyro_sd[i] ** 2)
        one = self.gtsam.PreintegratedImuMeasurements(self.params, self.gtsam.imuBias.ConstantBias())
        integrate = one.integrateMeasurement
        at = slice(self.steps.first[i], self.steps.first[i] + self.steps.lengths[i])
        for acc, gyro, step in zip(self.steps.acc[at], self.steps.gyro[at], self.step_s[at], strict=True):
            integrate(acc, gyro, step)
        return one

    def factor(self, i: int) -> Any:
        """ImuFactor of interval i."""
        x, v, b = (self.keys[letter] for letter in "xvb")
        return self.gtsam.ImuFactor(x[i], v[i], x[i + 1], v[i + 1], b[i], self.increments[i])

    def carried(self, state: State) -> State:
        """The last of ``state``, propagated over all intervals by the IMU alone: the graph's result without other
        measurements."""
        gtsam, last = self.gtsam, len(state.position) - 1
        bias = gtsam.imuBias.ConstantBias(state.acc_bias[last], state.gyro_bias[last])
        there = gtsam.NavState(gtsam.Rot3(state.rotation[last]), state.position[last], state.velocity[last])
        found = [there]
        for one in self.increments:
            there = one.predict(there, bias)
            found.append(there)
        rotation = np.array([s.attitude().matrix() for s in found])
        position, velocity = np.array([s.position() for s in found]), np.array([s.velocity() for s in found])
        held = (np.repeat(x[last:], self.count, axis=0) for x in (state.acc_bias, state.gyro_bias, state.slow))
        acc, gyro, slow = held
        return State(rotation, position, velocity, acc, gyro, slow)

    def solve(self, start: State, sd: State, walk: np.ndarray,
              blocks: Callable[[State, Path], Iterable[Linear]], warms: int | None = None) -> Solution:
        """Gauss-Newton from ``start``.

        ``sd``: SDs of its first state (``rotation`` as (1, 3)). ``walk`` (d,): change of the slow quantities [unit per
        root second]. ``blocks``: measurements other than the IMU. ``warms``: the slow quantity that is the drift of the
        vertical accelerometer's bias [m/s^3].
        """
        graph = self.gtsam.NonlinearFactorGraph()
        for i in range(self.count - 1):
            graph.push_back(self.factor(i))
        self._add_priors(graph, start, sd)

        def linearised(values: Any) -> tuple[State, Path, Any, float]:
            state = self._state(values, start)
            path, linear = Path(self.steps, state), graph.linearize(values)
            for block in self._walks(state, walk, warms):
                self._push(linear, block)
            for block in blocks(state, path):
                self._push(linear, block)
            return state, path, linear, linear.error(values.zeroVectors())

        values = self._values(start)
        state, path, linear, cost = linearised(values)
        ordering = self._in_time(start)
        converged, iteration = False, 0
        while iteration < ITERATIONS and not converged and np.isfinite(cost):
            iteration += 1
            delta = self._optimised(linear, ordering)
            for halving in range(HALVINGS):
                trial = values.retract(delta.scale(0.5**halving))
                new = linearised(trial)
                if new[3] <= cost:
                    break
            small = cost - linear.error(delta) <= SMALL_GAIN * max(cost, 1.0)
            if not new[3] <= cost:  # no step makes it smaller: at the bottom, or lost
                converged = small
                break
            converged = small
            values, (state, path, linear, cost) = trial, new
        covariance = self._covariance(linear, ordering, start) if converged else None
        return Solution(state, path, iteration, converged, float(cost), covariance)

    def _covariance(self, linear: Any, ordering: Any, like: State) -> np.ndarray | None:
        if like.others:
            return None
        keys = [list(row) for row in zip(*(self.keys[letter][: self.count] for letter in "xvbc"), strict=True)]
        try:
            net = linear.eliminateSequential(ordering)
            return covariance_of(net, keys, [6, 3, 6, like.slow.shape[1]])
        except (RuntimeError, np.linalg.LinAlgError):  # too weakly held to say
            return None

    def _optimised(self, linear: Any, ordering: Any) -> Any:
        try:
            return linear.optimize(ordering)
        except RuntimeError:  # too weakly held for Cholesky; QR is slower but robust to it
            return linear.optimize(ordering, self.gtsam.EliminateQR)

    def _in_time(self, like: State) -> Any:
        """Elimination from the first state to the last, biases and slow quantities at its end. Each then depends on
        earlier information, and the last pivots are well conditioned however far a tail without poses has drifted."""
        ordering = self.gtsam.Ordering()
        for i in range(self.count):
            for letter in (*like.others, "x", "v", "b", "c"):
                if i < len(self.keys[letter]):
                    ordering.push_back(self.keys[letter][i])
        return ordering

    def _walks(self, state: State, walk: np.ndarray, warms: int | None) -> Iterable[Linear]:
        """Biases and slow quantities change from state to state as random walks, the slow ones by ``walk`` (d,) [unit
        per root second]. The vertical accelerometer's bias also drifts by the slow quantity ``warms``."""
        k, d = self.count - 1, state.slow.shape[1]
        step_s, index = np.diff(self.time_s), np.arange(k)
        eye, root = np.broadcast_to(np.eye(d), (k, d, d)), np.sqrt(step_s)[:, None]
        yield Linear([("c", index, -eye), ("c", index + 1, eye)], state.slow[:-1] - state.slow[1:], walk * root)
        bias = np.column_stack([state.acc_bias, state.gyro_bias])
        by_c, residual = np.zeros((k, 6, d)), bias[:-1] - bias[1:]
        if warms is not None:
            by_c[:, 2, warms] = -step_s
            residual[:, 2] += step_s * state.slow[:-1, warms]
        eye = np.broadcast_to(np.eye(6), (k, 6, 6))
        sigma = np.repeat(np.column_stack([self.acc_walk, np.full(k, self.gyro_walk)]), 3, axis=1) * root
        yield Linear([("b", index, -eye), ("b", index + 1, eye), ("c", index, by_c)], residual, sigma)

    def _push(self, linear: Any, block: Linear) -> None:
        gtsam = self.gtsam
        sigma = np.broadcast_to(block.sigma, block.residual.shape)
        unit = gtsam.noiseModel.Unit.Create(block.residual.shape[1])
        columns = []
        for letter, index, jacobian in block.keys:
            keys = self.keys[letter]
            columns += [[keys[i] for i in index], list(jacobian / sigma[:, :, None])]
        push, factor = linear.push_back, gtsam.JacobianFactor
        for row in zip(*columns, list(block.residual / sigma), strict=True):
            push(factor(*row, unit))

    def _add_priors(self, graph: Any, start: State, sd: State) -> None:
        gtsam = self.gtsam
        diagonal = gtsam.noiseModel.Diagonal.Sigmas
        x, v, b, c = (self.keys[letter][0] for letter in "xvbc")
        pose = gtsam.Pose3(gtsam.Rot3(start.rotation[0]), start.position[0])
        graph.add(gtsam.PriorFactorPose3(x, pose, diagonal(np.concatenate([sd.rotation[0], sd.position[0]]))))
        graph.add(gtsam.PriorFactorVector(v, start.velocity[0], diagonal(sd.velocity[0])))
        bias = gtsam.imuBias.ConstantBias(np.zeros(3), np.zeros(3))
        graph.add(gtsam.PriorFactorConstantBias(b, bias, diagonal(np.concatenate([sd.acc_bias[0], sd.gyro_bias[0]]))))
        graph.add(gtsam.PriorFactorVector(c, start.slow[0], diagonal(sd.slow[0])))

    def _values(self, state: State) -> Any:
        gtsam = self.gtsam
        values = gtsam.Values()
        x, v, b, c = (self.keys[letter] for letter in "xvbc")
        for i in range(self.count):
            values.insert(x[i], gtsam.Pose3(gtsam.Rot3(state.rotation[i]), state.position[i]))
            values.insert(v[i], state.velocity[i])
            values.insert(b[i], gtsam.imuBias.ConstantBias(state.acc_bias[i], state.gyro_bias[i]))
            values.insert(c[i], state.slow[i])
        for letter, value in state.others.items():
            if letter not in self.keys:
                self.keys[letter] = [gtsam.symbol(letter, i) for i in range(len(value))]
            for key, one in zip(self.keys[letter], value, strict=True):
                values.insert(key, one)
        return values

    def _state(self, values: Any, like: State) -> State:
        vectors = self.gtsam.utilities.extractVectors
        poses = self.gtsam.utilities.extractPose3(values)
        bias = np.array([values.atConstantBias(key).vector() for key in self.keys["b"]])
        others = {letter: vectors(values, letter) for letter in like.others}
        return State(poses[:, :9].reshape(-1, 3, 3), poses[:, 9:], vectors(values, "v"), bias[:, :3], bias[:, 3:],
                     vectors(values, "c"), others)


def params_of(gtsam: Any, noise: ImuNoise) -> Any:
    """Parameters of preintegration that are the same for all intervals; gravity along -z."""
    params = gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY_M_S2)
    params.setIntegrationCovariance(np.eye(3) * INTEGRATION_SD_M**2)
    params.setBiasAccCovariance(np.eye(3) * noise.acc_walk_m_s3_sqrtHz**2)
    params.setBiasOmegaCovariance(np.eye(3) * noise.gyro_walk_rad_s2_sqrtHz**2)
    return params
