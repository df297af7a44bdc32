"""The programs of predictive control: against other solvers, SciPy's regulator and differences of the true cost."""

import numpy as np
import pytest
from mpc_flights import FRESH, World, fresh, resting, with_future
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular
from scipy.optimize import lsq_linear

from controllers.mpc import condense, dense_qp, thrust_plan
from controllers.mpc.casadi_code import SolverFailure
from controllers.mpc.linear_mpc import MpcDaqp, error
from controllers.mpc.prediction_model import practice_model
from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.methods import VehicleState
from nanobench_tools.practice.references import path_spec


def programs(count):
    """Programs as they come up: along a path, from starts near and far."""
    rng, controller = np.random.default_rng(8), fresh("mpc_daqp")
    spec, found = path_spec("figure_eight", "fast"), []

    class Keep:
        multipliers = None

        def __call__(self, h, g, low, high, **_):
            found.append((h.copy(), g.copy(), low.copy(), high.copy()))

    kept, controller._solver = controller._solver, Keep()
    for i in range(count):
        size = [0.02, 0.3][i % 2]
        reference = with_future(spec, 0.7 * i)
        state = VehicleState(reference.position_m + size * rng.standard_normal((1, 3)), reference.velocity_m_s,
                             so3.exp(size * rng.standard_normal((1, 3))), 3.0 * size * rng.standard_normal((1, 3)),
                             np.array([3.4]))
        controller.reset(1)
        controller.command(0.0, state, reference)
    controller._solver = kept
    return found


def test_three_solvers_agree_on_the_same_programs():
    daqp, osqp = dense_qp.Daqp(), dense_qp.DenseOsqp()
    bound = 0
    for h, g, low, high in programs(8):
        factor = cholesky(h)
        shifted = -solve_triangular(factor.T, g, lower=True)
        referee = lsq_linear(factor, shifted, (low, high), method="bvls", tol=1e-14, max_iter=2000).x
        bound += np.any((referee < low + 1e-9) | (referee > high - 1e-9))

        def cost(z, h=h, g=g):
            return 0.5 * z @ h @ z + g @ z

        np.testing.assert_allclose(daqp(h, g, low, high), referee, atol=1e-6)
        split = osqp(h, g, low, high)
        assert cost(split) - cost(referee) < 1e-4 * abs(cost(referee)) + 1e-6
        np.testing.assert_allclose(split, referee, atol=0.3)  # of 0.1 N
    assert 2 <= bound < 8  # some are bound by the motors, some are not


def test_the_sparse_program_has_the_answer_of_the_condensed_one():
    spec = path_spec("figure_eight", "fast")
    state, reference = World(with_future(spec, 0.5)).seen(), with_future(spec, 0.5)
    reference.position_m[:] += [[0.02, -0.03, 0.01]]
    found = {}
    for name in ("mpc_daqp", "mpc_osqp"):
        controller = fresh(name)
        controller.command(0.0, state, reference)
        found[name] = controller.plan.thrust_N[0].copy()
    np.testing.assert_allclose(found["mpc_osqp"], found["mpc_daqp"], atol=5e-4)
    condensed = MpcDaqp(practice_model(), tuning=FRESH, solver="osqp")
    condensed.reset(1)
    condensed.command(0.0, state, reference)
    np.testing.assert_allclose(condensed.plan.thrust_N[0], found["mpc_daqp"], atol=5e-4)


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_far_from_limits_it_is_the_linear_quadratic_regulator(name, yaw):
    """With the Riccati terminal cost the horizon is endless; the gain is SciPy's."""
    controller = fresh(name)
    a, b = controller.hover_stage()
    p = solve_discrete_are(a, b, np.diag(controller.q + 1e-9), controller.r)
    gain = np.linalg.solve(controller.r + b.T @ p @ b, b.T @ p @ a)
    rng = np.random.default_rng(4)
    for _ in range(3):
        dx = 1e-4 * rng.standard_normal(16)
        dx[12:] = 0.0
        heading = so3.exp(np.array([0.0, 0.0, yaw]))
        q = so3.multiply(heading, so3.exp(dx[6:9]))
        state, reference = resting(
            position_m=so3.rotate(heading, dx[None, :3]), velocity_m_s=so3.rotate(heading, dx[None, 3:6]),
            quaternion=q[None], rate_rad_s=dx[None, 9:12], r_yaw_rad=np.full(1, yaw))
        controller.reset(1)
        controller.command(0.0, state, reference)
        expected = controller.hover_N - gain @ dx
        np.testing.assert_allclose(controller.plan.thrust_N[0, 0], expected, atol=2e-6)


def test_the_program_of_the_nonlinear_one_has_the_slope_of_the_true_cost():
    """g of the condensed program against differences of the cost of whole flights, far from the target."""
    rng, controller = np.random.default_rng(9), fresh("nmpc")
    kept = {}

    class Keep:
        multipliers = None

        def __call__(self, h, g, low, high, **_):
            kept["g"] = g.copy()

    solver, controller._solver = controller._solver, Keep()
    targets = np.zeros((21, 17))
    targets[:, 6:10] = so3.exp(0.3 * rng.standard_normal((21, 3)))
    targets[:, 13:], inputs = 0.1, np.full((21, 4), 0.1)
    x = np.concatenate([0.3 * rng.standard_normal(6), so3.exp(0.5 * rng.standard_normal(3)), rng.standard_normal(3),
                        np.full(4, 0.09)])
    thrusts = 0.1 + 0.01 * rng.standard_normal((20, 4))
    controller.plan.thrust_N[0] = thrusts
    controller.solve(0, x, 0.4, targets, inputs, np.full(4, -1.0), np.full(4, 1.0))
    controller._solver = solver
    turned = np.empty_like(controller.p)
    condense.headed(controller.p, 0.4, turned)

    def cost(change):
        asked = thrusts + condense.UNIT_N * change.reshape(20, 4)
        flown = controller.flown(x, asked, np.zeros(6))
        gaps = np.array([error(a, b) for a, b in zip(flown, targets, strict=True)])
        away = asked - inputs[:-1]
        return 0.5 * (np.sum(gaps[1:-1] ** 2 * controller.q) + gaps[-1] @ turned @ gaps[-1]
                      + np.einsum("ki,ij,kj", away, controller.r, away))

    for j in range(0, 80, 7):
        tiny = np.zeros(80)
        tiny[j] = 1e-5
        slope = (cost(tiny) - cost(-tiny)) / 2e-5
        np.testing.assert_allclose(kept["g"][j], slope, rtol=1e-5, atol=1e-5 * np.abs(kept["g"]).max())


def test_the_plan_stays_within_what_the_battery_gives():
    controller = fresh("mpc_daqp")
    state, reference = resting(battery_V=np.array([3.1]), rate_rad_s=np.array([[12.0, 0.0, 0.0]]))
    command = controller.command(0.0, state, reference)
    least, most = controller.thrust_map.limits(np.array([3.1]))
    plan = controller.plan.thrust_N[0]
    assert np.all((plan >= least - 1e-12) & (plan <= most + 1e-12))
    assert np.any(plan > most - 1e-9)
    np.testing.assert_allclose(command, controller.thrust_map.ratios(plan[:1], np.array([3.1])))


@pytest.mark.parametrize("wrong", ["contradiction", "not convex"])
def test_programs_that_osqp_refuses_are_failures(wrong):
    one, sign = np.ones(2), -1.0 if wrong == "not convex" else 1.0
    low, high = (one, -one) if wrong == "contradiction" else (-one, one)
    for rows in ((), (np.eye(2), one)):
        with pytest.raises(SolverFailure, match="OSQP refuses"):
            dense_qp.DenseOsqp()(sign * np.eye(2), one, low, high, *rows)


def test_a_shifted_plan_is_read_between_its_stages_and_held_at_its_end():
    plan = thrust_plan.Plan(2, 5, 0.025, 0.1)
    plan.thrust_N[:] = np.random.default_rng(1).uniform(0.02, 0.15, (2, 5, 4))
    for seconds in (0.0, 0.01, 0.025, 0.06, 0.3):
        at = np.minimum(0.025 * np.arange(5) + seconds, 0.1)
        expected = [np.interp(at, 0.025 * np.arange(5), plan.thrust_N[1, :, m]) for m in range(4)]
        np.testing.assert_allclose(plan.shifted(1, seconds), np.transpose(expected), atol=1e-15)
    plan.age_s[:] = 0.0, 0.06
    limits = np.stack([np.full((2, 4), 0.05), np.full((2, 4), 0.12)])
    expected = np.clip([plan.thrust_N[0, 0], plan.shifted(1, 0.06)[0]], 0.05, 0.12)
    np.testing.assert_array_equal(plan.now(limits), expected)


def test_unknown_solvers_are_refused_in_one_line():
    with pytest.raises(UsageError, match="unknown solver 'simplex'; known: daqp, osqp"):
        MpcDaqp(solver="simplex")
