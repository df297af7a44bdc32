"""A batch smoother over the whole flight: preintegrated IMU, bias walks, poses (GTSAM).

States ten times a second, started from the error-state filter. The rotation from the IMU to the tracked body and the
delay of the IMU's timestamps are unknowns. Poses between two states count at the nearest one. It looks ahead: a value
uses all of the IMU and every pose that was given, whenever they came. One that did not converge is no result.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.methods import Estimate
from nanobench_tools.settings import number, setting

from ..drag_ekf import TUNED
from ..error_state_ekf import ErrorStateEkf
from ..imu_noise import ImuNoise, packet_rate_hz
from .covariance import between, given_out
from .factor_graph import Linear, Problem, Solution
from .smoother_rows import POSE, Rows, rows_of, stands
from .state_path import UP, Path, State, steps_of

NOISE = ImuNoise(gyro_rad_s_sqrtHz=TUNED["gyro_noise"], acc_m_s2_sqrtHz=TUNED["acc_noise"],
                 vertical_m_s2_sqrtHz=TUNED["vertical_noise"], gyro_walk_rad_s2_sqrtHz=TUNED["gyro_walk"],
                 acc_walk_m_s3_sqrtHz=TUNED["acc_walk"], stamp_s_sqrtHz=TUNED["stamp"])
"""That of ``drag_ekf``, in flight, where the timestamps' wander is distinguished: it counts as much as the signal
changes."""

CLOCK_SD_S = number("smoothers.batch.clock_sd_s")
TOGETHER_SD_M = number("smoothers.batch.together_sd_m")
ALONE_SD_M = number("smoothers.batch.alone_sd_m")
"""Disagreement of poses and IMU in addition to the noise of the pose. Where several poses belong to one state, it is
the wander of the IMU's timestamps times the velocity of each axis, and a rest. These errors are correlated. And where
one is alone."""

ATTITUDE_SD_RAD = number("smoothers.batch.attitude_sd_rad")
UNKNOWN_SD_M = number("smoothers.batch.unknown_sd_m")

MOUNT_SD_RAD = number("smoothers.batch.mount_sd_rad")
LATE_SD_S = number("smoothers.batch.late_sd_s")
ATTITUDE_LATE_SD_S = number("smoothers.batch.attitude_late_sd_s")
VELOCITY_SD_M_S = number("smoothers.batch.velocity_sd_m_s")

WALKS = setting("smoothers.batch.walks")
WALK = np.array(WALKS)

TAIL_S = number("smoothers.batch.tail_s")

CONTRADICTED_M = number("smoothers.batch.contradicted_m")


class GtsamBatch:
    """Batch smoother of poses and IMU; it looks ahead.

    Parameters
    ----------
    noise : ImuNoise, optional
        Noise of the IMU; default: a 40 g vehicle in flight.

    Attributes
    ----------
    last : Solution or None
        Of the last flight: iterations, convergence, states.
    """

    name = "gtsam_batch"
    causal = False
    warms: int | None = None
    """Which slow quantity is the drift of the vertical accelerometer's bias, beyond that of all flights."""
    slow, slow_sd, walk = np.zeros(5), np.array([MOUNT_SD_RAD] * 3 + [LATE_SD_S, ATTITUDE_LATE_SD_S]), WALK

    def __init__(self, noise: ImuNoise | None = None) -> None:
        self.noise = noise or NOISE
        self.last: Solution | None = None

    def estimate(self, flight: Flight) -> Estimate:
        """InputError where there is too little to start from, where poses and IMU contradict each other, and where
        the smoother did not converge; MissingExtraError without gtsam."""
        rows = rows_of(flight)
        noise, time_s = self.noise.at_rate(packet_rate_hz(flight["imu"])), stands(rows)
        last = len(time_s) - 1
        if time_s[-1] - (end_s := self.measured_until(flight, rows, time_s)) > TAIL_S:
            last = int(np.searchsorted(time_s, end_s))
        problem = Problem(rows, noise, time_s[: last + 1])
        start = started(flight, rows, problem, self.slow)
        blocks = self.blocks(flight, problem, start)
        solution = self.last = problem.solve(start, self.uncertain(noise), self.walk, blocks, self.warms)
        if not solution.converged:
            raise InputError(rows.place, f"{self.name} did not converge in {solution.iterations} steps",
                             "nanobench audit shows the faults of the recording")
        state = solution.state
        if last + 1 < len(time_s):
            state = state.then(Problem(rows, noise, time_s[last:]).carried(state))
        estimate = on_mocap_clock(rows, Path(steps_of(rows, time_s), state))
        if solution.covariance is None:
            return estimate
        state, at_s = solution.state, time_s[: last + 1]
        rate = np.stack([np.interp(at_s, rows.time_s, column) for column in rows.gyro.T], axis=1) - state.gyro_bias
        sure = between(at_s, given_out(solution.covariance, state, rate), estimate.time_s)
        if last + 1 < len(time_s):
            sure[estimate.time_s > at_s[-1]] = np.nan
        return replace(estimate, covariance=sure)

    def measured_until(self, flight: Flight, rows: Rows, time_s: np.ndarray) -> float:
        """Time of the last measurement other than the IMU [s], of states at ``time_s``."""
        return float(rows.pose_s[-1])

    def uncertain(self, noise: ImuNoise) -> State:
        """SDs of the first state, before anything is measured."""
        row = np.ones((1, 3))
        biases = noise.acc_bias_sd_m_s2 * row, noise.gyro_bias_sd_rad_s * row
        return State(row, row, VELOCITY_SD_M_S * row, *biases, self.slow_sd[None])

    def blocks(self, flight: Flight, problem: Problem, start: State) -> Callable[[State, Path], Iterable[Linear]]:
        """The measurements other than the IMU, as a function of the linearisation point; ``start`` is the first one."""
        poses = Poses(problem, start)

        def at(state: State, path: Path) -> Iterable[Linear]:
            yield poses.linear(state, path)

        return at


class Poses:
    """Poses as measurements of the nearest states; the velocity of ``start`` says what a late timestamp makes of
    each."""

    def __init__(self, problem: Problem, start: State) -> None:
        rows, time_s = problem.rows, problem.time_s
        middle = 0.5 * (time_s[1:] + time_s[:-1])
        self.owner = np.searchsorted(middle, rows.pose_s)
        self.index, self.first, self.counts = np.unique(self.owner, return_index=True, return_counts=True)
        self.rows, self.time_s = rows, time_s
        noise = UNKNOWN_SD_M if np.isnan(rows.noise_m) else rows.noise_m
        together = np.hypot(TOGETHER_SD_M, CLOCK_SD_S * start.velocity[self.index])
        rest = np.where(self.counts[:, None] > 1, together, ALONE_SD_M)
        turn = np.sqrt(0.5 * ATTITUDE_SD_RAD**2 * (1.0 + 1.0 / self.counts))
        self.sigma = np.column_stack([np.hypot(noise / np.sqrt(self.counts)[:, None], rest), *[turn] * 3])

    def linear(self, state: State, path: Path) -> Linear:
        """Residual of position [m, world] and rotation [rad, body]."""
        at_s, c = self.rows.pose_s, state.slow[self.owner]
        own = self.owner
        there, turned = path.near(own, at_s + c[:, 3]), path.near(own, at_s + c[:, 3] + c[:, 4])
        off_p = self.rows.position - there.position
        angle = so3.log(so3.multiply(so3.conjugate(turned.quaternion), self.rows.quaternion))
        ahead = (at_s + c[:, 3] - self.time_s[own])[:, None]
        bend = there.position - state.position[own] - state.velocity[own] * ahead + 0.5 * UP * ahead**2
        bent = np.eye(3) - 0.5 * so3.hat(angle)  # what a small turn of the IMU does to ``angle``, to first order
        m = len(own)
        by_x, by_v, by_c = np.zeros((m, 6, 6)), np.zeros((m, 6, 3)), np.zeros((m, 6, state.slow.shape[1]))
        by_x[:, :3, :3] = -so3.hat(bend) @ state.rotation[own]
        by_x[:, :3, 3:] = state.rotation[own]
        by_x[:, 3:, :3] = bent @ np.swapaxes(so3.matrix(turned.quaternion), 1, 2) @ state.rotation[own]
        by_v[:, range(3), range(3)] = ahead
        by_c[:, :3, 3] = there.velocity
        by_c[:, 3:, :3] = np.eye(3)
        by_c[:, 3:, 3] = by_c[:, 3:, 4] = np.einsum("nij,nj->ni", bent, turned.rate)
        keys = [(letter, self.index, self._mean(block)) for letter, block in (("x", by_x), ("v", by_v), ("c", by_c))]
        return Linear(keys, self._mean(np.column_stack([off_p, angle - c[:, :3]])), self.sigma)

    def _mean(self, values: np.ndarray) -> np.ndarray:
        """Of the poses of each state."""
        return np.add.reduceat(values, self.first, axis=0) / self.counts.reshape(-1, *[1] * (values.ndim - 1))


def started(flight: Flight, rows: Rows, problem: Problem, slow: np.ndarray) -> State:
    """The state of the error-state filter, given the poses at the times they were measured."""
    mocap = make_stream("mocap", rows.pose_s, np.column_stack([rows.position, rows.quaternion]), POSE)
    first = ErrorStateEkf().estimate(flight.with_streams(mocap=mocap))
    at = np.clip(np.searchsorted(first.time_s, problem.time_s), 0, len(first.time_s) - 1)
    velocity = np.zeros((problem.count, 3)) if first.velocity_m_s is None else first.velocity_m_s[at]
    dt = (problem.time_s - first.time_s[at])[:, None]
    zero = np.zeros((problem.count, 3))
    return State(so3.matrix(first.quaternion[at]), first.position_m[at] + velocity * dt, velocity, zero, zero,
                 np.tile(slow, (problem.count, 1)))


def on_mocap_clock(rows: Rows, path: Path) -> Estimate:
    """The tracked body at the rows; InputError when the poses are nowhere near it."""
    def slow(at_s: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at_s, path.steps.time_s, column) for column in path.state.slow.T], axis=1)

    off = np.linalg.norm(path.at(rows.pose_s + slow(rows.pose_s)[:, 3]).position - rows.position, axis=1)
    if not np.median(off) < CONTRADICTED_M:
        raise InputError(rows.place, f"poses and IMU contradict each other, {np.median(off):.2f} m apart when smoothed",
                         "a gyro in degrees or a flipped axis? nanobench audit shows it")
    time_s = rows.report_s[rows.report_s >= rows.pose_s[0]]
    c = slow(time_s)
    there, turned = path.at(time_s + c[:, 3]), path.at(time_s + c[:, 3] + c[:, 4])
    quaternion = so3.multiply(turned.quaternion, so3.exp(c[:, :3]))
    return Estimate(time_s, there.position, quaternion, there.velocity, converged=True)
