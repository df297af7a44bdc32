"""Bounds on tilt in predictive control: tangents against differences, flights that would tip further."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.mpc import linear_mpc, sparse_qp, tilt_bounds
from controllers.mpc.disturbance import Tuning
from controllers.mpc.linear_mpc import MpcDaqp, MpcOsqp
from controllers.mpc.nmpc import Nmpc
from controllers.mpc.prediction_model import practice_model
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

FRESH = Tuning(ages_s=(0.0, 0.0, 0.0, 0.0))
LIMIT = 0.5


def level(target, turn):
    """Level part of the body's axis, turned from the target by the error 2 vec(q)."""
    half = 0.5 * turn
    q = Rotation.from_quat([*half, np.sqrt(1.0 - half @ half)])
    return (Rotation.from_quat(target) * q).apply([0.0, 0.0, 1.0])[:2]


def test_a_half_plane_is_the_tangent_at_the_side_on_which_the_circle_was_left():
    rng = np.random.default_rng(2)
    targets, turns = np.zeros((31, 17)), 0.3 * rng.standard_normal((30, 3))
    targets[:, 6:10] = Rotation.from_rotvec(0.3 * rng.standard_normal((31, 3))).as_quat()
    normal, bound, radius = np.zeros((30, 3)), np.full(30, np.nan), 0.4
    count = tilt_bounds.halfplanes(targets, turns, radius, normal, bound)
    assert 5 < count < 30
    for k in range(30):
        size = np.linalg.norm(level(targets[k + 1, 6:10], turns[k]))
        assert np.isfinite(bound[k]) == (size > radius + tilt_bounds.SLACK)
        if not np.isfinite(bound[k]):
            continue
        for c in range(3):
            step = 1e-6 * np.eye(3)[c]
            ends = [np.linalg.norm(level(targets[k + 1, 6:10], turns[k] + s * step)) for s in (1.0, -1.0)]
            assert normal[k, c] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-6)
        assert bound[k] - normal[k] @ turns[k] == pytest.approx(radius - size)


def most_tilt_of(controller, velocity_m_s):
    """Flies a sway that no limit of tilt allows, from a push."""
    plant = Plant(draw_vehicles([np.random.default_rng(0)], 0.0), np.zeros((1, 3)), np.zeros(1))
    plant.state[THRUST], plant.ground_z = 0.1, np.full(1, -1e9)
    plant.state[VELOCITY, 0] = velocity_m_s
    controller.reset(1)
    pace, most = 2.0 * np.pi / 0.8, 0.0

    def told(t):
        def parts(t):
            zero = np.zeros_like(t)
            sizes = (0.2 * np.sin(pace * t), 0.2 * pace * np.cos(pace * t), -0.2 * pace**2 * np.sin(pace * t),
                     -0.2 * pace**3 * np.cos(pace * t))
            return [np.stack([size, zero, zero], axis=-1) for size in sizes]

        def ahead(seconds):
            p, v, a, j = (part[:, None] for part in parts(t + seconds))
            none = np.zeros((len(seconds), 1))
            return Reference(p, none, v, a, j, none)

        p, v, a, j = parts(np.array([t]))
        return Reference(p, np.zeros(1), v, a, j, np.zeros(1), ahead)

    for k in range(100):
        s = plant.state
        state = VehicleState(s[:3].T.copy(), s[VELOCITY].T.copy(), s[QUATERNION].T.copy(), s[RATE].T.copy(),
                             plant.battery_V.copy())
        plant.apply(controller.command(0.01 * k, state, told(0.01 * k)))
        for _ in range(5):
            plant.step(0.002)
        q = plant.state[QUATERNION, 0]
        most = max(most, float(np.arccos(1.0 - 2.0 * (q[0] ** 2 + q[1] ** 2))))
    assert controller.counts["solver"] == 0
    return most


@pytest.mark.parametrize(("kind", "push"), [
    (MpcDaqp, 0.0), (MpcDaqp, -3.0), pytest.param(MpcOsqp, 0.0, marks=pytest.mark.slow), (Nmpc, 0.0)])
@pytest.mark.slow
def test_a_hard_reference_does_not_tip_it_further_than_the_limit(kind, push, monkeypatch):
    controller = kind(practice_model(), tuning=FRESH, tilt_rad=LIMIT)
    velocity = np.array([push, 0.0, 0.0])
    assert most_tilt_of(controller, velocity) < LIMIT + 0.04
    for module, name in ((linear_mpc, "left"), (sparse_qp, "halfplanes")):
        monkeypatch.setattr(module, name, lambda *_: 0)
    assert most_tilt_of(controller, velocity) > LIMIT + 0.1
