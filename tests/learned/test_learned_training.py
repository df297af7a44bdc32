"""Published networks against NumPy, and a training that resumes, repeats itself and refuses what it cannot use."""

import subprocess
import sys
import time
from dataclasses import dataclass

import numpy as np
import pytest

from identification.learned import bar, checkpoints, learned_study
from identification.learned.bar import Left, bars
from identification.learned.learned_study import Wanted, family_parts, trained_rows
from identification.learned.libraries import libraries
from identification.learned.networks import network, physics_step
from identification.learned.published_networks import LearnedPredictor, chunked, task_of, train_row
from identification.learned.training import Settings, train
from identification.learned.training_rows import Rows, rows_of, unwrapped
from identification.naive import Naive
from identification.published_physics import PublishedPhysics
from nanobench_tools import so3
from nanobench_tools.errors import InputError, MissingExtraError, UsageError
from nanobench_tools.protocols.windows import HORIZON, cut_windows

QUICK = Settings(epochs=4, batch=64, share=0.2)


@pytest.fixture(scope="module")
def rows(cases):
    return rows_of(cases)


def untrained(kind, rows, voltage=False):
    scaling = rows.scaling()
    scaling = scaling if voltage else (*scaling[:2], scaling[2][:4], scaling[3][:4])
    made = network(kind, voltage, scaling, 3)
    return made, scaling


def sigmoid(x):
    return 1.0 / (1.0 + np.exp(-x))


def test_residual_mlp_is_five_layers_of_64_that_change_the_state(rows):
    made, _ = untrained("residual_mlp", rows)
    layers = [(np.asarray(layer.weight), np.asarray(layer.bias)) for layer in made.mlp.layers]
    assert [w.shape for w, _ in layers] == [(64, 16), *[(64, 64)] * 4, (12, 64)]
    rng = np.random.default_rng(0)
    x, u = rng.normal(size=(3, 12)), rng.normal(size=(3, 7, 4))
    found = np.asarray(made.roll(x.astype(np.float32), u.astype(np.float32)))
    for k in range(7):
        hidden = np.concatenate([x, u[:, k]], axis=1)
        for w, b in layers[:-1]:
            hidden = np.maximum(hidden @ w.T + b, 0.0)
        x = x + hidden @ layers[-1][0].T + layers[-1][1]
        np.testing.assert_allclose(found[:, k], x, atol=2e-5)


def test_lstm_equations(rows):
    made, _ = untrained("lstm", rows)
    w_in, w_hidden, bias = (np.asarray(a) for a in (made.cell.weight_ih, made.cell.weight_hh, made.cell.bias))
    assert w_hidden.shape == (4 * 64, 64)
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=(2, 12)), rng.normal(size=(2, 5, 4))
    found = np.asarray(made.roll(x.astype(np.float32), u.astype(np.float32)))
    hidden, memory = (np.tanh(x @ np.asarray(part.weight).T + np.asarray(part.bias))
                      for part in (made.hidden, made.memory))
    for k in range(5):
        forgotten = u[:, k] @ w_in.T + hidden @ w_hidden.T + bias
        enter, forget, cell, leave = np.split(forgotten, 4, axis=1)
        memory = sigmoid(forget) * memory + sigmoid(enter) * np.tanh(cell)
        hidden = sigmoid(leave) * np.tanh(memory)
        x = x + hidden @ np.asarray(made.out.weight).T + np.asarray(made.out.bias)
        np.testing.assert_allclose(found[:, k], x, atol=2e-5)


def test_physics_part_is_the_published_row(cases, rows):
    windows, _ = cut_windows(cases[0].flight, cases[0].spans, "onboard")
    made, scaling = untrained("physics_residual", rows)
    leaves = [np.zeros_like(leaf) for leaf in libraries().jax.tree.leaves(made) if hasattr(leaf, "shape")]
    found = LearnedPredictor("x", "physics_residual", False, tuple(leaves), scaling).predict(windows)
    wanted = PublishedPhysics().predict(windows)
    np.testing.assert_allclose(found.position_m, wanted.position_m, atol=2e-4)
    np.testing.assert_allclose(found.velocity_m_s, wanted.velocity_m_s, atol=2e-4)
    np.testing.assert_allclose(found.rate_rad_s, wanted.rate_rad_s, atol=1e-5)
    assert so3.geodesic_angle(found.quaternion, wanted.quaternion).max() < 2e-4


def test_physics_step_keeps_its_slope_at_rest():
    jax, jnp = libraries().jax, libraries().jnp
    slope = jax.jacobian(lambda x: physics_step(jnp, x[None], jnp.full((1, 4), 0.7))[0])(jnp.zeros(12))
    assert np.isfinite(np.asarray(slope)).all()
    np.testing.assert_allclose(np.asarray(slope)[6:9, 6:9], np.eye(3), atol=1e-6)


def test_gradient_is_that_of_finite_differences(rows):
    jax = libraries().jax
    task, _ = task_of("lstm", True, rows, 0)
    starts = np.asarray(rows.train[::97])
    eqx = libraries().eqx
    weights, fixed = eqx.partition(task.network, eqx.is_inexact_array)
    leaves, shape = jax.tree.flatten(weights)

    def loss(leaves):
        return task.loss(eqx.combine(jax.tree.unflatten(shape, leaves), fixed), task.data, starts)

    value, slopes = jax.jit(jax.value_and_grad(loss))(leaves)
    direction = [np.sign(np.asarray(s)) for s in slopes]
    step = 1e-5
    ends = [float(jax.jit(loss)([a + sign * step * d for a, d in zip(leaves, direction, strict=True)]))
            for sign in (-1.0, 1.0)]
    steepness = sum(float(np.abs(s).sum()) for s in slopes)
    assert (ends[1] - ends[0]) / (2.0 * step) == pytest.approx(steepness, rel=0.05)
    assert float(value) > 0.0


def test_windows_stay_on_their_side_of_the_cut(cases):
    rows = rows_of(cases)
    for number in range(len(cases)):
        mine = np.flatnonzero(rows.flight == number)
        cut = mine[0] + round(0.8 * len(mine))
        train, valid = (part[rows.flight[part] == number] for part in (rows.train, rows.valid))
        assert train.min() == mine[0]
        assert train.max() + HORIZON == cut - 1
        assert valid.min() == cut
        assert valid.max() + HORIZON <= mine[-1]
    assert rows.sha256 == rows_of(cases).sha256 != rows_of(cases[:2]).sha256


def test_rotation_vectors_do_not_jump():
    yaw = np.linspace(0.0, 5.0, 200)
    vector = so3.log(so3.from_euler_zyx(0.0 * yaw + 0.1, 0.0 * yaw, yaw))
    smooth = unwrapped(vector, [200])
    assert np.abs(np.diff(smooth, axis=0)).max() < 0.1
    assert so3.geodesic_angle(so3.exp(smooth), so3.exp(vector)).max() < 1e-9


@pytest.mark.slow
def test_killed_training_goes_on_as_if_it_had_not_been(rows, tmp_path, monkeypatch):
    task, _ = task_of("residual_mlp", False, rows, 0)
    whole = train(task, QUICK)
    path = tmp_path / "mlp.safetensors"
    real, written = checkpoints.write, []

    def killed(*args):
        real(*args)
        written.append(args)
        if len(written) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints, "write", killed)
        with pytest.raises(KeyboardInterrupt):
            train(task, QUICK, path, every_s=-1.0)
    resumed = train(task, QUICK, path)
    assert resumed.begun == 2
    for a, b in zip(whole.leaves, resumed.leaves, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(whole.history, resumed.history)
    assert train(task, QUICK, path).begun == QUICK.epochs


@pytest.mark.slow
def test_seed_decides(rows):
    runs = [train(task_of("residual_mlp", False, rows, seed)[0], Settings(1, 64, share=0.1, seed=seed)).history
            for seed in (0, 0, 1)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.abs(runs[0] - runs[2]).max() > 1e-6


def test_training_that_makes_nothing_better_is_no_row(rows):
    steep = Settings(2, 64, learning_rate=30.0, share=0.1)
    with pytest.raises(InputError, match=r"never got better than untrained|is not a number"):
        train_row("residual_mlp", False, rows, steep, None)


def test_what_is_no_checkpoint_of_this_is_one_line(rows, tmp_path):
    task, _ = task_of("residual_mlp", False, rows, 0)
    path = tmp_path / "mlp.safetensors"
    once = Settings(1, 64, share=0.1)
    train(task, once, path)
    whole = path.read_bytes()
    header = checkpoints.read(path).header
    assert header["data_sha256"] == rows.sha256
    assert header["architecture"] == {"kind": "residual_mlp", "inputs": 4, "width": 64, "depth": 5}
    other = Rows(rows.state + 1.0, rows.inputs, rows.train, rows.valid, rows.flight, rows.names)
    for wrong, says in ((task_of("lstm", False, rows, 0)[0], "another architecture"),
                        (task_of("residual_mlp", False, other, 0)[0], "another data sha256")):
        with pytest.raises(InputError, match=says):
            train(wrong, once, path)
    with pytest.raises(InputError, match="another settings"):
        train(task, Settings(2, 64, share=0.1), path)
    flipped = bytearray(whole)
    flipped[-5] ^= 1
    for broken in (whole[:-100], whole[:4], b"", b"nonsense" * 100, bytes(flipped)):
        path.write_bytes(broken)
        with pytest.raises(InputError, match="is no whole checkpoint") as caught:
            train(task, once, path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


def test_loss_that_is_no_number_is_no_row(cases, rows, tmp_path):
    state = rows.state.copy()
    state[rows.train[5]] = np.nan
    bad = Rows(state, rows.inputs, rows.train, rows.valid, rows.flight, rows.names)
    bad = Rows(np.where(np.isnan(state), np.inf, state), *(getattr(bad, n) for n in (
        "inputs", "train", "valid", "flight", "names")))
    with np.errstate(invalid="ignore"), pytest.raises(InputError, match="is not a number in epoch 1"):
        train_row("residual_mlp", False, bad, QUICK, None)


@pytest.mark.slow
def test_what_cannot_be_trained_is_a_failure_and_the_others_go_on(cases, tmp_path):
    said = []
    (tmp_path / "physics_residual.safetensors").write_bytes(b"torn")
    found, failed = trained_rows(cases, Wanted(epochs=30, voltage=False, own=False), tmp_path, {}, None, True,
                                 said.append)
    assert [p.name for p in found] == ["residual_mlp", "lstm"]
    assert [f["item"] for f in failed] == ["train physics_residual"]
    assert said[0].startswith("residual_mlp: 30 epochs, ")


def together(cases, folder, jobs):
    found, failed = trained_rows(cases, Wanted(epochs=30, voltage=False), folder, {"fit_balanced": Still()}, still,
                                 True, lambda line: None, jobs)
    assert not failed
    return {p.name: p for p in found}


@dataclass(frozen=True)
class Still(Naive):
    """Stands still; needs no fit."""


def still(rung, sets):
    return [Still() for _ in sets]


@pytest.mark.slow
def test_rows_trained_side_by_side_are_those_trained_in_turn_and_go_on_when_killed(cases, tmp_path, monkeypatch):
    monkeypatch.setattr(learned_study, "SETTINGS", Settings(epochs=2, batch=64, share=0.5))
    monkeypatch.setattr(learned_study, "KINDS", ("lstm",))
    kill_after_one_epoch(rows_of(cases[:2]), tmp_path / "2", monkeypatch)
    alone, beside = (together(cases[:2], tmp_path / str(jobs), jobs) for jobs in (1, 2))
    assert list(alone) == list(beside) == ["lstm", "physics_network"]
    for name, one in alone.items():
        for a, b in zip(*(jax_leaves(p) for p in (one, beside[name])), strict=True):
            np.testing.assert_array_equal(a, b)
        assert one.trained == beside[name].trained


def kill_after_one_epoch(rows, folder, monkeypatch):
    """Leaves a checkpoint of the LSTM behind."""
    real = checkpoints.write

    def killed(*args):
        real(*args)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints, "write", killed)
        with pytest.raises(KeyboardInterrupt):
            train(task_of("lstm", False, rows, 0)[0], Settings(epochs=30), folder / "lstm.safetensors", every_s=-1.0)
    assert len(checkpoints.read(folder / "lstm.safetensors").tensors["history"]) == 1


def test_time_left_of_trainings_side_by_side():
    """Two of three run: 1 s and 3 s an epoch, ten epochs each; the third is taken to need 2 s."""
    left = Left({"a": 10, "b": 10, "c": 10}, 2)
    assert left({"a": (1, 0.5, 0.6), "b": (1, 0.5, 0.6)}, 100.0) is None
    found = left({"a": (4, 0.5, 0.6), "b": (2, 0.5, 0.6)}, 103.0)
    assert found == pytest.approx((6 * 1.0 + 8 * 3.0 + 10 * 2.0) / 2)
    assert left({"a": (10, 0, 0), "b": (10, 0, 0), "c": (9, 0, 0)}, 130.0) == pytest.approx(2.0)
    alone = Left({"a": 10}, 4)
    alone({"a": (5, 0, 0)}, 0.0)  # a checkpoint held the first five
    assert alone({"a": (6, 0, 0)}, 2.0) == pytest.approx(8.0)


def test_one_line_tells_of_all_that_train(monkeypatch, capsys):
    monkeypatch.setattr(bar, "PERIOD_S", 0.0)
    with bars({"lstm": 10, "mlp": 5}, 2) as step:
        step({"lstm": (1, 0.5, 0.6)})
        time.sleep(0.01)
        step({"lstm": (2, 0.4, 0.51), "mlp": (5, 0.1, 0.2)})
    line = capsys.readouterr().err
    assert line.startswith("lstm epoch 2 of 10, loss 0.4 (validation 0.51); 1 of 2 trained, about 0:0")
    assert line.count("\n") == 1


def jax_leaves(predictor):
    return predictor.leaves if hasattr(predictor, "leaves") else [a for net in predictor.networks for a in net]


def test_predictor_takes_any_number_of_windows_and_nothing_but_start_and_inputs(cases, rows):
    made, _ = train_row("lstm", True, rows, Settings(2, 32, share=1.0), None)
    windows, came = cut_windows(cases[2].flight, cases[2].spans, "mocap")
    found = made.predict(windows)
    assert found.position_m.shape == came.position_m.shape
    np.testing.assert_allclose(np.linalg.norm(found.quaternion, axis=2), 1.0, atol=1e-9)
    assert made.name == "lstm_voltage"
    np.testing.assert_array_equal(chunked(lambda a: a * 2.0, np.arange(1300.0)), 2.0 * np.arange(1300.0))


def test_bad_settings_and_flights(flights, cases):
    with pytest.raises(UsageError, match="at least 1"):
        Settings(epochs=0)
    with pytest.raises(UsageError, match="unknown network 'gru'"):
        network("gru", False, (), 0)
    with pytest.raises(InputError, match="no window of 50 rows to train on is left in 0 flights"):
        rows_of([])
    with pytest.raises(InputError, match="none is left after the audit"):
        trained_rows([], Wanted(), None, {}, None)

    with pytest.raises(InputError, match="no recording of 'multisine'"):
        family_parts(flights, "multisine")
    assert [len(part) for part in family_parts(flights, "helix")] == [1, 2]


def test_without_published_rows_and_physics_nothing_is_trained(cases, tmp_path):
    assert trained_rows(cases, Wanted(published=False), tmp_path, {}, None) == ([], [])
    assert not list(tmp_path.iterdir())


def test_without_jax_one_line_says_what_to_install(monkeypatch):
    libraries.cache_clear()
    monkeypatch.setitem(sys.modules, "equinox", None)
    with pytest.raises(MissingExtraError, match=r'pip install .*\[learned\]"'):
        libraries()
    libraries.cache_clear()


def test_nothing_loads_jax_by_itself():
    code = ("import sys, identification.learned.learned_study, controllers.learned.pilots, nanobench_tools.cli.sysid\n"
            "sys.exit('jax' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
