"""Cloned policies and learned dynamics: networks, what they are trained to do, and how they are kept.

Published ("NanoBench", arXiv 2603.09908, and its released code):

- a policy of two layers of 32 with tanh;
- an LSTM over the last 20 observations with a head of 64 that ends in a sigmoid. Theirs has two layers of 128, ours
  one of 64: a tenth of the work on a processor;
- dynamics of three layers of 256 with ReLU that give the change of the scaled observation, trained with noise on the
  commands.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from identification.learned.libraries import Array, libraries
from identification.learned.training import Settings, Task, filled, train
from nanobench_tools.errors import UsageError
from nanobench_tools.settings import setting

from .demonstrations import OBSERVED, STATE, Demonstration, Shown

KINDS = ("bc_mlp", "bc_lstm", "dynamics")
SEEN = 20
"""Observations that the recurrent policy looks at."""
COMMAND_NOISE = setting("control.policies.command_noise")
TRAINING: dict[str, Any] = setting("control.policies.training")
SETTINGS = {kind: Settings(**entry) for kind, entry in TRAINING.items()}


@dataclass(frozen=True)
class Network:
    """A trained network: kind of KINDS; leaves its numbers; mean, spread (14,) of observations."""

    kind: str
    leaves: tuple[np.ndarray, ...]
    mean: np.ndarray
    spread: np.ndarray
    trained: dict[str, Any] = field(default_factory=dict)


@functools.cache
def modules() -> SimpleNamespace:
    """{bc_mlp, bc_lstm, dynamics}: network classes, called with scaled observations."""
    with_jax = libraries()
    jax, jnp, eqx, lax = with_jax.jax, with_jax.jnp, with_jax.eqx, with_jax.lax

    class BcMlp(eqx.Module):  # type: ignore[name-defined, misc]
        """(n, 14) -> (n, 4)."""

        mlp: Any

        def __init__(self, key: Any) -> None:
            self.mlp = eqx.nn.MLP(OBSERVED, 4, 32, 2, jnp.tanh, key=key)

        def __call__(self, observed: Array) -> Array:
            return jnp.clip(jax.vmap(self.mlp)(observed) + 0.8, -1.0, 2.0)

    class BcLstm(eqx.Module):  # type: ignore[name-defined, misc]
        """(n, SEEN, 14) -> (n, 4)."""

        cell: Any
        head: Any

        def __init__(self, key: Any) -> None:
            first, second = jax.random.split(key)
            self.cell = eqx.nn.LSTMCell(OBSERVED, 64, key=first)
            self.head = eqx.nn.MLP(64, 4, 64, 1, jax.nn.relu, key=second)

        def __call__(self, observed: Array) -> Array:
            zero = jnp.zeros((len(observed), 64))

            def step(state: Array, seen: Array) -> tuple[Array, None]:
                return jax.vmap(self.cell)(seen, state), None

            (hidden, _), _ = lax.scan(step, (zero, zero), observed.swapaxes(0, 1))
            return jax.nn.sigmoid(jax.vmap(self.head)(hidden))

    class Dynamics(eqx.Module):  # type: ignore[name-defined, misc]
        """(n, 14), (n, 4) -> change (n, STATE) of the scaled observation in 10 ms."""

        mlp: Any

        def __init__(self, key: Any) -> None:
            self.mlp = eqx.nn.MLP(OBSERVED + 4, STATE, 256, 3, jax.nn.relu, key=key)

        def __call__(self, observed: Array, action: Array) -> Array:
            return jax.vmap(self.mlp)(jnp.concatenate([observed, action], axis=1)) * 0.1

    return SimpleNamespace(bc_mlp=BcMlp, bc_lstm=BcLstm, dynamics=Dynamics)


def fresh(kind: str, seed: int = 0) -> Any:
    """An untrained network. UsageError for an unknown kind."""
    if kind not in KINDS:
        raise UsageError(f"unknown network {kind!r}; known: {', '.join(KINDS)}")
    return getattr(modules(), kind)(libraries().jax.random.key(seed))


def restored(network: Network) -> Any:
    """The network as something that can be called."""
    return filled(fresh(network.kind), list(network.leaves))


def task_of(kind: str, shown: Shown, seed: int, mean: np.ndarray, spread: np.ndarray,
            extra: Sequence[Demonstration] = ()) -> Task:
    """Training task of ``kind``: data from ``shown`` with the ``extra`` flights added, network and loss."""
    with_jax = libraries()
    jax, jnp = with_jax.jax, with_jax.jnp
    flights = [*shown.train, *extra, *shown.valid]
    before = SEEN - 1 if kind == "bc_lstm" else 0
    after = 1 if kind == "dynamics" else 0
    starts: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    at = 0
    for number, flight in enumerate(flights):
        mine = starts[number >= len(shown.train) + len(extra)]
        for length in flight.lengths:
            mine.append(np.arange(at + before, at + length - after, dtype=np.int32))
            at += length
    observed = np.concatenate([d.observed for d in flights])
    data = {"x": jnp.asarray((observed - mean) / spread, jnp.float32),
            "u": jnp.asarray(np.concatenate([d.action for d in flights]))}

    def clone(net: Any, data: Mapping[str, Array], rows: Array) -> Array:
        seen = data["x"][rows] if kind == "bc_mlp" else data["x"][rows[:, None] + jnp.arange(-before, 1)]
        return jnp.mean((net(seen) - data["u"][rows]) ** 2)

    def change(net: Any, data: Mapping[str, Array], rows: Array, noise: Array | float = 0.0) -> Array:
        error = net(data["x"][rows], jnp.clip(data["u"][rows] + noise, 0.0, 1.0))
        return jnp.mean((error - (data["x"][rows + 1] - data["x"][rows])[:, :STATE]) ** 2)

    def noisy(net: Any, data: Mapping[str, Array], rows: Array) -> Array:
        key = jax.random.fold_in(jax.random.key(seed), jnp.sum(rows))
        return change(net, data, rows, COMMAND_NOISE * jax.random.normal(key, (len(rows), 4)))

    valid = np.concatenate(starts[1])[::5]
    return Task(kind, fresh(kind, seed), data, clone if kind != "dynamics" else noisy, np.concatenate(starts[0]), valid,
                {"architecture": {"kind": kind, "observed": OBSERVED, "seen": SEEN}, "data_sha256": _hash(shown, extra),
                 "flights": [d.name for d in flights]}, clone if kind != "dynamics" else change)


def _hash(shown: Shown, extra: Sequence[Demonstration]) -> str:
    return replace(shown, train=[*shown.train, *extra]).sha256


def trained(kind: str, shown: Shown, settings: Settings | None = None, folder: Path | None = None, quiet: bool = True,
            extra: Sequence[Demonstration] = (), name: str = "") -> Network:
    """A network trained on whole flights; stops where the validation flights are best. Raises InputError."""
    settings = settings or SETTINGS[kind]
    rows = np.concatenate([d.observed for d in shown.train])
    mean, spread = rows.mean(axis=0), np.maximum(rows.std(axis=0), 1e-3)
    task = task_of(kind, shown, settings.seed, mean, spread, extra)
    label = name or kind
    path = None if folder is None else Path(folder) / f"{label}.safetensors"
    found = train(replace(task, label=label), settings, path, quiet).worth_a_row(label)
    return Network(kind, tuple(found.leaves), mean, spread,
                   {"epochs": len(found.history), "best_epoch": found.best,
                    "validation_loss": float(found.history[:, 1].min()), "flights": len(shown.train),
                    "history": found.history.tolist()})


def commands(network: Network, flight: Demonstration) -> np.ndarray:
    """(m, 4) PWM ratios that a policy would have commanded along the longest stretch of a flight as it was flown."""
    seen = (flight.observed[flight.longest] - network.mean) / network.spread
    if network.kind == "bc_lstm":
        rows = np.maximum(np.arange(len(seen))[:, None] + np.arange(1 - SEEN, 1), 0)
        seen = seen[rows]
    made = restored(network)
    ratios = np.asarray(libraries().jax.jit(lambda rows: made(rows))(seen.astype(np.float32)))
    return np.asarray(np.clip(ratios, 0.0, 1.0))
