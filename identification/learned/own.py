"""Our row: identified physics and a small network that corrects it, never worse than the physics on flights held out.

Training flights are held out in groups. Physics fitted to the other groups predicts every flight, so that the network
learns errors as flights show them that no fit has seen. One network per group is trained on the others and stops where
the group itself is predicted best; a prediction takes the mean of them. Their corrections are applied with a share for
each quantity, 0 to 1, reached at once or over a few steps. With this share, no error of the flights held out, after 1,
10 or 50 steps or summed, is above the physics'.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Span
from nanobench_tools.methods import Prediction, Predictor, Windows
from nanobench_tools.metrics.prediction import HORIZONS, QUANTITIES, window_errors
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.protocols.windows import EVERY, RATE_HZ, cut_windows
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.results.result import Result
from nanobench_tools.settings import count, setting

from .bar import Step
from .correction import WIDTH, corrected, modules, starts, wanted
from .features import POSITIONS, Seen, position_matrices, seen
from .libraries import Array, libraries
from .published_networks import chunked
from .together import Work
from .training import Settings, Task, Trained, filled, train

GROUPS = 5
PHASES = count("learned.own.phases")
SHARES = np.linspace(0.0, 1.0, 11)
ONSETS = setting("learned.own.onsets")
SETTINGS = Settings(**setting("learned.own.training"))


@dataclass(frozen=True)
class Flown:
    """Windows of one flight, what came, and what the physics says of them that had not seen the flight."""

    name: str
    windows: Windows
    came: Prediction
    predicted: Prediction


@dataclass(frozen=True, repr=False)
class HeldOutErrors(Result):
    """Errors of one quantity after 1, 10, 50 steps and summed, by the names of these. Only on the flights that each
    network did not learn from."""

    physics: Mapping[str, float]
    corrected: Mapping[str, float]


@dataclass(frozen=True, repr=False)
class Teaching(Result):
    """What the networks of a row learnt from and how far: loss and validation loss (epochs, 2) of each; held_out by
    quantity."""

    epochs: int
    best_epochs: tuple[int, ...]
    held_out: Mapping[str, HeldOutErrors]
    history: Sequence[Sequence[Sequence[float]]]
    flights: int
    windows: int


@dataclass(frozen=True)
class Corrected:
    """A predictor: ``base`` and what the networks correct of it. shares, onsets (4,) of QUANTITIES; ``spread``: mean
    and size of context and steps; ``networks``: their numbers."""

    name: str
    base: Predictor
    networks: tuple[tuple[np.ndarray, ...], ...]
    spread: tuple[np.ndarray, ...]
    shares: np.ndarray
    onsets: np.ndarray
    information: str = "state"
    trained: Teaching | None = None

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Those of the physics, and the shares."""
        own = {f"share_{name.rpartition('_mae')[0]}": Estimate(float(share), None, "1")
               for name, share in zip(QUANTITIES, self.shares, strict=True)}
        return {**getattr(self.base, "parameters", {}), **own}

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start."""
        predicted = self.base.predict(windows)
        if not self.shares.any():
            return predicted
        errors = corrections(self.networks, self.spread, windows, predicted, self.information == "past")
        taken = [share * rising(onset, windows.horizon) for share, onset in zip(self.shares, self.onsets, strict=True)]
        return corrected(predicted, errors * np.repeat(np.stack(taken, axis=1), 3, axis=1))


def rising(onset: float, horizon: int) -> np.ndarray:
    """(H,) 0..1 after 1..H steps.

    >>> rising(0.0, 2).tolist()
    [1.0, 1.0]
    """
    return np.ones(horizon) if onset == 0.0 else -np.expm1(-np.arange(horizon) / onset)


def corrections(networks: Sequence[Sequence[np.ndarray]], spread: Sequence[np.ndarray], windows: Windows,
         predicted: Prediction, past: bool) -> np.ndarray:
    """(n, H, 12) mean over the networks of the errors they see in ``predicted``."""
    look = seen(windows, predicted, past)
    run = _all_of(look.context.shape[1], look.steps.shape[2], 1.0 / windows.rate_hz)
    arrays = _arrays(look, spread, windows, predicted)
    nets = [list(leaves) for leaves in networks]
    return chunked(lambda *parts: run(nets, *parts), *arrays).astype(float)


def _arrays(look: Seen, spread: Sequence[np.ndarray], windows: Windows, predicted: Prediction) -> list[np.ndarray]:
    context, context_size, steps, steps_size = spread
    arrays = ((look.context - context) / context_size, (look.steps - steps) / steps_size, look.thrust,
              *starts(windows, predicted))
    return [np.asarray(a, np.float32) for a in arrays]


def _network(context: int, steps: int, seed: int) -> Any:
    return modules().Correction(context, steps, libraries().jax.random.key(seed))


_KEPT: dict[tuple[int, int, float], Callable[..., Any]] = {}


def _all_of(context: int, steps: int, dt: float) -> Callable[..., Any]:
    """The same function every time for the same sizes, so that it is compiled once."""
    if (context, steps, dt) not in _KEPT:
        shape = _network(context, steps, 0)

        def run(networks: Sequence[Any], *arrays: Array) -> Array:
            return sum(filled(shape, leaves)(*arrays, dt) for leaves in networks) / len(networks)

        _KEPT[context, steps, dt] = libraries().jax.jit(run)
    return _KEPT[context, steps, dt]


def held_out(cases: Sequence[Case], fits: Callable[[Sequence[Sequence[Case]]], Sequence[Predictor]],
             past: bool = False, truth: str = "onboard", groups: int = GROUPS) -> list[list[Flown]]:
    """Groups of flights, each predicted by a fit of the other groups; ``fits`` gives a predictor for each of some
    sets of flights. Windows every 2 rows.

    Raises InputError for fewer than two flights.
    """
    if len(cases) < 2:
        raise InputError("training flights", f"{len(cases)} flight is left: none can be held out", "give two or more")
    count = min(groups, len(cases))
    fitted = fits([[c for i, c in enumerate(cases) if i % groups != group] for group in range(count)])
    return [[Flown(case.flight.name, windows, came, physics.predict(windows))
             for case in cases[group::groups] for windows, came in _dense(case, truth, past)]
            for group, physics in enumerate(fitted)]


def _dense(case: Case, truth: str, past: bool) -> list[tuple[Windows, Prediction]]:
    """Windows at PHASES starts within every 10 rows; the first are those that are scored."""
    step = EVERY / RATE_HZ / PHASES
    shifted = ([Span(s.start_s + k * step, s.end_s) for s in case.spans if s.duration_s > 2.0 * EVERY / RATE_HZ]
               for k in range(PHASES))
    return [both for spans in shifted if (both := cut_windows(case.flight, spans, truth, past)) is not None]


@dataclass(frozen=True)
class Lesson:
    """What the networks of a row learn from. groups of flights as ``held_out`` gives them; ``spread``: as in Corrected;
    ``arrays``: what a network is called with, of all windows; ``target`` (n, H, 12): errors it should say; ``group``
    (n,)."""

    name: str
    past: bool
    groups: Sequence[Sequence[Flown]]
    spread: tuple[np.ndarray, ...]
    arrays: list[np.ndarray]
    target: np.ndarray
    group: np.ndarray
    kinds: tuple[str, str]

    @property
    def flown(self) -> list[Flown]:
        """All of them."""
        return [f for group in self.groups for f in group]

    def work(self, settings: Settings, folder: Path | None) -> list[Work]:
        """The trainings, one per group."""
        names, count = sorted({f.name for f in self.flown}), len(self.groups)
        return [Work(f"{self.name} {k + 1} of {count}", train_network, {
            "label": f"{self.name} {k + 1} of {count}", "arrays": self.arrays, "target": self.target,
            "number": self.group, "group": k, "rate_hz": self.flown[0].windows.rate_hz, "kinds": self.kinds,
            "flights": names, "settings": settings,
            "path": None if folder is None else Path(folder) / f"{self.name}_{k + 1}.safetensors"}, settings.epochs)
            for k in range(count)]

    def row(self, base: Predictor, found: Sequence[Trained]) -> Corrected:
        """``base`` (fitted to all flights) corrected by what was trained."""
        shares, onsets, table = guard(self.groups, found, self.spread, self.past)
        return Corrected(self.name, base, tuple(tuple(f.leaves) for f in found), self.spread, shares, onsets,
                         "past" if self.past else "state",
                         Teaching(len(found[0].history), tuple(f.best for f in found), table,
                                  [f.history.tolist() for f in found], len({f.name for f in self.flown}),
                                  len(self.target)))


def lesson(name: str, groups: Sequence[Sequence[Flown]], past: bool = False) -> Lesson:
    """What the row ``name`` learns from ``groups``. InputError when they hold no window."""
    flown = [f for group in groups for f in group]
    if not flown or not sum(len(f.windows) for f in flown):
        raise InputError("training flights", "no window to train a correction on is left")
    looks = [seen(f.windows, f.predicted, past) for f in flown]
    context, steps = (np.concatenate([getattr(look, part) for look in looks]) for part in ("context", "steps"))
    spread = (*_even(context, looks[0].kinds[0]), *_even(steps.reshape(-1, steps.shape[2]), looks[0].kinds[1]))
    arrays = [np.concatenate(parts) for parts in zip(*(_arrays(look, spread, f.windows, f.predicted)
                                                       for look, f in zip(looks, flown, strict=True)), strict=True)]
    target = np.concatenate([wanted(f.predicted, f.came) for f in flown]).astype(np.float32)
    number = np.repeat(np.concatenate([np.full(len(group), k) for k, group in enumerate(groups)]),
                       [len(f.windows) for f in flown])
    return Lesson(name, past, groups, spread, arrays, target, number, looks[0].kinds)


def train_network(label: str, arrays: Sequence[np.ndarray], target: np.ndarray, number: np.ndarray, group: int,
                  rate_hz: float, kinds: tuple[str, str], flights: list[str], settings: Settings, path: Path | None,
                  quiet: bool = True, report: Step | None = None) -> Trained:
    """One network of a lesson: it learns from all groups but ``group`` and is validated on that."""
    task = _task(label, arrays, target, number, group, rate_hz, kinds, settings.seed + group, flights)
    return train(task, settings, path, quiet, report=report)


def train_own(name: str, base: Predictor, groups: Sequence[Sequence[Flown]], past: bool = False,
              settings: Settings = SETTINGS, quiet: bool = True) -> Corrected:
    """``base`` (fitted to all flights) corrected by networks trained on ``groups`` (``held_out``), here and now."""
    taught = lesson(name, groups, past)
    return taught.row(base, [train_network(**one.kwargs, quiet=quiet) for one in taught.work(settings, None)])


def _even(values: np.ndarray, kinds: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean and size of features that do not break the symmetry: vectors keep their zero in x and y, and one size for
    both."""
    mean, size = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-3)
    at = 0
    for kind in kinds:
        if kind != "s":
            size[at:at + 2] = np.sqrt(np.mean(values[:, at:at + 2] ** 2))
            mean[at:at + 2] = 0.0
            if kind == "t":
                mean[at + 2], size[at + 2] = 0.0, np.sqrt(np.mean(values[:, at + 2] ** 2))
        at += 1 if kind == "s" else 3
    return mean, np.maximum(size, 1e-3)


def _task(label: str, arrays: Sequence[np.ndarray], target: np.ndarray, number: np.ndarray, group: int, rate_hz: float,
          kinds: tuple[str, str], seed: int, flights: list[str]) -> Task:
    jnp = libraries().jnp
    usual = np.stack([np.linalg.norm(target[..., 3 * q:3 * q + 3], axis=2).mean(axis=0) for q in range(4)], axis=1)
    early = np.arange(1, target.shape[1] + 1) ** -0.5  # steps that are scored by themselves are mostly early ones
    usual = jnp.asarray(np.maximum(usual, 1e-6) * early.mean() / early[:, None], jnp.float32)
    views = [jnp.asarray(position_matrices(k), jnp.float32) for k in (*kinds, "tm")]
    data = {"arrays": [jnp.asarray(a) for a in arrays], "target": jnp.asarray(target)}

    def relative(errors: Array, target: Array) -> Array:
        left = (target - errors).reshape(*errors.shape[:2], 4, 3)
        return jnp.mean(jnp.sqrt(jnp.sum(left**2, axis=3) + 1e-12) / usual)

    def loss(net: Any, data: Mapping[str, Array], at: Array) -> Array:
        context, steps, *rest = (a[at] for a in data["arrays"])
        shown = (7 * at + jnp.sum(at)) % POSITIONS  # another position every time a window comes up
        turned = (jnp.einsum("nij,nj->ni", views[0][shown], context),
                  jnp.einsum("nij,nhj->nhi", views[1][shown], steps))
        return relative(net(*turned, *rest, 1.0 / rate_hz, views[2][shown].swapaxes(1, 2)), data["target"][at])

    def judge(net: Any, data: Mapping[str, Array], at: Array) -> Array:
        return relative(net(*(a[at] for a in data["arrays"]), 1.0 / rate_hz), data["target"][at])

    rows = np.arange(len(target), dtype=np.int32)
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in (*arrays, target, number))).hexdigest()
    sizes = arrays[0].shape[1], arrays[1].shape[2]
    return Task(label, _network(*sizes, seed), data, loss, rows[number != group], rows[number == group][::PHASES],
                {"architecture": {"kind": "correction", "context": sizes[0], "steps": sizes[1], "width": WIDTH},
                 "data_sha256": digest, "flights": flights}, judge)


def guard(groups: Sequence[Sequence[Flown]], found: Sequence[Trained], spread: Sequence[np.ndarray],
          past: bool) -> tuple[np.ndarray, np.ndarray, dict[str, HeldOutErrors]]:
    """(shares (4,), onsets (4,), errors by quantity) on the flights that each network did not learn from. A share of 0
    is the physics itself."""
    ways = [(0.0, 0.0), *((share, onset) for onset in ONSETS for share in SHARES[1:])]
    horizon = groups[0][0].windows.horizon
    weights = [share * rising(onset, horizon)[:, None] for share, onset in ways]
    sums = np.zeros((len(ways), horizon, len(QUANTITIES)))
    count = 0
    for group, network in zip(groups, found, strict=True):
        for f in group:
            errors = corrections([network.leaves], spread, f.windows, f.predicted, past)
            for k, weight in enumerate(weights):
                after = window_errors(corrected(f.predicted, weight * errors), f.came)
                sums[k] += np.stack([after[name].sum(axis=0) for name in QUANTITIES], axis=1)
            count += len(f.windows)
    keys = (*map(str, HORIZONS), "sum")
    mean = sums / count
    kept = np.concatenate([mean[:, [h - 1 for h in HORIZONS]], mean.sum(axis=1, keepdims=True)], axis=1)
    chosen, table = [], {}
    for q, name in enumerate(QUANTITIES):
        allowed = np.all(kept[:, :, q] <= kept[0, :, q], axis=1)
        best = int(np.argmin(np.where(allowed, kept[:, -1, q], np.inf)))
        chosen.append(ways[best])
        table[name] = HeldOutErrors(*(dict(zip(keys, kept[way, :, q].tolist(), strict=True)) for way in (0, best)))
    return *np.array(chosen).T, table
