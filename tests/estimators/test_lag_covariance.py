"""How sure the fixed-lag smoother is: its linearisation against finite differences, and errors against what it says."""

import gtsam
import numpy as np
import pytest

from estimators.gtsam.factor_graph import params_of
from estimators.gtsam.fixed_lag import GtsamFixedLag
from estimators.gtsam.lag_covariance import Carried
from estimators.imu_noise import ImuNoise
from nanobench_tools import so3

SIZES = {"x": 6, "v": 3, "b": 6, "c": 8}
RATE = np.array([0.3, -0.2, 0.4])


def increment(bias=None):
    rng = np.random.default_rng(0)
    made = gtsam.PreintegratedCombinedMeasurements(params_of(gtsam, ImuNoise()), gtsam.imuBias.ConstantBias())
    for _ in range(8):
        acc, gyro = rng.normal(size=3) + np.array([0.0, 0.0, 9.81]), rng.normal(size=3)
        made.integrateMeasurement(acc, gyro, 0.01)
    return made


def out(pose, velocity, bias, slow, made):
    """What is given out: position, velocity, rotation; stamps late by slow[3], the attitude's by slow[4] more."""
    there = made.predict(gtsam.NavState(pose.rotation(), pose.translation(), velocity),
                         gtsam.imuBias.ConstantBias(bias[:3], bias[3:]))
    turn = so3.multiply(so3.exp(RATE * (slow[3] + slow[4])), so3.exp(slow[:3]))
    rotation = there.attitude().matrix() @ so3.matrix(turn)
    return there.position() + there.velocity() * slow[3], there.velocity(), rotation


def test_the_covariance_is_that_of_small_changes():
    made = increment()
    pose = gtsam.Pose3(gtsam.Rot3.Expmap(np.array([0.2, -0.3, 0.9])), np.array([1.0, 2.0, 3.0]))
    velocity, bias, slow = np.array([0.7, -0.4, 0.2]), np.zeros(6), np.zeros(8)
    slow[:3] = [0.01, -0.02, 0.03]
    base, columns, step = out(pose, velocity, bias, slow, made), [], 1e-6
    for k in range(23):
        change = np.zeros(23)
        change[k] = step
        moved = out(pose.retract(change[:6]), velocity + change[6:9], bias + change[9:15], slow + change[15:], made)
        turn = gtsam.Rot3.Logmap(gtsam.Rot3(base[2].T @ moved[2]))
        columns.append(np.concatenate([moved[0] - base[0], moved[1] - base[1], turn]) / step)
    jacobian = np.array(columns).T
    joint = np.diag(np.random.default_rng(1).uniform(0.5, 2.0, 23) ** 2) + 0.1
    carried = Carried([(joint, pose.rotation().matrix())])
    carried.row(made)
    found = carried.covariance(base[1][None], slow[None], RATE[None])[0]
    carried.since[0] = (*carried.since[0][:4], np.zeros((9, 9)))
    alone = carried.covariance(base[1][None], slow[None], RATE[None])[0]
    assert alone == pytest.approx(jacobian @ joint @ jacobian.T, rel=0.03, abs=0.03)
    assert np.linalg.eigvalsh(found - alone).min() > -1e-15  # the IMU's own noise comes on top
    assert np.trace(found - alone) > 0.0


def test_the_joint_of_the_newest_state_comes_in_the_order_asked_for(crowd):
    """SYNTHETIC. gtsam's keys sort otherwise (b, c, v, x)."""
    run = GtsamFixedLag()
    estimate = run.estimate(crowd.flight("short circle"))
    assert np.linalg.eigvalsh(estimate.covariance[::50]).min() > 0.0
    assert np.sqrt(estimate.covariance[-1, 0, 0]) < 0.1
    smoother = gtsam.ISAM2()
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for letter, size in SIZES.items():
        key = gtsam.symbol(letter, 0)
        sigma = gtsam.noiseModel.Isotropic.Sigma(size, float(size))
        graph.add(gtsam.PriorFactorVector(key, np.zeros(size), sigma))
        values.insert(key, np.zeros(size))
    smoother.update(graph, values)
    keys = [gtsam.symbol(letter, 0) for letter in SIZES]
    full = smoother.jointMarginalCovariance(keys).fullMatrix()
    assert np.diag(full) == pytest.approx(np.concatenate([np.full(n, n**2) for n in SIZES.values()]))
