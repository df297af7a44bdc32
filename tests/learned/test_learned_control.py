"""Cloned policies, learned dynamics, MPPI: what they are shown, may command, and whose equations they use."""

from dataclasses import replace

import numpy as np
import pytest

from controllers.learned import policies
from controllers.learned.costs import LOST, Costs
from controllers.learned.demonstrations import Demonstration, demonstrations, shown
from controllers.learned.learned_flights import Corrected, _taught, pilot_of
from controllers.learned.mppi import MppiSettings, improved, shifted
from controllers.learned.pilots import ClonedPolicy, Mppi
from controllers.learned.policies import Network, fresh, task_of, trained
from controllers.learned.rollouts import rolled, score
from controllers.plants.ensemble import shipped_simulator
from identification.learned.libraries import libraries
from identification.learned.training import Settings
from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics import numeric
from nanobench_tools.physics.simulator import loads


def audit_of(flight, controller="pid"):
    return Audit(flight.name, flight.provenance.path, flight.provenance.sha256, controller, (flight.span,),
                 (flight.span,), (), {}, {}, flight.span)


@pytest.fixture(scope="module")
def found(crowd):
    flights = [crowd.flight(name) for name in ("short circle", "short trefoil", "circle", "trefoil", "medium trefoil")]
    flights = [replace(f, name=f"flight {i}", epoch_s=float(i)) for i, f in enumerate(flights)]
    return demonstrations(flights, {f.name: audit_of(f) for f in flights})


def untrained(kind, found, seed=0):
    leaves = [np.asarray(leaf) for leaf in libraries().jax.tree.leaves(fresh(kind, seed)) if hasattr(leaf, "shape")]
    rows = np.concatenate([d.observed for d in found])
    return Network(kind, tuple(leaves), rows.mean(0), np.maximum(rows.std(0), 1e-3))


def hover(n=2):
    state = VehicleState(np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros((n, 3)), np.tile([0, 0, 0, 1.0], (n, 1)),
                         np.zeros((n, 3)), np.full(n, 3.6))
    return state, Reference(state.position_m, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))


def test_observations_are_what_the_log_holds(crowd, found):
    flight = crowd.flight("short circle")
    mine = found[0]
    assert mine.observed.shape[1] == 14
    assert 0.0 <= mine.action.min() <= mine.action.max() <= 1.0
    assert (mine.observed[:, 9] >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(mine.observed[:, 6:10], axis=1), 1.0, atol=1e-3)
    np.testing.assert_allclose(mine.observed[:, 13].max(), flight["battery"]["vbat"].max(), atol=0.3)
    assert mine.observed[:, 12].max() == pytest.approx(flight["setpoint"]["z"].max(), abs=1e-3)
    assert sum(mine.lengths) == len(mine.observed)


def test_whole_flights_are_held_out_and_the_published_reference_is_never_learnt(found):
    parts = shown(found)
    names = [{d.name for d in part} for part in (parts.train, parts.valid, parts.test)]
    assert not names[0] & names[1]
    assert not names[0] & names[2]
    assert not names[1] & names[2]
    assert sum(map(len, names)) == len(found)
    assert any(d.reference == "trefoil medium" for d in parts.test)
    others = [replace(d, controller="mellinger") for d in found]
    with pytest.raises(InputError, match="0 flights of the onboard PID"):
        shown(others)


@pytest.mark.slow
def test_policies_learn(found, tmp_path):
    parts = shown(found)
    quick = Settings(epochs=3, batch=64, share=0.3)
    made = trained("bc_mlp", parts, quick, tmp_path)
    again = trained("bc_mlp", parts, quick, tmp_path)
    np.testing.assert_array_equal(made.leaves[0], again.leaves[0])
    assert made.trained["history"][-1][0] < 0.5 * made.trained["history"][0][0]
    commands = policies.commands(made, parts.test[0])
    logged = parts.test[0].action[parts.test[0].longest]
    assert commands.shape == logged.shape
    assert np.abs(commands - logged).mean() < 0.2
    recurrent = task_of("bc_lstm", parts, 0, made.mean, made.spread)
    assert recurrent.train.min() == policies.SEEN - 1
    with pytest.raises(UsageError, match="unknown network 'gru'"):
        fresh("gru")


def test_dynamics_that_stand_still_leave_the_vehicle_where_it_was(found):
    flight = found[-1]
    still = untrained("dynamics", found)
    still = replace(still, leaves=tuple(0.0 * leaf for leaf in still.leaves))
    pilot = untrained("bc_mlp", found)
    states = rolled("bc_mlp", {"bc_mlp": pilot, "dynamics": still}, [flight])[0]
    log = flight.observed[flight.longest]
    np.testing.assert_allclose(states[:, :3], np.broadcast_to(log[0, :3], states[:, :3].shape), atol=1e-5)
    np.testing.assert_allclose(states[1:, 10:], log[1:len(states), 10:], atol=1e-6)
    scores = score(states, flight)
    errors = np.linalg.norm(log[:len(states), :3] - log[0, :3], axis=1)
    assert scores["rmse_m"] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-4)
    assert scores["divergence_percent"] == pytest.approx(100.0 * np.mean(errors > 0.5), abs=0.2)
    assert errors.max() <= 2.0


def test_plan_moves_to_what_costs_less_and_stays_possible():
    jax, jnp = libraries().jax, libraries().jnp
    settings = MppiSettings(horizon=3, samples=256, temperature=0.01, noise=0.05, price=0.0)
    goal = jnp.array([0.9, 0.5, 1.4, -0.3])
    plan = jnp.full((3, 4), 0.5)
    for k in range(60):
        noise = settings.noise * jax.random.normal(jax.random.key(k), (256, 3, 4))
        plan = improved(plan, noise, lambda tried: jnp.sum((tried - goal) ** 2, axis=(1, 2)), settings)
    np.testing.assert_allclose(np.asarray(plan), np.tile([0.9, 0.5, 1.0, 0.0], (3, 1)), atol=0.08)
    noise = 0.02 * jax.random.normal(jax.random.key(0), (256, 3, 4))
    priced = improved(plan, noise, lambda tried: 0.0 * tried[:, 0, 0], MppiSettings(samples=256))
    assert float(priced.sum()) < float(plan.sum())  # the published price alone pulls commands towards nothing
    np.testing.assert_array_equal(np.asarray(shifted(jnp.arange(8.0).reshape(2, 4)))[:, 0], [4.0, 4.0])
    with pytest.raises(UsageError, match="MPPI with noise 0"):
        MppiSettings(noise=0.0)


@pytest.mark.parametrize("step_s", [0.01, 0.02])
def test_plans_cost_what_the_equations_of_the_model_say(step_s):
    model = loads(shipped_simulator()).without("command_delay")
    rng = np.random.default_rng(0)
    settings = MppiSettings(horizon=3, step_s=step_s, upright=2.0, turning=0.01, effort=0.3)
    start = np.concatenate([rng.normal(size=(2, 6)), [[0.1, -0.05, 0.02, 0.99]] * 2, rng.normal(size=(2, 3)),
                            np.full((2, 4), 0.1)], axis=1)
    start[:, 6:10] /= np.linalg.norm(start[:, 6:10], axis=1, keepdims=True)
    tried, battery, goals = rng.uniform(0.6, 0.9, (2, 5, 3, 4)), np.array([3.6, 3.9]), rng.normal(size=(2, 3))
    found = Costs(model, settings)(tried, start.T, battery, goals)
    for vehicle in range(2):
        for plan in range(5):
            state, cost = start[vehicle:vehicle + 1], 0.0
            for action in tried[vehicle, plan]:
                state = numeric.step(model, state, np.array([[*action, battery[vehicle]]]), row_hz=1.0 / step_s)
                cost += (np.sum((state[0, :3] - goals[vehicle]) ** 2) + 0.05 * np.sum(state[0, 3:6] ** 2)
                         + 2.0 * (1.0 - so3.matrix(state[0, 6:10])[2, 2]) + 0.01 * np.sum(state[0, 10:13] ** 2)
                         + 0.3 * np.sum(action**2))
            assert found[vehicle, plan] == pytest.approx(cost, rel=1e-6)
    start[1, 0] = np.nan
    assert (Costs(model, settings)(tried, start.T, battery, goals)[1] == LOST).all()


def test_mixing_is_the_same_for_many_vehicles_and_in_jax():
    rng, settings = np.random.default_rng(1), MppiSettings(horizon=3, samples=6)
    plans, noise = rng.uniform(0.0, 1.0, (2, 3, 4)), 0.2 * rng.normal(size=(2, 6, 3, 4))

    def cost(tried):
        return (tried**2).sum(axis=(-2, -1))

    found = improved(plans, noise, cost, settings)
    for one in range(2):
        alone = improved(libraries().jnp.asarray(plans[one]), libraries().jnp.asarray(noise[one]), cost, settings)
        np.testing.assert_allclose(np.asarray(alone), found[one], atol=1e-5)
    np.testing.assert_array_equal(shifted(plans)[1], np.concatenate([plans[1, 1:], plans[1, 2:]]))


def test_pilots_command_within_limits_whatever_they_see(found):
    state, reference = hover()
    nets = {kind: untrained(kind, found) for kind in ("bc_mlp", "bc_lstm", "dynamics")}
    nan = replace(state, position_m=np.full((2, 3), np.nan))
    short = Mppi(loads(shipped_simulator()), horizon=2, samples=4)
    for pilot in (ClonedPolicy(nets["bc_mlp"]), ClonedPolicy(nets["bc_lstm"]), short):
        pilot.reset(2)
        for seen in (state, nan, state):
            command = pilot.command(0.0, seen, reference)
            assert command.shape == (2, 4)
            assert ((command >= 0.0) & (command <= 1.0)).all()
    with pytest.raises(UsageError, match="unknown learned controller 'x'"):
        pilot_of("x", nets, shipped_simulator())


def test_teacher_says_what_the_onboard_pid_would_do(found):
    state, reference = hover()
    both = Corrected(ClonedPolicy(untrained("bc_mlp", found)), 0.5)
    both.reset(2)
    alone = type(both.teacher)()
    alone.reset(2)
    for k in range(600):
        command, wanted = both.command(0.002 * k, state, reference), alone.command(0.002 * k, state, reference)
        np.testing.assert_array_equal(command[0], wanted[0])
    assert len(both.seen) == len(both.taught_commands) == 120
    taught = _taught(both, 0)
    assert [len(d.action) for d in taught] == [120, 120]
    assert isinstance(taught[0], Demonstration)
