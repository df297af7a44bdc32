"""An incremental fixed-lag smoother: online estimates, with the last seconds still open to change (GTSAM, iSAM2).

A state at the time each pose was measured, made when it arrives, or after WAIT_S without one. Between states:
preintegrated IMU (CombinedImuFactor); poses and drag are linear factors at the predicted state. The newest state is
propagated by the IMU. A row's value uses no later part of the recording.
"""

import time
from bisect import bisect_left, bisect_right
from dataclasses import replace
from typing import Any

import numba as nb
import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import count, number
from nanobench_tools.slices import put

from ..drag_ekf import TUNED
from ..imu_noise import ImuNoise
from ..inertial_core import tilt_factor
from .aided_batch import GtsamAided, drag
from .batch import NOISE, UNKNOWN_SD_M, VELOCITY_SD_M_S
from .factor_graph import CHANGE_S, LIFT_SD_M_S2, Linear, load, params_of
from .lag_covariance import Carried
from .smoother_rows import NEAR_S, Rows, rows_of
from .state_path import State, quaternion_of

LEAST_ROWS = count("smoothers.fixed_lag.least_rows")

LAG_S = number("smoothers.fixed_lag.lag_s")

POSE_SD_M, ATTITUDE_SD_RAD = TUNED["position_sd"], [TUNED[axis] for axis in ("roll_pitch_sd", "pitch_sd", "yaw_sd")]
"""Disagreement of a pose and the IMU in addition to the given noise, as in ``drag_ekf``."""

FIRST_POSES = 6
"""Whose intervals show how often poses come."""

WAIT_S = number("smoothers.fixed_lag.wait_s")

FLYING_PWM = number("smoothers.fixed_lag.flying_pwm")

EYE = np.eye(3)
USED = 8
"""Of the slow quantities of the aided smoother: all but the thrust scale and the drift of the vertical bias."""

WALK = np.append(np.full(3, TUNED["mount_walk"]), GtsamAided.walk[3:USED])
"""Of these; the rotation to the tracked body changes as little as in ``drag_ekf``: poses then say more of the tilt."""


class GtsamFixedLag:
    """Causal fixed-lag smoother.

    Parameters
    ----------
    noise : ImuNoise, optional
        Noise of the IMU; default: a 40 g vehicle in flight.

    Attributes
    ----------
    update_s : list of float
        Processor seconds of every update of the last flight.
    """

    name = "gtsam_fixed_lag"
    causal = True

    def __init__(self, noise: ImuNoise | None = None) -> None:
        self.noise = noise or NOISE
        self.update_s: list[float] = []

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Uses ``imu`` and the poses in ``mocap``.

        Returns
        -------
        Estimate
            At the rows of the IMU; a value uses no later part of the recording.

        Raises
        ------
        InputError
            As of the other inertial methods.
        MissingExtraError
            Without gtsam.
        """
        rows = rows_of(flight, causal=True)
        run = _Run(flight, rows, self.noise)
        estimate = run.through()
        self.update_s = run.update_s
        return estimate


class _Run:
    """One pass over the rows; everything that ends in _s is a time, on the IMU's clock less its wander."""

    def __init__(self, flight: Flight, rows: Rows, noise: ImuNoise) -> None:
        self.gtsam, self.rows, self.noise = load(), rows, noise
        settings = self.gtsam.ISAM2Params()
        settings.relinearizeSkip = 1
        self.smoother = self.gtsam.IncrementalFixedLagSmoother(LAG_S, settings)
        self.params = params_of(self.gtsam, noise)
        self.values = np.column_stack([rows.acc, rows.gyro])
        self.slope_sums, self.force_sums = _sums(_slope(rows.time_s, self.values)), _sums(rows.acc)
        self.time_s, self.pose_s = rows.time_s.tolist(), rows.pose_s.tolist()
        self.arrival_s = (rows.pose_s + float(flight.metadata.get("pose_delay_s", 0.0))).tolist()
        self.lift_s = rows.time_s[rows.lift].tolist()
        position_sd_m = UNKNOWN_SD_M if np.isnan(rows.noise_m) else rows.noise_m
        self.pose_sd = np.array([np.hypot(position_sd_m, POSE_SD_M)] * 3 + ATTITUDE_SD_RAD)
        apart_s = max(float(np.median(np.diff(rows.pose_s[:FIRST_POSES]))), NEAR_S)
        self.pose_sd[3:5] *= np.sqrt(tilt_factor(np.array([0.0, apart_s]), 1, TUNED["tilt_s"]))
        self.turns = [self.gtsam.Rot3(r) for r in so3.matrix(rows.quaternion)]
        middle, self.step_s = 0.5 * (self.values[1:] + self.values[:-1]), np.diff(rows.time_s).tolist()
        self.variances = np.zeros((3, 3)), np.zeros((3, 3))
        self.force, self.rate = list(middle[:, :3]), list(middle[:, 3:])
        self.flying = _flying(flight, rows)
        self.update_s: list[float] = []
        self.sure = Carried()
        self.count, self.state_s = 0, self.pose_s[0]

    def through(self) -> Estimate:
        """Every row in turn: states that have become possible, then the newest one carried to the row."""
        rows, report_s = self.rows, self.rows.report_s.tolist()
        row = bisect_left(self.time_s, self.state_s)
        while report_s[row] < self.arrival_s[0]:
            row += 1
        self._begin()
        first, taken = row, 0
        found: list[Any] = []
        slow: list[np.ndarray] = []
        tail = self._increment(self.state_s, self.time_s[row])
        for row in range(first, len(report_s)):
            now_s, stamp = self.time_s[row], report_s[row]
            if row > first:
                tail.integrateMeasurement(self.force[row - 1], self.rate[row - 1], self.step_s[row - 1])
            try:
                made, taken = self._possible(now_s, stamp, taken)
            except RuntimeError as error:  # of gtsam; nothing later can be known then
                if len(found) < LEAST_ROWS:
                    raise InputError(rows.place, f"gtsam_fixed_lag lost the flight at {stamp:.2f} s",
                                     "nanobench audit shows the faults of the recording") from error
                break
            if made:
                tail = self._increment(self.state_s, now_s)
                self._report()
            found.append(tail.predict(self.there, self.bias))
            self.sure.row(tail)
            slow.append(self.slow)
        return self._given_out(first, found, np.array(slow))

    def _possible(self, now_s: float, stamp_s: float, taken: int) -> tuple[bool, int]:
        """Makes the states that have become possible; (whether there was one, the last pose seen)."""
        before = self.count
        while taken + 1 < len(self.pose_s) and self.arrival_s[taken + 1] <= stamp_s + 1e-9 \
                and self.pose_s[taken + 1] <= now_s:
            taken += 1
            if self.pose_s[taken] - self.state_s >= NEAR_S:
                self._update(self.pose_s[taken], taken)
        if stamp_s - self.state_s >= WAIT_S and now_s - self.state_s >= 0.5 * WAIT_S:
            self._update(now_s, None)
        return self.count > before, taken

    def _report(self) -> None:
        """What the smoother says of its newest state."""
        keys = [self.x, self.v, self.b, self.c]
        joint = self.smoother.getISAM2().jointMarginalCovariance(keys).fullMatrix()
        self.sure.states.append((joint, self.there.attitude().matrix()))

    def _given_out(self, first: int, found: list[Any], slow: np.ndarray) -> Estimate:
        rows = self.rows
        position, velocity = np.array([s.position() for s in found]), np.array([s.velocity() for s in found])
        rotation = quaternion_of(np.array([s.attitude().matrix() for s in found]))
        stamp = rows.report_s[first : first + len(found)]
        ahead = (stamp + slow[:, 3] - rows.time_s[first : first + len(found)])[:, None]
        turn = so3.exp(rows.gyro[first : first + len(found)] * (ahead + slow[:, 4:5]))
        attitude = so3.multiply(so3.multiply(rotation, turn), so3.exp(slow[:, :3]))
        covariance = self.sure.covariance(velocity, slow, rows.gyro[first : first + len(found)])
        return Estimate(stamp, position + velocity * ahead, attitude, velocity, covariance)

    def _begin(self) -> None:
        """The first state: the first pose, at rest give or take."""
        gtsam, rows = self.gtsam, self.rows
        self.x, self.v, self.b, self.c = (gtsam.symbol(letter, 0) for letter in "xvbc")
        pose = gtsam.Pose3(gtsam.Rot3(so3.matrix(rows.quaternion[0])), rows.position[0])
        self.slow = np.array(GtsamAided.slow[:USED])
        self.bias, zero = gtsam.imuBias.ConstantBias(), np.zeros(3)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        sigmas = gtsam.noiseModel.Diagonal.Sigmas
        biases = [self.noise.acc_bias_sd_m_s2] * 3 + [self.noise.gyro_bias_sd_rad_s] * 3
        tilt = np.concatenate([np.full(3, 0.05), self.pose_sd[:3]])
        graph.add(gtsam.PriorFactorPose3(self.x, pose, sigmas(tilt)))
        graph.add(gtsam.PriorFactorVector(self.v, zero, sigmas(np.full(3, VELOCITY_SD_M_S))))
        graph.add(gtsam.PriorFactorConstantBias(self.b, self.bias, sigmas(np.array(biases))))
        graph.add(gtsam.PriorFactorVector(self.c, self.slow, sigmas(GtsamAided.slow_sd[:USED])))
        for key, value in ((self.x, pose), (self.v, zero), (self.b, self.bias), (self.c, self.slow)):
            values.insert(key, value)
        self.smoother.update(graph, values, dict.fromkeys((self.x, self.v, self.b, self.c), self.state_s))
        self.there = gtsam.NavState(pose.rotation(), pose.translation(), zero)
        self._report()

    def _update(self, at_s: float, pose: int | None) -> None:
        """One more state; the smoother takes what was measured since the last one."""
        before = time.thread_time()
        gtsam = self.gtsam
        self.count += 1
        x, v, b, c = (gtsam.symbol(letter, self.count) for letter in "xvbc")
        increment = self._increment(self.state_s, at_s)
        there = increment.predict(self.there, self.bias)
        at = gtsam.Pose3(there.attitude(), there.position())
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.CombinedImuFactor(self.x, self.v, x, v, self.b, b, increment))
        step = np.sqrt(at_s - self.state_s)
        graph.add(gtsam.BetweenFactorVector(self.c, c, np.zeros(USED),
                                            gtsam.noiseModel.Diagonal.Sigmas(WALK * step)))
        for key, value in ((x, at), (v, there.velocity()), (b, self.bias), (c, self.slow)):
            values.insert(key, value)
        row = bisect_right(self.time_s, at_s) - 1
        state = State(there.attitude().matrix()[None], there.position()[None], there.velocity()[None],
                      self.bias.accelerometer()[None], self.bias.gyroscope()[None], self.slow[None])
        blocks = [] if pose is None else [self._pose(state, pose, row)]
        if self.flying[row]:
            block = drag(state, self._mean_force(at_s)[None], np.zeros(1, int))
            blocks.append(replace(block, sigma=block.sigma * np.sqrt(0.1) / step))
        where = {"x": x, "v": v, "c": c}
        for block in blocks:
            sigma = np.broadcast_to(block.sigma, block.residual.shape)[0]
            parts = [part for letter, _, by in block.keys for part in (where[letter], by[0] / sigma[:, None])]
            unit = gtsam.noiseModel.Unit.Create(len(sigma))
            linear = gtsam.JacobianFactor(*parts, block.residual[0] / sigma, unit)
            graph.add(gtsam.LinearContainerFactor(linear, values))
        self.smoother.update(graph, values, dict.fromkeys((x, v, b, c), at_s))
        now = self.smoother
        pose3, self.bias = now.calculateEstimatePose3(x), now.calculateEstimateConstantBias(b)
        self.slow = now.calculateEstimateVector(c)
        self.there = gtsam.NavState(pose3.rotation(), pose3.translation(), now.calculateEstimateVector(v))
        self.x, self.v, self.b, self.c, self.state_s = x, v, b, c, at_s
        self.update_s.append(time.thread_time() - before)

    def _pose(self, state: State, pose: int, row: int) -> Linear:
        rotation, slow = state.rotation[0], state.slow[0]
        rate = self.rows.gyro[row] - state.gyro_bias[0]
        late = slow[3]
        angle = self.gtsam.Rot3.Logmap(self.gtsam.Rot3(rotation).between(self.turns[pose]))
        off = np.concatenate([self.rows.position[pose] - state.position[0] - state.velocity[0] * late,
                              angle - slow[:3] - rate * (late + slow[4])])
        by_x, by_v, by_c = np.zeros((1, 6, 6)), np.zeros((1, 6, 3)), np.zeros((1, 6, USED))
        by_x[0, :3, 3:], by_x[0, 3:, :3] = rotation, EYE
        by_v[0, :3] = late * EYE
        by_c[0, :3, 3], by_c[0, 3:, 3], by_c[0, 3:, 4], by_c[0, 3:, :3] = state.velocity[0], rate, rate, EYE
        one = np.zeros(1, int)
        return Linear([("x", one, by_x), ("v", one, by_v), ("c", one, by_c)], off[None], self.pose_sd)

    def _increment(self, start_s: float, end_s: float) -> Any:
        """Preintegrated rows from one time to a later one, with the noise of how much they change."""
        a, b = bisect_left(self.time_s, start_s), bisect_left(self.time_s, end_s)
        changes = self.slope_sums[max(b, a + 1)] - self.slope_sums[a]
        level, upright, gyro = (self.noise.stamp_s_sqrtHz**2 / max(b - a, 1) * changes).tolist()
        acc, turn = self.variances
        acc[0, 0] = acc[1, 1] = level + self.noise.acc_m_s2_sqrtHz**2
        acc[2, 2] = upright + self.noise.upright**2
        turn[0, 0] = turn[1, 1] = turn[2, 2] = gyro + self.noise.gyro_rad_s_sqrtHz**2
        self.params.setAccelerometerCovariance(acc)
        self.params.setGyroscopeCovariance(turn)
        walk = self.noise.acc_walk_m_s3_sqrtHz**2
        if bisect_left(self.lift_s, end_s) > bisect_left(self.lift_s, start_s):
            walk += LIFT_SD_M_S2**2 / max(end_s - start_s, 1e-3)
        self.params.setBiasAccCovariance(EYE * walk)
        one = self.gtsam.PreintegratedCombinedMeasurements(self.params, self.gtsam.imuBias.ConstantBias())
        steps, middle = between(self.rows.time_s, self.values, start_s, end_s)
        for values, step in zip(middle, steps.tolist(), strict=True):
            if step > 1e-9:
                one.integrateMeasurement(values[:3], values[3:], step)
        return one

    def _mean_force(self, end_s: float) -> np.ndarray:
        """(3,) mean specific force since the newest state."""
        b = bisect_right(self.time_s, end_s)
        a = min(bisect_right(self.time_s, self.state_s), b - 1)
        return np.asarray((self.force_sums[b] - self.force_sums[a]) / (b - a))


@nb.njit(cache=True)
def between(time_s: np.ndarray, values: np.ndarray, start_s: float, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Steps (m,) s from start to end over the rows between them, and means (m, d) of piecewise linear values (n, d)
    over each. Values are constant before the first and after the last row."""
    a, b = np.searchsorted(time_s, start_s, side="right"), np.searchsorted(time_s, end_s, side="right")
    steps, middle = np.empty(b - a + 1), np.empty((b - a + 1, values.shape[1]))
    before_s, before = start_s, _at(time_s, values, start_s)
    for i in range(a, b + 1):
        after_s, after = (time_s[i], values[i]) if i < b else (end_s, _at(time_s, values, end_s))
        steps[i - a] = after_s - before_s
        put(middle[i - a], 0.5 * (before + after))
        before_s, before = after_s, after
    return steps, middle


@nb.njit(cache=True)
def _at(time_s: np.ndarray, values: np.ndarray, at_s: float) -> np.ndarray:
    """(d,) values at one time."""
    j = min(max(int(np.searchsorted(time_s, at_s, side="right")), 1), len(time_s) - 1)
    share = (at_s - time_s[j - 1]) / (time_s[j] - time_s[j - 1])
    between: np.ndarray = values[j - 1] + (values[j] - values[j - 1]) * min(max(share, 0.0), 1.0)
    return between


def _sums(values: np.ndarray) -> np.ndarray:
    """(n + 1, d) sums of the rows before each of (n, d)."""
    return np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])


def _slope(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n, 3): squared slope over the CHANGE_S before each row. Columns: accelerometer across and along the rotors'
    axis, and gyro (means of axes)."""
    back = np.clip(np.searchsorted(time_s, time_s - CHANGE_S), 0, None)
    slope = (values - values[back]) / np.maximum(time_s - time_s[back], 1e-3)[:, None]
    square = slope**2
    return np.stack([square[:, :2].mean(axis=1), square[:, 2], square[:, 3:].mean(axis=1)], axis=1)


def _flying(flight: Flight, rows: Rows) -> np.ndarray:
    """(n,) whether the motors carry the vehicle at a row; everywhere, without a motor stream."""
    if "motor" not in flight or not len(flight["motor"]):
        return np.ones(len(rows.time_s), bool)
    motor = flight["motor"]
    held = np.clip(np.searchsorted(motor.time_s, rows.report_s, side="right") - 1, 0, None)
    return np.asarray(np.nan_to_num(motor["m1", "m2", "m3", "m4"].mean(axis=1))[held] > FLYING_PWM)
