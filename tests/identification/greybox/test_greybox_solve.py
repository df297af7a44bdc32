"""Fits against what is known: central differences, parameters that made the data, bounds, priors, intervals."""

from dataclasses import replace

import numpy as np
import pytest
from made_windows import TERMS, made_windows, true_model

from identification.greybox.nuisance import SCALE, TRIMS
from identification.greybox.parameter_intervals import bootstrap, information, not_identified, profile
from identification.greybox.ranges import held, priors
from identification.greybox.residuals import HORIZONS, errors
from identification.greybox.sensitivity import sensitivities
from identification.greybox.solve import Problem, solve
from nanobench_tools.physics.fit_bounds import bounds
from nanobench_tools.physics.rollout import rollout

MEAN_ONE = tuple(p for p in priors(true_model()) if len(p.names) == 4)


def problem_of(model, data, **changes):
    lower, upper = bounds(model)
    free = np.array([name not in held(model) for name in model.names])
    return replace(Problem(model, data, free, np.where(free, lower, model.values), np.where(free, upper, model.values),
                           MEAN_ONE), **changes)


def test_derivatives_are_those_of_the_rollout():
    model = true_model()
    data = made_windows(model, n=12)
    _, slopes = sensitivities(model, data.start, data.motor, data.battery_V, data.past, np.eye(len(model.names)),
                              keep=HORIZONS)
    for i, name in enumerate(model.names):
        step = 1e-6 * max(abs(model.values[i]), 1e-3)
        moved = [rollout(model, data.start, data.motor, data.battery_V, data.past,
                         parameters=model.values + sign * step * np.eye(len(model.names))[i])[:, HORIZONS, :13]
                 for sign in (1.0, -1.0)]
        central = ((moved[0] - moved[1]) / (2.0 * step)).transpose(1, 2, 0)
        assert np.abs(slopes[:, i] - central).max() < 1e-4 * (1e-6 + np.abs(central).max()), name


def test_each_window_may_have_its_own_parameters():
    model = true_model()
    data = made_windows(model, n=8)
    own = model.values * (1.0 + 0.01 * np.random.default_rng(1).normal(size=(8, len(model.names))))
    directions = np.eye(len(model.names))[:, [1, 4, 8]]
    together = sensitivities(model, data.start, data.motor, data.battery_V, data.past, directions, keep=HORIZONS,
                             parameters=own)
    for i in range(8):
        one = data.rows(slice(i, i + 1))
        alone = sensitivities(model, one.start, one.motor, one.battery_V, one.past, directions, keep=HORIZONS,
                              parameters=own[i])
        for a, b in zip(together, alone, strict=True):
            np.testing.assert_allclose(a[..., i:i + 1], b, rtol=1e-10, atol=1e-12)


def test_attitude_error_is_the_small_rotation_whatever_the_sign():
    truth = np.zeros((1, 1, 13))
    truth[..., 9] = -1.0
    state = np.zeros((1, 13, 1))
    state[0, 6:10, 0] = [np.sin(0.005), 0.0, 0.0, np.cos(0.005)]
    found, _ = errors(state, None, truth)
    np.testing.assert_allclose(found[0, 0, 2], [0.01, 0.0, 0.0], atol=1e-7)


def test_without_noise_the_parameters_come_back():
    model = true_model()
    changed = {"thrust_voltage.c[2]": 0.0030, "motor_lag.tau_up_s": 0.05, "drag_linear.d[0]": 0.03,
               "inertia.inertia_kg_m2[0]": 3.5e-5, "drag_torque.c": -4e-4, "angular_damping.d_r[1]": 1e-4}
    solution = solve(problem_of(model.with_parameters(changed), made_windows(model, n=40)))
    assert not solution.trouble
    assert not solution.on_bound
    moved = np.abs(solution.model.values - model.values) / np.maximum(np.abs(model.values), 1e-3)
    assert moved.max() < 2e-2, dict(zip(model.names, moved, strict=True))


@pytest.mark.slow
def test_intervals_hold_the_truth_and_nuisances_stay_out_of_the_shared_parameters():
    model = true_model()
    rng = np.random.default_rng(5)
    nuisances = (SCALE, *TRIMS)
    patterns = np.array([n.vector(model) for n in nuisances])
    flights, inside = 12, []
    own = 0.01 * rng.normal(size=(flights, 4))
    own -= own.mean(axis=0)
    data = made_windows(model, n=96, flights=flights, noise=1.0, seed=3, own=own @ patterns)
    with_own = solve(problem_of(model, data, nuisances=nuisances))
    without = solve(problem_of(model, data))
    np.testing.assert_allclose(with_own.own, own, atol=4e-3)
    ci95 = bootstrap(with_own)
    for name, (low, high) in ci95.items():
        value, wide = model.parameters[name], high - low
        inside.append(low - 0.5 * wide <= value <= high + 0.5 * wide)
    assert np.mean(inside) > 0.8
    off = [abs(s.model.parameters["drag_torque.c"] + 2e-4) for s in (with_own, without)]
    assert (with_own.scale < without.scale).all()  # usual errors of each fit
    assert off[0] < 2e-5


def test_a_wrong_sign_ends_on_the_bound_and_says_so():
    """What would need motors that turn the vehicle the other way is not fitted."""
    truth = true_model().with_parameters({"drag_torque.c": 3e-4})
    solution = solve(problem_of(true_model(), made_windows(truth, n=40)))
    assert "drag_torque.c" in solution.on_bound


def test_few_flights_give_no_interval():
    model = true_model()
    assert bootstrap(solve(problem_of(model, made_windows(model, n=40, flights=1, noise=1.0)))) is None


def test_sessions_that_differ_widen_intervals_and_one_session_has_none():
    """Thrust of two sessions in three is one percent off: within a session all flights agree."""
    model = true_model()
    nuisances = (SCALE,)
    labels = np.repeat([0, 1, 2], 4)
    off = np.array([-0.02, 0.0, 0.02])[labels][:, None] * np.array([n.vector(model) for n in nuisances])
    solution = solve(problem_of(model, made_windows(model, n=96, flights=12, noise=0.3, seed=3, own=off)))
    alone, nested = bootstrap(solution), bootstrap(solution, sessions=labels)
    name = next(n for n in nested if n.startswith("thrust"))
    assert np.ptp(nested[name]) > 1.3 * np.ptp(alone[name])
    assert bootstrap(solution, sessions=np.full(12, -1)) == alone
    assert bootstrap(solution, sessions=np.zeros(12)) is None


def test_what_is_not_told_is_named_with_the_flight_that_would():
    """At one battery voltage nothing tells PWM from voltage, and a scale of thrust trades against its curve."""
    model = true_model()
    free = np.isin(model.names, ["thrust_scale.s", "thrust_voltage.c[0]", "thrust_voltage.c[1]", "thrust_voltage.c[2]"])
    lower, upper = bounds(model)
    solution = solve(Problem(model, made_windows(model, n=80), free, lower, upper))
    assert information(solution).condition > 1e6
    assert any("thrust_scale.s" in text or "thrust_voltage" in text for text in not_identified(solution, None))


def test_profile_rises_away_from_the_optimum():
    model = true_model()
    solution = solve(problem_of(model, made_windows(model, n=40, noise=1.0)))
    best = solution.model.parameters["drag_linear.d[0]"]
    low, at, high = profile(solution, "drag_linear.d[0]", [0.8 * best, best, 1.2 * best])
    assert low["rise"] > 0.01
    assert high["rise"] > 0.01
    assert abs(at["rise"]) < 1e-2 * solution.cost


def test_terms_of_the_model_keep_their_names():
    assert set(TERMS) == {term.name for term in true_model().terms}
