"""What flies when a solver has no answer or the battery is empty."""

import numpy as np
import pytest
from mpc_flights import World, fresh, resting, with_future

from controllers.mpc import dense_qp, fallback
from controllers.mpc.casadi_code import SolverFailure
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.rigid_bodies import VELOCITY


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
    monkeypatch.setattr(dense_qp, limit, value)
    _, there = resting(r_position_m=np.array([[3.0, 0.0, 1.0]]))
    state, _ = resting()
    assert np.isfinite(controller.command(0.0, state, there)).all()
    assert controller.counts["solver"] == 1


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
