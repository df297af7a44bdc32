"""Predictive control: programs against other solvers and limits, and what flies when something fails."""

import functools
import gc
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular
from scipy.optimize import lsq_linear

from controllers import fallback, mpc_base, mpc_condense, mpc_linear, mpc_plan, mpc_qp, nmpc
from controllers.disturbance import Tuning
from controllers.mpc_code import SolverFailure
from controllers.mpc_linear import MpcDaqp, MpcOsqp, error
from controllers.mpc_model import practice_model
from controllers.nmpc import Nmpc
from nanobench_tools import registry, so3
from nanobench_tools.errors import UsageError
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

KINDS = {"mpc_daqp": MpcDaqp, "mpc_osqp": MpcOsqp, "nmpc": Nmpc}
FRESH = Tuning(ages_s=(0.0, 0.0, 0.0, 0.0))
"""Of measurements that are as old as the call."""

make = functools.cache(lambda name, **keywords: KINDS[name](practice_model(), tuning=FRESH, **keywords))


def fresh(name, n=1, **keywords):
    controller = make(name, **keywords)
    controller.reset(n)
    return controller


def resting(n=1, **changes):
    """At the origin, level, and asked to be there; names beginning with r_ are of the reference."""
    zero = np.zeros((n, 3))
    state = {"position_m": zero, "velocity_m_s": zero, "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
             "rate_rad_s": zero, "battery_V": np.full(n, 3.6)}
    reference = {"position_m": zero, "yaw_rad": np.zeros(n), "velocity_m_s": zero, "acceleration_m_s2": zero,
                 "jerk_m_s3": zero, "yaw_rate_rad_s": np.zeros(n)}
    for name, value in changes.items():
        (reference if name.startswith("r_") else state)[name.removeprefix("r_")] = value
    return VehicleState(**state), Reference(**reference)


def with_future(spec, t, **changes):
    """What a path asks for at t s, and after."""
    def ahead(seconds):
        r = spec.reference(t + seconds)
        return Reference(*(x[:, None] for x in (r.position_m, r.yaw_rad, r.velocity_m_s, r.acceleration_m_s2,
                                                r.jerk_m_s3, r.yaw_rate_rad_s)))
    now = spec.reference(np.array([t]))
    return Reference(**{**vars(now), "ahead": ahead, **changes})


class World:
    """One nominal practice vehicle in the air, with perfect measurements."""

    def __init__(self, reference, seed=0, spread=0.0, **fixed):
        self.plant = Plant(draw_vehicles([np.random.default_rng(seed)], spread, **fixed), np.zeros((1, 3)), np.zeros(1))
        self.plant.state[:3] = reference.position_m.T
        self.plant.state[VELOCITY] = reference.velocity_m_s.T
        self.plant.state[THRUST] = 0.1
        self.plant.ground_z = np.full(1, -1e9)

    def seen(self):
        s = self.plant.state
        return VehicleState(s[:3].T.copy(), s[VELOCITY].T.copy(), s[QUATERNION].T.copy(), s[RATE].T.copy(),
                            self.plant.battery_V.copy())

    def fly(self, command, seconds):
        self.plant.apply(command)
        for _ in range(round(seconds / 0.002)):
            self.plant.step(0.002)


def flight(controller, spec, seconds, told=with_future, seen=lambda t, state: state, late=0, **vehicle):
    """RMS distance [m] to the path after 1 s, and the largest; ``seen`` bends measurements, a command acts ``late``
    periods after it was given."""
    world = World(spec.reference(np.zeros(1)), **vehicle)
    controller.reset(1)
    gaps, waiting = [], [np.full((1, 4), 0.78)] * late
    for k in range(round(seconds / controller.period_s)):
        t = controller.period_s * k
        reference = told(spec, t)
        waiting.append(controller.command(t, seen(t, world.seen()), reference))
        gaps.append(np.linalg.norm(world.plant.state[:3, 0] - spec.reference(np.array([t])).position_m[0]))
        world.fly(waiting.pop(0), controller.period_s)
    settled = np.array(gaps[round(1.0 / controller.period_s):])
    return float(np.sqrt(np.mean(settled**2))), float(max(gaps))


@pytest.mark.parametrize("name", KINDS)
def test_they_are_registered_and_keep_the_protocol(name):
    assert registry.load("controllers", name) is KINDS[name]
    controller = make(name)
    assert isinstance(controller, Controller)
    assert (controller.name, controller.information) == (name, "preview")


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
    daqp, osqp = mpc_qp.Daqp(), mpc_qp.DenseOsqp()
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
    mpc_condense.headed(controller.p, 0.4, turned)

    def cost(change):
        asked = thrusts + mpc_condense.UNIT_N * change.reshape(20, 4)
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


@pytest.mark.parametrize("name", KINDS)
def test_it_flies_a_figure_of_eight_it_can_look_ahead_on(name):
    assert flight(fresh(name), path_spec("figure_eight", "fast"), 2.5)[0] < 0.008


def test_it_flies_without_a_future_by_guessing_it():
    def told(spec, t):
        return spec.reference(np.array([t]))

    assert flight(fresh("mpc_daqp"), path_spec("figure_eight", "fast"), 2.5, told)[0] < 0.015


def test_a_delay_it_knows_costs_little_and_one_it_does_not_know_costs_more():
    spec = path_spec("figure_eight", "fast")
    known, unknown = (flight(fresh("mpc_daqp", delay_s=d), spec, 2.0, late=3)[0] for d in (0.03, 0.0))
    assert known < 0.012
    assert unknown > 1.5 * known


def test_a_vehicle_unlike_the_model_is_flown_without_offset():
    """Motors 10 % weaker and unlike each other: offset-free after the observer has learned it."""
    spec = path_spec("hover_until_landing")
    controller = fresh("mpc_daqp")
    world = World(spec.reference(np.zeros(1)), seed=3, spread=1.0, thrust_scale=0.86)
    for k in range(400):
        world.fly(controller.command(0.01 * k, world.seen(), spec.reference(np.zeros(1))), 0.01)
    assert np.linalg.norm(world.plant.state[:3, 0] - [0.0, 0.0, 1.0]) < 1e-3
    assert abs(controller.observer.disturbance[0, 2]) > 0.5


def test_the_plan_stays_within_what_the_battery_gives():
    controller = fresh("mpc_daqp")
    state, reference = resting(battery_V=np.array([3.1]), rate_rad_s=np.array([[12.0, 0.0, 0.0]]))
    command = controller.command(0.0, state, reference)
    least, most = controller.thrust_map.limits(np.array([3.1]))
    plan = controller.plan.thrust_N[0]
    assert np.all((plan >= least - 1e-12) & (plan <= most + 1e-12))
    assert np.any(plan > most - 1e-9)
    np.testing.assert_allclose(command, controller.thrust_map.ratios(plan[:1], np.array([3.1])))


def test_a_lost_measurement_is_bridged_by_the_model_and_then_the_vehicle_sinks():
    spec, controller = path_spec("figure_eight", "slow"), fresh("mpc_daqp")

    def outage(t, state):
        gone = 1.2 <= t < 1.7
        return VehicleState(state.position_m * (np.nan if gone else 1.0), *list(vars(state).values())[1:])

    _, worst = flight(controller, spec, 2.5, seen=outage)
    assert worst < 0.02
    assert controller.guard.counts["measurement"] == 50
    assert controller.guard.counts["lost"] == 0
    state, _ = resting()
    state.position_m[:] = np.nan
    for k in range(70):
        command = controller.command(2.5 + 0.01 * k, state, spec.reference(np.zeros(1)))
    assert controller.guard.lost.all()
    assert np.ptp(command) == 0.0


def test_a_pose_that_stands_still_while_the_vehicle_flies_is_not_believed():
    spec, controller = path_spec("figure_eight", "fast"), fresh("mpc_daqp")
    held = {}

    def frozen(t, state):
        if t < 1.2 or t >= 1.6:
            held.update(vars(state))
        return VehicleState(held["position_m"], held["velocity_m_s"], held["quaternion"], state.rate_rad_s,
                            state.battery_V)

    _, worst = flight(controller, spec, 2.5, seen=frozen)
    assert controller.counts["stale"] > 25
    assert worst < 0.12  # 0.4 s at 1 m/s


def test_without_an_answer_the_last_plan_then_the_geometric_controller_then_a_landing(monkeypatch):
    controller = fresh("mpc_daqp")
    world = World(resting(r_position_m=np.array([[0.0, 0.0, 1.0]]))[1])
    _, reference = resting(r_position_m=np.array([[0.0, 0.0, 1.0]]))
    heights, k = [], 0

    def go(seconds):
        nonlocal k
        for _ in range(round(seconds / 0.01)):
            world.fly(controller.command(0.01 * k, world.seen(), reference), 0.01)
            heights.append(world.plant.state[2, 0])
            k += 1

    go(0.5)
    monkeypatch.setattr(type(controller), "solve", lambda *a: None if k % 2 else np.full((20, 4), np.nan))
    go(fallback.PLAN_S + fallback.GEOMETRIC_S)
    assert controller.fallback.counts["plan"] == round(fallback.PLAN_S / 0.01)
    assert controller.fallback.counts["geometric"] >= round(fallback.GEOMETRIC_S / 0.01) - 1
    assert min(heights) > 0.9
    assert max(heights) < 1.1
    go(2.0)
    assert controller.fallback.counts["land"] > 150
    assert 0.1 < heights[-1] < 0.5
    assert controller.counts["solver"] == k - 50


def hovers(controller):
    command = controller.command(0.0, *resting())
    hover = controller.thrust_map.ratios(np.full((1, 4), controller.hover_N), np.full(1, 3.6))
    np.testing.assert_allclose(command, hover)
    return controller.counts["solver"]


@pytest.mark.parametrize(("limit", "value"), [("MOST_ITERATIONS", 1), ("SOLVED", (99,))])
def test_a_solver_that_stops_early_is_a_solver_without_an_answer(monkeypatch, limit, value):
    controller = fresh("mpc_daqp")
    monkeypatch.setattr(mpc_qp, limit, value)
    _, there = resting(r_position_m=np.array([[3.0, 0.0, 1.0]]))
    state, _ = resting()
    assert np.isfinite(controller.command(0.0, state, there)).all()
    assert controller.counts["solver"] == 1


@pytest.mark.parametrize("wrong", ["contradiction", "not convex"])
def test_programs_that_osqp_refuses_are_failures(wrong):
    one, sign = np.ones(2), -1.0 if wrong == "not convex" else 1.0
    low, high = (one, -one) if wrong == "contradiction" else (-one, one)
    for rows in ((), (np.eye(2), one)):
        with pytest.raises(SolverFailure, match="OSQP refuses"):
            mpc_qp.DenseOsqp()(sign * np.eye(2), one, low, high, *rows)


def test_a_failure_falls_back_and_a_bug_of_ones_own_comes_through(monkeypatch):
    for failure in (SolverFailure("no answer"), np.linalg.LinAlgError("singular")):
        controller = fresh("mpc_daqp")
        monkeypatch.setattr(controller, "_solver", raising(failure))
        assert hovers(controller) == 1
    for bug in (TypeError("model"), KeyError("model"), ValueError("model"), IndexError("model")):
        for part in ("linearise", "_solver"):
            controller = fresh("mpc_daqp")
            monkeypatch.setattr(controller, part, raising(bug))
            with pytest.raises(type(bug), match="model"):
                controller.command(0.0, *resting())


def raising(error):
    def broken(*_, **__):
        raise error
    return broken


def test_an_empty_battery_lands_the_vehicle():
    spec, controller = path_spec("hover_until_landing"), fresh("mpc_daqp")
    world = World(spec.reference(np.zeros(1)), resistance_ohm=0.086)
    world.plant.charge[:] = 0.0
    for k in range(200):
        world.fly(controller.command(0.01 * k, world.seen(), with_future(spec, 0.01 * k)), 0.01)
    assert 2.8 < world.plant.battery_V[0] < fallback.LEAST_V
    assert controller.fallback.landing.all()
    assert world.plant.state[2, 0] < 0.6
    assert -1.5 < world.plant.state[VELOCITY][2, 0] < -0.3


def test_a_vehicle_that_lands_does_not_take_the_future_from_others():
    spec, found = path_spec("figure_eight", "fast"), {}
    world = World(spec.reference(np.zeros(1)))
    for volt in (2.5, 3.6):  # of the first of two
        controller = fresh("mpc_daqp", 2)
        for k in range(60):
            one, told = world.seen(), with_future(spec, 1.0 + 0.01 * k)

            def both(seconds, told=told):
                return Reference(*(np.repeat(part, 2, axis=1) for part in list(vars(told.ahead(seconds)).values())[:6]))

            state = VehicleState(*(np.repeat(part, 2, axis=0) for part in vars(one).values()))
            state.battery_V[0] = volt
            reference = Reference(*(np.repeat(part, 2, axis=0) for part in list(vars(told).values())[:6]), both)
            found[volt] = controller.command(0.01 * k, state, reference)
        assert controller.fallback.landing.tolist() == [volt < 3.0, False]
    np.testing.assert_array_equal(found[2.5][1], found[3.6][1])


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
def test_a_reference_that_jumps_is_flown_to(name):
    controller = fresh(name)
    world = World(resting()[1])
    _, there = resting(r_position_m=np.array([[2.0, -1.0, 0.5]]))
    tilt = []
    for k in range(350):
        world.fly(controller.command(0.01 * k, world.seen(), there), 0.01)
        q = world.plant.state[QUATERNION, 0]
        tilt.append(np.arccos(1.0 - 2.0 * (q[0] ** 2 + q[1] ** 2)))
    assert max(tilt) < 1.0
    assert np.linalg.norm(world.plant.state[:3, 0] - [2.0, -1.0, 0.5]) < 0.05
    assert controller.counts["solver"] == 0


def test_a_clock_that_stands_or_runs_back_holds_the_command_and_one_that_leaps_starts_anew():
    controller = fresh("mpc_daqp")
    state, reference = resting(r_position_m=np.array([[0.0, 0.0, 0.02]]))
    first = controller.command(5.0, state, reference).copy()
    for t in (5.0, 4.99, 5.0 - 1e-9):
        np.testing.assert_array_equal(controller.command(t, state, reference), first)
    assert controller.counts["time"] == 3
    assert controller.counts["started"] == 1
    assert np.any(controller.command(5.01, state, reference) != first)
    controller.command(9.0, *resting(position_m=np.full((1, 3), 0.2)))
    assert controller.counts["started"] == 2
    np.testing.assert_allclose(controller.observer.state[0, :3], 0.2, atol=1e-3)
    controller.command(np.nan, state, reference)
    assert controller.counts["time"] == 5


def test_a_future_that_is_no_use_is_guessed_and_counted():
    controller = fresh("mpc_daqp")
    spec = path_spec("circle", "slow")

    expected = controller.command(0.0, World(with_future(spec, 0.0)).seen(), with_future(spec, 0.0, ahead=None)).copy()
    controller.reset(1)
    found = controller.command(0.0, World(with_future(spec, 0.0)).seen(),
                               with_future(spec, 0.0, ahead=lambda s: with_future(spec, np.nan).ahead(s)))
    np.testing.assert_array_equal(found, expected)
    assert controller.counts["future"] == 1


@pytest.mark.parametrize(("ahead", "error"), [
    (lambda seconds: {}["bug"], KeyError), (lambda seconds: None, AttributeError)])
def test_a_bug_of_the_future_comes_out(ahead, error):
    spec = path_spec("circle", "slow")
    with pytest.raises(error):
        fresh("mpc_daqp").command(0.0, World(with_future(spec, 0.0)).seen(), with_future(spec, 0.0, ahead=ahead))


def test_a_future_of_another_shape_is_no_future():
    """A present given where the future was asked for would hold the vehicle where it is asked to be now."""
    controller, spec = fresh("mpc_daqp"), path_spec("circle", "slow")
    with pytest.raises(ValueError, match="a present is no future"):
        controller.command(0.0, World(with_future(spec, 0.0)).seen(),
                           with_future(spec, 0.0, ahead=lambda _: with_future(spec, 0.0)))


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
def test_what_is_compiled_at_its_first_call_was_called_before_the_flight(monkeypatch, name):
    called = []
    for module, function in ((mpc_linear, "rows_of"), (nmpc if name == "nmpc" else mpc_linear, "condensed"),
                             (mpc_base, "_judged"), (fallback.Geometric, "command")):
        inner = getattr(module, function)

        def noted(*given, inner=inner, word=function):
            called.append(word)
            return inner(*given)
        monkeypatch.setattr(module, function, noted)
    controller = KINDS[name](practice_model(), tuning=FRESH)
    controller.reset(2)
    assert set(called) == {"rows_of", "condensed", "_judged", "command"}
    assert controller.n == 2
    assert not any(controller.counts.values())
    assert not any(controller.fallback.counts.values())
    called.clear()
    controller.reset(1)  # once is enough
    assert not called


def test_a_shifted_plan_is_read_between_its_stages_and_held_at_its_end():
    plan = mpc_plan.Plan(2, 5, 0.025, 0.1)
    plan.thrust_N[:] = np.random.default_rng(1).uniform(0.02, 0.15, (2, 5, 4))
    for seconds in (0.0, 0.01, 0.025, 0.06, 0.3):
        at = np.minimum(0.025 * np.arange(5) + seconds, 0.1)
        expected = [np.interp(at, 0.025 * np.arange(5), plan.thrust_N[1, :, m]) for m in range(4)]
        np.testing.assert_allclose(plan.shifted(1, seconds), np.transpose(expected), atol=1e-15)
    plan.age_s[:] = 0.0, 0.06
    limits = np.stack([np.full((2, 4), 0.05), np.full((2, 4), 0.12)])
    expected = np.clip([plan.thrust_N[0, 0], plan.shifted(1, 0.06)[0]], 0.05, 0.12)
    np.testing.assert_array_equal(plan.now(limits), expected)


ANYTHING = st.one_of(st.floats(-3.0, 3.0), st.floats(), st.sampled_from([0.0, np.nan, np.inf, -np.inf, 1e300, -1e-300]))


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=arrays(float, (4, 2, 29), elements=ANYTHING))
def test_no_input_makes_it_fail(name, values):
    controller = fresh(name, 2)
    for v in values:
        state = VehicleState(v[:, :3], v[:, 3:6], v[:, 6:10], v[:, 10:13], v[:, 13])
        reference = Reference(v[:, 14:17], v[:, 17], v[:, 18:21], v[:, 21:24], v[:, 24:27], v[:, 27])
        command = controller.command(v[0, 28], state, reference)
        assert command.shape == (2, 4)
        assert np.all((command >= 0.0) & (command <= 1.0))
    start = controller._time_s if np.isfinite(controller._time_s) else 0.0
    for k in range(1, 12):
        command = controller.command(start + 0.01 * k, *resting(2))
        assert np.all((command >= 0.0) & (command <= 1.0))
    assert not controller.guard.lost.any()


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=arrays(float, (12,), elements=st.floats(-1.0, 1.0)), volt=st.floats(3.0, 4.2))
def test_from_any_start_in_the_room_every_step_has_a_plan_within_limits(name, values, volt):
    controller = fresh(name)
    state, reference = resting(position_m=2.0 * values[None, :3], velocity_m_s=2.0 * values[None, 3:6],
                               quaternion=so3.exp(1.5 * values[None, 6:9]), rate_rad_s=8.0 * values[None, 9:],
                               battery_V=np.full(1, volt))
    for k in range(3):
        command = controller.command(0.01 * k, state, reference)
    assert controller.counts["solver"] == 0
    assert np.all((command >= 0.0) & (command <= 1.0))


def test_vehicles_fly_in_a_batch_as_they_do_alone():
    rng, together, alone = np.random.default_rng(6), fresh("nmpc", 3), Nmpc(practice_model(), tuning=FRESH)
    alone.reset(1)
    many = [resting(3, position_m=0.1 * rng.standard_normal((3, 3)), rate_rad_s=rng.standard_normal((3, 3)))
            for _ in range(8)]
    for k, pair in enumerate(many):
        batch = together.command(0.01 * k, *pair)[1]
        one = (type(x)(*(v if v is None else v[[1]] for v in vars(x).values())) for x in pair)
        np.testing.assert_allclose(alone.command(0.01 * k, *one)[0], batch, atol=1e-9)


@pytest.mark.filterwarnings("ignore")  # pytest would keep those of osqp
@pytest.mark.parametrize("name", KINDS)
def test_commands_leave_no_memory_behind(name):
    controller, spec = fresh(name), path_spec("figure_eight", "fast")
    world = World(spec.reference(np.zeros(1)))
    seen = world.seen()
    seen.rate_rad_s[:] = [[9.0, 0.0, 0.0]]  # beyond limits now and then: rows and restarts too

    def go(first, count):
        for k in range(first, first + count):
            controller.command(0.01 * k, seen if k % 7 == 0 else world.seen(), with_future(spec, 0.01 * k))

    go(0, 40)
    gc.collect()
    tracemalloc.start()
    try:
        marks = []
        for k in range(40, 440, 80):
            go(k, 80)
            gc.collect()
            marks.append(tracemalloc.get_traced_memory()[0])
        # Python's own free lists fill up for a while; a leak grows all the time
        assert np.diff(marks).min() < 800  # 10 bytes a command
    finally:
        tracemalloc.stop()


def test_unknown_solvers_are_refused_in_one_line():
    with pytest.raises(UsageError, match="unknown solver 'simplex'; known: daqp, osqp"):
        MpcDaqp(solver="simplex")


def test_a_model_of_ones_own_with_a_delay_sets_the_delay():
    model = make("mpc_daqp").model
    found = MpcDaqp(model.with_term("command_delay", delay_s=0.02))
    assert found.delay_s == pytest.approx(0.02)
    assert isinstance(found, mpc_base.Mpc)
