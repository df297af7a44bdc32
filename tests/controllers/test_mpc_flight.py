"""What predictive control flies: paths, delays, vehicles unlike the model, batches."""

import gc
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from mpc_flights import FRESH, KINDS, World, flight, fresh, make, resting, with_future

from controllers.mpc import fallback, linear_mpc, nmpc, predictive_base
from controllers.mpc.linear_mpc import MpcDaqp
from controllers.mpc.nmpc import Nmpc
from controllers.mpc.prediction_model import practice_model
from nanobench_tools.lookup import registry
from nanobench_tools.methods import Controller
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.rigid_bodies import QUATERNION

DEEP = 30
"""Frames of an allocation that are kept: more than lie between a test and a solver."""


@pytest.mark.parametrize("name", KINDS)
def test_they_are_registered_and_keep_the_protocol(name):
    assert registry.load("controllers", name) is KINDS[name]
    controller = make(name)
    assert isinstance(controller, Controller)
    assert (controller.name, controller.information) == (name, "preview")


@pytest.mark.parametrize("name", KINDS)
def test_it_flies_a_figure_of_eight_it_can_look_ahead_on(name):
    assert flight(fresh(name), path_spec("figure_eight", "fast"), 2.5)[0] < 0.008


def test_it_flies_without_a_future_by_guessing_it():
    def told(spec, t):
        return spec.reference(np.array([t]))

    assert flight(fresh("mpc_daqp"), path_spec("figure_eight", "fast"), 2.5, told)[0] < 0.015


@pytest.mark.slow
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


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
@pytest.mark.slow
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


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
def test_what_is_compiled_at_its_first_call_was_called_before_the_flight(monkeypatch, name):
    called = []
    for module, function in ((linear_mpc, "rows_of"), (nmpc if name == "nmpc" else linear_mpc, "condensed"),
                             (predictive_base, "_judged"), (fallback.Geometric, "command")):
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


def test_vehicles_fly_in_a_batch_as_they_do_alone():
    rng, together, alone = np.random.default_rng(6), fresh("nmpc", 3), Nmpc(practice_model(), tuning=FRESH)
    alone.reset(1)
    many = [resting(3, position_m=0.1 * rng.standard_normal((3, 3)), rate_rad_s=rng.standard_normal((3, 3)))
            for _ in range(8)]
    for k, pair in enumerate(many):
        batch = together.command(0.01 * k, *pair)[1]
        one = (type(x)(*(v if v is None else v[[1]] for v in vars(x).values())) for x in pair)
        np.testing.assert_allclose(alone.command(0.01 * k, *one)[0], batch, atol=1e-9)


def test_what_it_foresees_is_its_plan_flown():
    controller = fresh("mpc_daqp")
    controller.command(0.0, *resting(r_position_m=np.array([[0.2, 0.0, 0.1]])))
    now, later, after = (controller.foreseen(seconds)[0] for seconds in (0.0, 0.3, 0.301))
    np.testing.assert_allclose(now[:3], 0.0, atol=1e-9)
    assert later[0] > 0.005
    assert later[3] > 0.05
    assert controller.foreseen(0.1)[0, 11] > 0.1  # it tips forward first
    np.testing.assert_allclose((after[:3] - later[:3]) / 0.001, later[3:6], atol=5e-3)


@pytest.mark.filterwarnings("ignore")  # pytest would keep those of osqp
@pytest.mark.parametrize("name", KINDS)
@pytest.mark.slow
def test_commands_leave_no_memory_behind(name):
    """Only what is allocated below ``go`` counts: neither other threads nor the snapshots of memory themselves."""
    controller, spec = fresh(name), path_spec("figure_eight", "fast")
    world = World(spec.reference(np.zeros(1)))
    seen = world.seen()
    seen.rate_rad_s[:] = [[9.0, 0.0, 0.0]]  # beyond limits now and then: rows and restarts too

    def go(first, count):
        for k in range(first, first + count):
            controller.command(0.01 * k, seen if k % 7 == 0 else world.seen(), with_future(spec, 0.01 * k))

    below = [tracemalloc.Filter(True, __file__, all_frames=True)]
    below += [tracemalloc.Filter(False, tracemalloc.__file__, all_frames=True)]
    below += [tracemalloc.Filter(False, "*/osqp/interface.py")]  # its lookup of status words keeps some, ever fewer
    go(0, 20)
    gc.collect()
    tracemalloc.start(DEEP)
    try:
        marks = []
        for k in range(20, 320, 60):
            go(k, 60)
            gc.collect()
            marks.append(tracemalloc.take_snapshot().filter_traces(below))
        # Free lists of Python and of the solvers' interfaces grow a little anywhere; a leak grows in one line, always
        gained = [{line.traceback: line.size_diff for line in b.compare_to(a, "lineno")} for a, b in pairwise(marks)]
        always = {line: min(g.get(line, 0) for g in gained) for line in gained[-1]}
        assert max(always.values()) < 1200, max(always, key=always.get)  # 20 bytes a command: less than any object
    finally:
        tracemalloc.stop()


def test_a_model_of_ones_own_with_a_delay_sets_the_delay():
    model = make("mpc_daqp").model
    found = MpcDaqp(model.with_term("command_delay", delay_s=0.02))
    assert found.delay_s == pytest.approx(0.02)
    assert isinstance(found, predictive_base.Mpc)
