"""Speed of the smoothers against plain GTSAM, in one run.

    python benchmarks/speed/smoothers_speed.py [--seconds 42] [--repeats 5]

A flight in closed form (SYNTHETIC) with poses at 10 Hz and 1 cm of noise, arriving 30 ms late. Processor time of one
core, median of the repeats, because other work on the machine distorts the wall clock. Plain GTSAM is the code of its
examples: a state and an ImuFactor for every row of the IMU, Levenberg-Marquardt. Its own filter, NavStateImuEKF, runs
row by row from Python. Both know the IMU exactly as ours do, but no bias walk and no lateness.
"""

import argparse
import time
import warnings
from collections.abc import Callable
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, V, X
from kept import show
from scipy.spatial.transform import Rotation, RotationSpline

from estimators.error_state_ekf import ErrorStateEkf
from estimators.gtsam.aided_batch import DRAG_1_S, GtsamAided
from estimators.gtsam.batch import GtsamBatch
from estimators.gtsam.fixed_lag import GtsamFixedLag
from nanobench_tools.flight import Flight, Provenance, make_stream

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
RATE_HZ, POSE_EVERY, NOISE_M, DELAY_S = 100.0, 10, 0.01, 0.03
GYRO, ACC = 0.007, 0.015


def made(seconds: float) -> tuple[Flight, np.ndarray]:
    """The flight and its true positions at the rows of the IMU."""
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    rng = np.random.default_rng(0)
    p = np.stack([np.cos(0.9 * t), np.sin(1.1 * t), 1.0 + 0.2 * np.sin(0.7 * t)], axis=1)
    a = np.stack([-0.81 * np.cos(0.9 * t), -1.21 * np.sin(1.1 * t), 9.81 - 0.098 * np.sin(0.7 * t)], axis=1)

    v = np.stack([-0.9 * np.sin(0.9 * t), 1.1 * np.cos(1.1 * t), 0.14 * np.cos(0.7 * t)], axis=1)
    pushed = a + DRAG_1_S * v  # by the rotors, along the body's z: x and y of the accelerometer show drag alone
    z = pushed / np.linalg.norm(pushed, axis=1, keepdims=True)
    y = np.cross(z, np.stack([np.cos(0.3 * t), np.sin(0.3 * t), 0.0 * t], axis=1))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=2))
    rate = RotationSpline(t, turn)(t, 1)
    imu = np.column_stack([turn.inv().apply(a), rate])
    imu += rng.normal(size=imu.shape) * np.repeat([ACC, GYRO], 3) * np.sqrt(RATE_HZ)
    given = slice(None, None, POSE_EVERY)
    poses = np.column_stack([p[given] + NOISE_M * rng.normal(size=p[given].shape), turn[given].as_quat()])
    streams = {"mocap": make_stream("mocap", t[given] + DELAY_S, poses, POSE), "imu": make_stream("imu", t, imu, IMU)}
    told = {"pose_delay_s": DELAY_S, "pose_noise_m": NOISE_M}
    return Flight("made", streams, told, Provenance("made", "", "made", synthetic=True)), p


def plain_batch(flight: Flight) -> np.ndarray:
    """One state a row: positions (n, 3)."""
    imu, mocap = flight["imu"], flight["mocap"]
    params = gtsam.PreintegrationParams.MakeSharedU(9.81)
    params.setAccelerometerCovariance(np.eye(3) * ACC**2)
    params.setGyroscopeCovariance(np.eye(3) * GYRO**2)
    params.setIntegrationCovariance(np.eye(3) * 1e-8)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    bias = gtsam.imuBias.ConstantBias()
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    graph.add(gtsam.PriorFactorConstantBias(B(0), bias, sigmas(np.array([0.3] * 3 + [0.03] * 3))))
    graph.add(gtsam.PriorFactorVector(V(0), np.zeros(3), sigmas(np.full(3, 2.0))))
    values.insert(B(0), bias)
    pose_noise = sigmas(np.array([0.005] * 3 + [NOISE_M] * 3))
    row_of = np.searchsorted(imu.time_s, mocap.time_s - DELAY_S - 1e-6)
    held = np.clip(np.searchsorted(row_of, np.arange(len(imu)), side="right") - 1, 0, None)
    rotation = Rotation.from_quat(mocap["qx", "qy", "qz", "qw"]).as_matrix()
    place = mocap["px", "py", "pz"]
    poses = [gtsam.Pose3(gtsam.Rot3(r), x) for r, x in zip(rotation, place, strict=True)]
    for i, (acc, gyro) in enumerate(zip(imu[IMU[:3]], imu[IMU[3:]], strict=True)):
        values.insert(X(i), poses[held[i]])
        values.insert(V(i), np.zeros(3))
        if i + 1 < len(imu):
            one = gtsam.PreintegratedImuMeasurements(params, bias)
            one.integrateMeasurement(acc, gyro, 1.0 / RATE_HZ)
            graph.add(gtsam.ImuFactor(X(i), V(i), X(i + 1), V(i + 1), B(0), one))
    for i, pose in zip(row_of, poses, strict=True):
        graph.add(gtsam.PriorFactorPose3(X(int(i)), pose, pose_noise))
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, gtsam.LevenbergMarquardtParams()).optimize()
    return np.array([found.atPose3(X(i)).translation() for i in range(len(imu))])


def plain_filter(flight: Flight) -> np.ndarray:
    """GTSAM's own filter, poses at the time they were measured: positions (n, 3)."""
    imu, mocap = flight["imu"], flight["mocap"]
    params = gtsam.PreintegrationParams.MakeSharedU(9.81)
    params.setAccelerometerCovariance(np.eye(3) * ACC**2)
    params.setGyroscopeCovariance(np.eye(3) * GYRO**2)
    params.setIntegrationCovariance(np.eye(3) * 1e-8)
    place, q = mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"]
    start = gtsam.NavState(gtsam.Rot3(Rotation.from_quat(q[0]).as_matrix()), place[0], np.zeros(3))
    filter_ = gtsam.NavStateImuEKF(start, np.diag([0.01] * 3 + [1e-4] * 3 + [1.0] * 3), params)
    rows = dict(zip(np.searchsorted(imu.time_s, mocap.time_s - DELAY_S - 1e-6).tolist(), place, strict=True))
    noise, found = np.eye(3) * NOISE_M**2, []
    for i, (acc, gyro) in enumerate(zip(imu[IMU[:3]], imu[IMU[3:]], strict=True)):
        filter_.predict(gyro, acc, 1.0 / RATE_HZ)
        if i in rows:
            state = filter_.state()
            h = np.zeros((3, 9))
            h[:, 3:6] = state.attitude().matrix()
            filter_.updateWithVector(state.position(), h, rows[i], noise)
        found.append(filter_.state().position())
    return np.array(found)


def timed(work: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """(median processor seconds, the last result); the first run warms up and does not count."""
    result, spent = work(), []
    for _ in range(repeats):
        before = time.process_time()
        result = work()
        spent.append(time.process_time() - before)
    return float(np.median(spent)), result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=42.0)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    warnings.simplefilter("ignore")  # that there are no motors to take thrust from
    flight, truth = made(given.seconds)

    def error_mm(position: np.ndarray, time_s: np.ndarray) -> float:
        true = np.stack([np.interp(time_s, flight["imu"].time_s, column) for column in truth.T], axis=1)
        return 1e3 * float(np.sqrt(np.mean(np.sum((position - true) ** 2, axis=1))))

    spent: dict[str, float] = {}
    print(f"SYNTHETIC flight of {given.seconds:g} s, {len(truth)} rows, {len(flight['mocap'])} poses; processor time")
    for method in (GtsamBatch(), GtsamAided(), GtsamFixedLag(), ErrorStateEkf()):
        spent[method.name], estimate = timed(lambda method=method: method.estimate(flight), given.repeats)
        error = error_mm(estimate.position_m, estimate.time_s)
        print(f"{method.name:16} {spent[method.name]:7.3f} s, error {error:6.2f} mm")
        if isinstance(method, GtsamFixedLag):
            middle, late = np.quantile(method.update_s, [0.5, 0.99])
            print(f"{'':16} update median {1e3 * middle:.2f} ms, p99 {1e3 * late:.2f} ms, n = {len(method.update_s)}")
    for name, work in (("plain GTSAM", plain_batch), ("NavStateImuEKF", plain_filter)):
        spent[name], position = timed(lambda work=work: work(flight), given.repeats)
        print(f"{name:16} {spent[name]:7.3f} s, error {error_mm(position, flight['imu'].time_s):6.2f} mm")
    print(f"plain GTSAM takes {spent['plain GTSAM'] / spent['gtsam_batch']:.1f} times as long as gtsam_batch; "
          f"NavStateImuEKF from Python {spent['NavStateImuEKF'] / spent['error_state_ekf']:.1f} times as long as "
          f"error_state_ekf")
    show("plain GTSAM / gtsam_batch", spent["plain GTSAM"] / spent["gtsam_batch"], given.repeats)
    show("NavStateImuEKF from Python / error_state_ekf", spent["NavStateImuEKF"] / spent["error_state_ekf"],
         given.repeats)


if __name__ == "__main__":
    main()
