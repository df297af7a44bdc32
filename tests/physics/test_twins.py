"""NumPy and CasADi evaluate the same equations: equal to 1e-12, for every term alone and for all together."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_cases import draw, models, windows

from nanobench_tools.physics import numeric, symbolic
from nanobench_tools.physics.inputs import rows, settled, warmed

MODELS = models()


@functools.cache
def functions(name):
    return symbolic.derivative(MODELS[name]), symbolic.step(MODELS[name])


def relative(a, b):
    """Difference relative to the size of the numbers, row by row of a state."""
    return np.max(np.abs(a - b) / (1.0 + np.abs(b)))


@pytest.mark.parametrize("name", MODELS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_numpy_and_casadi_agree(name, seed):
    model = MODELS[name]
    states, inputs = draw(model, 5, seed)
    for numpy_way, casadi_way in zip((numeric.derivative, numeric.step), functions(name), strict=True):
        ours = numpy_way(model, states, inputs)
        for row in range(len(states)):
            theirs = np.asarray(casadi_way(states[row], inputs[row], model.values)).ravel()
            assert relative(ours[row], theirs) < 1e-12


@pytest.mark.parametrize("name", MODELS)
def test_warm_up_agrees(name):
    """Settled rotors and one row of lag, from both sides."""
    model = MODELS[name]
    _, inputs = draw(model, 3, 2)
    asked = settled(model, inputs.T, row_hz=100.0)
    after = warmed(model, inputs.T[None], inputs.T[None], row_hz=100.0)
    for i in range(3):
        wanted = np.asarray(symbolic.command(model)(inputs[i], model.values)).ravel()
        assert relative(asked[:, i], wanted) < 1e-12
        followed = np.asarray(symbolic.lagged(model)(wanted, inputs[i], model.values)).ravel()
        assert relative(after[:, i], followed) < 1e-12


@pytest.mark.parametrize("name", ["all", "all on rpm", "motor_lag"])
def test_rollouts_agree(name):
    model = MODELS[name]
    start, motor, battery, past = windows(model, 3, 1)
    states = numeric.rollout(model, start, motor, battery, past)
    given_rows, _ = rows(model, motor, battery, past, row_hz=100.0)
    fly = symbolic.rollout(model, motor.shape[1])
    for i in range(3):
        theirs = np.asarray(fly(states[i, 0], given_rows[:, :, i].T, model.values)).T
        assert relative(states[i, 1:], theirs) < 1e-11


@pytest.mark.parametrize("name", MODELS)
def test_one_window_is_as_in_a_batch(name):
    model = MODELS[name]
    states, inputs = draw(model, 4, 7)
    whole = numeric.step(model, states, inputs)
    for row in range(4):
        np.testing.assert_array_max_ulp(whole[row], numeric.step(model, states[row:row + 1], inputs[row:row + 1])[0], 8)


def test_parameters_of_each_window():
    model = MODELS["all"]
    states, inputs = draw(model, 3, 3)
    many = np.repeat(model.values[None], 3, axis=0)
    many[1, model.index("thrust_scale.s")] = 0.8
    got = numeric.step(model, states, inputs, many)
    np.testing.assert_allclose(got[[0, 2]], numeric.step(model, states, inputs)[[0, 2]], rtol=1e-14)
    other = model.with_parameters({"thrust_scale.s": 0.8})
    np.testing.assert_allclose(got[1], numeric.step(other, states, inputs)[1], rtol=1e-14)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.slow
def test_derivatives_are_those_of_differences(name):
    """Exact derivatives of a step with respect to parameters and state, against central differences of NumPy."""
    import casadi as ca

    model = MODELS[name]
    _, step = functions(name)
    x, u, p = (ca.SX.sym(k, step.size1_in(i)) for i, k in enumerate("xup"))
    jacobian = ca.Function("j", [x, u, p], [ca.jacobian(step(x, u, p), ca.vertcat(x, p))])
    states, inputs = draw(model, 1, 11)
    states[0, 2] = 0.7
    exact = np.asarray(jacobian(states[0], inputs[0], model.values))
    at = np.concatenate([states[0], model.values])
    nothing = np.minimum(0.01 * (model.upper - model.lower), 0.1)  # bounds hold for vehicles of 5 kg
    scale = np.concatenate([np.ones(17), np.where(model.values == 0.0, nothing, np.abs(model.values))])
    assert np.isfinite(exact).all()
    for i in range(len(at)):
        h = 1e-6 * scale[i]
        ends = [np.concatenate([at[:i], [at[i] + s * h], at[i + 1:]]) for s in (1, -1)]
        low, high = (numeric.step(model, e[None, :17], inputs, e[17:])[0] for e in reversed(ends))
        slope = (high - low) / (2 * h)
        np.testing.assert_allclose(exact[:, i] * scale[i], slope * scale[i], rtol=2e-5, atol=2e-5, err_msg=str(i))
