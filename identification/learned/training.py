"""One training loop for every network here: Adam with a cosine schedule, resumable, the same for the same seed.

An epoch draws its windows anew from (seed, epoch) alone, so a training that was killed goes on as if it had not been.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError, UsageError

from . import checkpoints
from .bar import Step, bar
from .libraries import Array, libraries, platform


@dataclass(frozen=True)
class Settings:
    """share: of all starts that an epoch draws, without repetition (neighbouring windows hold nearly the same rows).

    learning_rate falls along a cosine to final_share of itself. Gradients longer than clip are shortened."""

    epochs: int = 500
    batch: int = 256
    learning_rate: float = 1e-3
    final_share: float = 0.01
    share: float = 0.1
    clip: float = 1.0
    decay: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.epochs < 1 or self.batch < 1:
            raise UsageError(f"{self.epochs} epochs of batches of {self.batch}: both have to be at least 1")


@dataclass(frozen=True)
class Task:
    """Training task. ``data``: arrays on the device; loss(network, data, starts (b,)) -> mean loss of the windows
    there; ``train``, ``valid``: their starts. ``identity``: {architecture, data_sha256, ...}, what a checkpoint has to
    agree with. ``judge``: the loss that validates, if it is another."""

    label: str
    network: Any
    data: Any
    loss: Callable[[Any, Any, Any], Any]
    train: np.ndarray
    valid: np.ndarray
    identity: dict[str, Any]
    judge: Callable[[Any, Any, Any], Any] | None = None


@dataclass(frozen=True)
class Trained:
    """``leaves``: arrays of the network with the least validation loss, which was that of epoch ``best``; ``history``
    (epochs, 2): loss and validation loss; ``seconds``, ``processor_s``: of this call, by the clock and on the
    processor; ``begun``: epochs that an earlier one had done; ``untrained``: the validation loss before the first."""

    leaves: list[np.ndarray]
    history: np.ndarray
    best: int
    seconds: float
    processor_s: float
    begun: int
    untrained: float

    @staticmethod
    def of(value: Mapping[str, Any]) -> Trained:
        """From what ``asdict`` gives and a result file keeps: lists for arrays. Numbers of networks are float32."""
        found = Trained(**value)
        return replace(found, leaves=[np.asarray(leaf, np.float32) for leaf in found.leaves],
                       history=np.asarray(found.history, float).reshape(-1, 2))

    def worth_a_row(self, label: str) -> Trained:
        """Itself. InputError when training never made validation better than none: that is no row."""
        best = float(self.history[:, 1].min())
        if not best < self.untrained:
            raise InputError(f"training {label}", f"validation ({best:.3g}) never got better than untrained "
                             f"({self.untrained:.3g}) in {len(self.history)} epochs",
                             "no row; try a lower learning rate")
        return self


def train(task: Task, settings: Settings, path: Path | None = None, quiet: bool = True,
          every_s: float = 20.0, report: Step | None = None) -> Trained:
    """Trains, or goes on from the checkpoint at ``path`` (written every ``every_s`` seconds and at the end).
    ``report`` is called after every epoch, in place of a bar.

    Raises InputError for a loss that is not a number and for a checkpoint of something else.
    """
    with_jax = libraries()
    jax, jnp, eqx, optax = with_jax.jax, with_jax.jnp, with_jax.eqx, with_jax.optax
    steps = max(1, int(len(task.train) * settings.share) // settings.batch)
    schedule = optax.cosine_decay_schedule(settings.learning_rate, settings.epochs * steps, settings.final_share)
    optimiser = optax.chain(optax.clip_by_global_norm(settings.clip),
                            optax.adamw(schedule, weight_decay=settings.decay))
    weights, fixed = eqx.partition(task.network, eqx.is_inexact_array)
    state = optimiser.init(weights)
    identity = {**task.identity, "settings": asdict(settings)}

    def loss_of(weights: Any, data: Mapping[str, Array], starts: Array) -> Array:
        return task.loss(eqx.combine(weights, fixed), data, starts)

    @jax.jit  # type: ignore[untyped-decorator]
    def epoch_of(weights: Any, state: Any, data: Mapping[str, Array], batches: Array) -> tuple[Any, Any, Array]:
        def step(carry: Array, starts: Array) -> tuple[Array, Array]:
            weights, state = carry
            loss, slope = jax.value_and_grad(loss_of)(weights, data, starts)
            change, state = optimiser.update(slope, state, weights)
            return (optax.apply_updates(weights, change), state), loss

        (weights, state), losses = with_jax.lax.scan(step, (weights, state), batches)
        return weights, state, losses.mean()

    judged = task.judge or task.loss
    judge = jax.jit(lambda weights, data, starts: judged(eqx.combine(weights, fixed), data, starts))
    best, best_loss, history, begun = weights, np.inf, np.zeros((0, 2)), 0
    if path is not None and Path(path).exists():
        found = checkpoints.read(path)
        checkpoints.check(found, path, identity)
        weights, state, best = (_like(tree, found.part(name), path) for tree, name in
                                ((weights, "weights"), (state, "state"), (best, "best")))
        history, begun = found.tensors["history"], len(found.tensors["history"])
        best_loss = float(history[:, 1].min()) if begun else np.inf
    started = written = time.monotonic()
    worked = time.process_time()
    valid = jnp.asarray(task.valid)
    with nullcontext(report) if report else bar(task.label, settings.epochs, quiet, begun) as shown:
        for epoch in range(begun, settings.epochs):
            drawn = np.random.default_rng([settings.seed, epoch]).permutation(task.train)
            size = min(settings.batch, len(drawn))
            batches = drawn[:steps * size].reshape(-1, size)
            weights, state, loss = epoch_of(weights, state, task.data, jnp.asarray(batches))
            losses = np.array([float(loss), float(judge(weights, task.data, valid))])
            if not np.isfinite(losses).all():
                which = "validation loss" if np.isfinite(losses[0]) else "loss"
                raise InputError(f"training {task.label}", f"the {which} is not a number in epoch {epoch + 1}",
                                 "no row; try a lower learning rate")
            history = np.concatenate([history, losses[None]])
            if losses[1] < best_loss:
                best, best_loss = weights, losses[1]
            shown(epoch + 1, *losses)
            last = epoch + 1 == settings.epochs
            if path is not None and (last or time.monotonic() - written > every_s):
                checkpoints.write(path, {name: _leaves(tree) for name, tree in (
                    ("weights", weights), ("state", state), ("best", best))} | {"history": history},
                    {**identity, "platform": platform()})
                written = time.monotonic()
    untrained = float(judge(eqx.partition(task.network, eqx.is_inexact_array)[0], task.data, valid))
    return Trained(_leaves(best), history, int(np.argmin(history[:, 1])) + 1, time.monotonic() - started,
                   time.process_time() - worked, begun, untrained)


def _leaves(tree: Any) -> list[np.ndarray]:
    return [np.asarray(leaf) for leaf in libraries().jax.tree.leaves(tree)]


def _like(tree: Any, leaves: list[np.ndarray], path: Any) -> Any:
    jax, jnp = libraries().jax, libraries().jnp
    wanted, shape = jax.tree.flatten(tree)
    if [np.shape(a) for a in wanted] != [np.shape(b) for b in leaves]:
        raise InputError(str(path), "holds tensors of another architecture", "remove it to train again")
    return jax.tree.unflatten(shape, [jnp.asarray(b, getattr(a, "dtype", None)) for a, b in zip(wanted, leaves,
                                                                                                 strict=True)])


def filled(network: Any, leaves: list[np.ndarray], place: str = "checkpoint") -> Any:
    """``network`` with its numbers replaced by ``leaves``."""
    eqx = libraries().eqx
    weights, fixed = eqx.partition(network, eqx.is_inexact_array)
    return eqx.combine(_like(weights, leaves, place), fixed)
