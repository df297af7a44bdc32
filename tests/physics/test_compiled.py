"""Compiled code against NumPy and against CasADi's own evaluation: models, single operations, shapes, the cache."""

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from physics_cases import draw, models, windows

from nanobench_tools.errors import InputError
from nanobench_tools.physics import batched as batched_module
from nanobench_tools.physics import machine, numeric, symbolic
from nanobench_tools.physics.batched import batched, scan
from nanobench_tools.physics.rollout import rollout

MODELS = models()


def relative(a, b):
    return np.max(np.abs(a - b) / (1.0 + np.abs(b)), initial=0.0)


@pytest.mark.parametrize("name", MODELS)
def test_rollout_is_that_of_numpy(name):
    model = MODELS[name]
    given = windows(model, 11, 1)
    assert relative(rollout(model, *given), numeric.rollout(model, *given)) < 1e-12


@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 33])
def test_any_number_of_windows(n):
    model = MODELS["all"]
    start, motor, battery, past = windows(model, 33, 3)
    states = rollout(model, start[:n], motor[:n], battery[:n], (past[0][:n], past[1][:n]), threads=2)
    assert states.shape == (n, 21, 17)
    assert np.array_equal(states, rollout(model, start, motor, battery, past)[:n])  # neighbours change nothing


def test_parameters_and_delay_of_each_window():
    """Delays of several whole rows, each window its own."""
    model = MODELS["all"]
    given = windows(model, 5, 3)
    many = np.repeat(model.values[None], 5, axis=0)
    many[:, model.index("command_delay.delay_s")] = [0.0, 0.004, 0.01, 0.027, 0.2]
    many[:, model.index("thrust_scale.s")] = np.linspace(0.8, 1.1, 5)
    states = rollout(model, *given, parameters=many)
    assert relative(states, numeric.rollout(model, *given, parameters=many)) < 1e-12
    for i in range(5):
        one = [x[i:i + 1] for x in given[:3]], tuple(x[i:i + 1] for x in given[3])
        assert relative(states[i:i + 1], numeric.rollout(model.with_values(many[i]), *one[0], one[1])) < 1e-12


def test_no_past_and_given_rotors_and_slower_rows():
    model = MODELS["all"].on(rate_hz=500.0)
    start, motor, battery, _ = windows(model, 4, 3)
    for begin in (start, np.concatenate([start, np.full((4, 4), 0.07)], axis=1)):
        ours = rollout(model, begin, motor, battery, row_hz=100.0)
        assert relative(ours, numeric.rollout(model, begin, motor, battery, row_hz=100.0)) < 1e-12


OPERATIONS = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "neg": lambda a, b: -a, "sq": lambda a, b: a * a, "twice": lambda a, b: a + a, "inv": lambda a, b: 1 / a,
    "sqrt": lambda a, b: ca.sqrt(ca.fabs(a)), "exp": lambda a, b: ca.exp(a), "log": lambda a, b: ca.log(ca.fabs(a)),
    "sin": lambda a, b: ca.sin(a), "cos": lambda a, b: ca.cos(a), "tan": lambda a, b: ca.tan(a),
    "pow": lambda a, b: ca.fabs(a) ** b, "constpow": lambda a, b: ca.fabs(a) ** 2.5,
    "asin": lambda a, b: ca.asin(a / 9),
    "acos": lambda a, b: ca.acos(a / 9), "atan": lambda a, b: ca.atan(a), "atan2": lambda a, b: ca.atan2(a, b),
    "sinh": lambda a, b: ca.sinh(a), "cosh": lambda a, b: ca.cosh(a), "tanh": lambda a, b: ca.tanh(a),
    "erf": lambda a, b: ca.erf(a), "fmod": lambda a, b: ca.fmod(a, b), "hypot": lambda a, b: ca.hypot(a, b),
    "expm1": lambda a, b: ca.expm1(a), "log1p": lambda a, b: ca.log1p(ca.fabs(a)), "floor": lambda a, b: ca.floor(a),
    "ceil": lambda a, b: ca.ceil(a), "fabs": lambda a, b: ca.fabs(a), "sign": lambda a, b: ca.sign(a),
    "copysign": lambda a, b: ca.copysign(a, b), "fmin": lambda a, b: ca.fmin(a, b), "fmax": lambda a, b: ca.fmax(a, b),
    "lt": lambda a, b: (a < b) + 0, "le": lambda a, b: ca.if_else(a <= b, a, 2 * b), "eq": lambda a, b: (a == b) + 0,
    "ne": lambda a, b: ca.if_else(a != b, a, b), "not": lambda a, b: ca.logic_not(a < b) * 3,
    "and": lambda a, b: ca.if_else(ca.logic_and(a > 0, b > 0), a, b),
    "or": lambda a, b: ca.if_else(ca.logic_or(a > 0, b), a, b),
}


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.parametrize("uniform", [(), ("b",), ("a", "b")])
def test_every_operation(name, uniform):
    """Lane by lane, with one argument the same for all, and with both (then everything is one scalar)."""
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    function = ca.Function("f", [a, b, c], [OPERATIONS[name](a, b) + c], ["a", "b", "c"], ["y"])
    rng = np.random.default_rng(1)
    values = rng.normal(0, 2, (3, 13))
    values[:2, 3] = 1.0, 1.0
    for k, key in enumerate("ab"):
        if key in uniform:
            values[k] = values[k, 0]
    given = [v[:1] if key in uniform else v[None] for key, v in zip("abc", values, strict=True)]
    got = batched(function, uniform)(*given)[0][0]
    want = np.array([float(function(*column)) for column in values.T])
    np.testing.assert_allclose(got, want, rtol=1e-13, atol=1e-13)


def test_not_a_number_stays_one():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    both = batched(ca.Function("f", [a, b], [ca.fmin(a, b), ca.fmax(b, a)]))
    for found in both(np.array([[np.nan, 1.0]]), np.array([[1.0, np.nan]])):
        assert np.isnan(found).all()


def test_matrices_and_sparse_outputs():
    m, v = ca.SX.sym("m", 2, 3), ca.SX.sym("v", 3)
    sparse = ca.diag(v)
    function = ca.Function("f", [m, v], [m @ v, sparse, ca.SX(2, 2)], ["m", "v"], ["p", "d", "z"])
    rng = np.random.default_rng(0)
    ms, vs = rng.normal(size=(2, 3, 5)), rng.normal(size=(3, 5))
    product, diagonal, zero = batched(function)(ms, vs)
    np.testing.assert_allclose(product, np.einsum("rcn,cn->rn", ms, vs))
    np.testing.assert_array_equal(diagonal, np.einsum("rc,cn->rcn", np.eye(3), vs))
    assert zero.shape == (2, 2, 5)
    assert not zero.any()


def test_jacobian_of_a_step_compiled():
    model = MODELS["motor_lag"]
    step = symbolic.step(model)
    x, u, p = (ca.SX.sym(k, step.size1_in(i)) for i, k in enumerate("xup"))
    y = step(x, u, p)
    function = ca.Function("j", [x, u, p], [ca.jacobian(y, x), ca.jacobian(y, p)], ["x", "u", "p"], ["A", "B"])
    states, inputs = draw(model, 5, 3)
    found = batched(function, ["p"])(states.T, inputs.T, model.values)
    for i in range(5):
        for ours, theirs in zip(found, function(states[i], inputs[i], model.values), strict=True):
            assert relative(ours[..., i], np.asarray(theirs)) < 1e-11


def test_scan_gives_states_and_other_outputs_of_every_row():
    x, u, g, p = (ca.SX.sym(k) for k in "xugp")
    run = scan(ca.Function("f", [x, u, g, p], [p * x + u, g * x], list("xugp"), ["next", "seen"]), ["u"], ["p"])
    rows = np.array([[[1.0, 2.0]], [[3.0, 4.0]], [[5.0, 6.0]]])
    states, seen = run(np.array([[1.0, -1.0]]), rows, np.array([[10.0, 20.0]]), np.array([2.0]))
    np.testing.assert_array_equal(states[:, 0], [[1, -1], [3, 0], [9, 4], [23, 14]])
    np.testing.assert_array_equal(seen[:, 0], [[10, -20], [30, 0], [90, 80]])
    last, _ = run(np.array([[1.0, -1.0]]), rows, np.array([[10.0, 20.0]]), np.array([2.0]), keep="last")
    np.testing.assert_array_equal(last, [[23, 14]])


def test_wrong_shapes_are_one_line():
    a, b = ca.SX.sym("a", 2), ca.SX.sym("b")
    compiled = batched(ca.Function("f", [a, b], [a * b], ["a", "b"], ["y"]), ["b"])
    for given in ([np.zeros((3, 5)), [1.0]], [np.zeros((2, 5)), [1.0, 2.0]], [np.zeros((2, 5))]):
        with pytest.raises(InputError) as error:
            compiled(*given)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="no input q"):
        batched(ca.Function("f", [a, b], [a * b], ["a", "b"], ["y"]), ["q"])
    model = MODELS["all"]
    start, motor, battery, past = windows(model, 3, 3)
    with pytest.raises(InputError, match="parameters"):
        rollout(model, start, motor, battery, past, parameters=model.values[1:])
    for wrong in ([start[:, :12], motor, battery, past], [start, motor[..., :3], battery, past],
                  [start, motor[:, :0], battery[:, :0], past], [start, motor, battery[:2], past]):
        with pytest.raises(InputError):
            rollout(model, *wrong)


def test_cache_is_used_and_a_damaged_entry_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path))
    a = ca.SX.sym("a")
    text = batched(ca.Function("f", [a], [a * 12345.0])).kernel.text
    machine.load.cache_clear()
    first = machine.object_code(text)
    (entry,) = (tmp_path / "kernels").iterdir()
    assert entry.parent.stat().st_mode & 0o077 == 0
    entry.write_bytes(entry.read_bytes()[:-1])
    assert machine.object_code(text) == first
    assert machine._read(entry) == first
    entry.parent.chmod(0o777)  # others could write there: not trusted any more
    entry.write_bytes(b"")
    assert machine.object_code(text) == first
    assert entry.read_bytes() == b""


@pytest.mark.parametrize("n", [7, 15, 8])
def test_inputs_may_be_transposed_whatever_the_number_of_windows(n):
    """One lane short of a block, a transposed array was once joined to one that runs down its columns."""
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 3)
    f = batched(ca.Function("f", [x, p], [ca.vertcat(p[0] * x[0], p[2] - x[1])], ["x", "p"], ["y"]))
    rng = np.random.default_rng(0)
    states, values = rng.normal(size=(2, n)), rng.normal(size=(n, 3))
    wanted = np.array([values[:, 0] * states[0], values[:, 2] - states[1]])
    np.testing.assert_allclose(f(states, values.T)[0], wanted, rtol=1e-14)


def test_one_file_knows_the_back_end():
    root = Path(batched_module.__file__).parents[2]
    users = [path.relative_to(root).as_posix()
             for top in ("nanobench_tools", "controllers", "identification", "estimators")
             for path in (root / top).rglob("*.py")
             if re.search(r"from \S*\.?(lanes|machine) import|import .*\b(lanes|machine)\b", path.read_text())]
    assert users == ["nanobench_tools/physics/batched.py"]
