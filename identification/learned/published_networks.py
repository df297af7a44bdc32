"""The published rows of Task 1 trained, and as predictors: ``residual_mlp``, ``physics_residual``, ``lstm``."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools import so3
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.protocols.windows import HORIZON
from nanobench_tools.results.result import Result

from .bar import Step
from .libraries import Array, libraries
from .networks import DEPTH, KINDS, WIDTH, network
from .training import Settings, Task, Trained, filled, train
from .training_rows import Rows, rows_of

FADING = 0.1
"""Errors k steps after the start count exp(-FADING k) (published)."""
CHUNK = 512
"""Windows that are predicted at once: one compiled shape for any number of windows."""


@dataclass(frozen=True, repr=False)
class Lessons(Result):
    """What a network learnt from and how far: loss and validation loss (epochs, 2)."""

    epochs: int
    best_epoch: int
    validation_loss: float
    data_sha256: str
    flights: int
    windows: int
    history: Sequence[Sequence[float]]


@dataclass(frozen=True)
class LearnedPredictor:
    """A trained network as a predictor. leaves: its numbers; scaling: mean, spread of states, mean, spread of
    inputs."""

    name: str
    kind: str
    voltage: bool
    leaves: tuple[np.ndarray, ...]
    scaling: tuple[np.ndarray, ...]
    information: str = "state"
    trained: Lessons | None = None

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        mean, spread, u_mean, u_spread = self.scaling
        state = np.concatenate([windows.position_m, windows.velocity_m_s, so3.log(windows.quaternion),
                                windows.rate_rad_s], axis=1)
        given = np.concatenate([windows.motor, windows.battery_V[..., None]], axis=2)[..., :len(u_mean)]
        start = ((state - mean) / spread).astype(np.float32)
        inputs = ((given - u_mean) / u_spread).astype(np.float32)
        run = _compiled(self.kind, self.voltage, tuple(tuple(np.asarray(v, float).tolist()) for v in self.scaling))
        found = chunked(lambda s, u: run(list(self.leaves), s, u), start, inputs)
        states = found.astype(float) * spread + mean
        return Prediction(states[..., :3], states[..., 3:6], so3.exp(states[..., 6:9]), states[..., 9:])


def chunked(run: Any, *arrays: np.ndarray) -> np.ndarray:
    """``run`` on CHUNK rows at a time, the last ones filled up with zeros."""
    n, out = len(arrays[0]), []
    for first in range(0, n, CHUNK):
        parts = [a[first:first + CHUNK] for a in arrays]
        rows = len(parts[0])
        filled_up = [np.concatenate([p, np.zeros((CHUNK - rows, *p.shape[1:]), p.dtype)]) for p in parts]
        out.append(np.asarray(run(*filled_up))[:rows])
    return np.concatenate(out)


@functools.lru_cache(maxsize=16)
def _compiled(kind: str, voltage: bool, scaling: tuple[tuple[float, ...], ...]) -> Any:
    made = network(kind, voltage, tuple(np.array(v) for v in scaling), 0)
    return libraries().jax.jit(lambda leaves, start, inputs: filled(made, leaves).roll(start, inputs))


def row_name(kind: str, voltage: bool) -> str:
    """Name of a row.

    >>> row_name("lstm", True)
    'lstm_voltage'
    """
    return f"{kind}_voltage" if voltage else kind


def _scaling(rows: Rows, voltage: bool) -> tuple[np.ndarray, ...]:
    found = rows.scaling()
    return found if voltage else (*found[:2], found[2][:4], found[3][:4])


def task_of(kind: str, voltage: bool, rows: Rows, seed: int) -> tuple[Task, tuple[np.ndarray, ...]]:
    """(task, scaling) of a published row."""
    jnp = libraries().jnp
    scaling = _scaling(rows, voltage)
    mean, spread, u_mean, u_spread = scaling
    data = {"x": jnp.asarray((rows.state - mean) / spread), "u": jnp.asarray(
        (rows.inputs[:, :len(u_mean)] - u_mean) / u_spread)}
    weights = np.exp(-FADING * np.arange(1, HORIZON + 1)).astype(np.float32)
    weights = jnp.asarray(weights / weights.sum())

    def loss(net: Any, data: Mapping[str, Array], starts: Array) -> Array:
        at = starts[:, None] + jnp.arange(HORIZON)
        error = net.roll(data["x"][starts], data["u"][at]) - data["x"][at + 1]
        return jnp.mean(jnp.mean(error**2, axis=2) @ weights)

    name = row_name(kind, voltage)
    architecture = {"kind": kind, "inputs": len(u_mean), "width": WIDTH, "depth": 1 if kind == "lstm" else DEPTH}
    return Task(name, network(kind, voltage, scaling, seed), data, loss, rows.train, rows.valid,
                {"architecture": architecture, "data_sha256": rows.sha256, "flights": list(rows.names)}), scaling


def train_row(kind: str, voltage: bool, cases: Sequence[Case] | Rows, settings: Settings, folder: Path | None,
              quiet: bool = True) -> tuple[LearnedPredictor, Trained]:
    """A published row, trained on whole flights (their last fifth validates). ``folder``: where its checkpoint is.

    Raises InputError as ``train`` and ``rows_of`` do.
    """
    rows = cases if isinstance(cases, Rows) else rows_of(cases)
    found = train_network(kind, voltage, rows, settings, folder, quiet)
    return predictor_of(kind, voltage, rows, found), found


def train_network(kind: str, voltage: bool, rows: Rows, settings: Settings, folder: Path | None, quiet: bool = True,
                  report: Step | None = None) -> Trained:
    """The training of a published row, or what a checkpoint in ``folder`` holds of it."""
    task, _ = task_of(kind, voltage, rows, settings.seed)
    path = None if folder is None else Path(folder) / f"{task.label}.safetensors"
    return train(task, settings, path, quiet, report=report)


def predictor_of(kind: str, voltage: bool, rows: Rows, found: Trained) -> LearnedPredictor:
    """The row of a training. InputError when it is worth none."""
    name = row_name(kind, voltage)
    found.worth_a_row(name)
    about = Lessons(len(found.history), found.best, float(found.history[:, 1].min()), rows.sha256, len(rows.names),
                    len(rows.train), found.history.tolist())
    scaling = tuple(np.asarray(v, float) for v in _scaling(rows, voltage))
    return LearnedPredictor(name, kind, voltage, tuple(found.leaves), scaling, trained=about)


__all__ = ["CHUNK", "KINDS", "LearnedPredictor", "predictor_of", "row_name", "task_of", "train_network", "train_row"]
