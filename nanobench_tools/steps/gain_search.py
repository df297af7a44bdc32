"""Gains of a controller, searched on some plants and judged on others: what ``nanobench tune`` and ``nb.tune`` share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import UsageError
from ..harness.progress import Progress, Task
from ..results.result import OPTIONAL, Result, to_json
from .options import Options

if TYPE_CHECKING:
    from controllers.tuning import Compared, Flown, Trial

    from ..harness import Item, RunResult
    from ..practice.references import PathSpec

TRAINED = ("circle", "star", "linear_ramp", "minimum_snap")
"""Bends and corners, as the families that judge have both."""
JUDGED = ("figure_eight", "oval", "helix", "trefoil", "lissajous", "staircase_climb")
SEED_APART = 1000
"""Between the seeds of the plants that judge, that train and that choose among the best."""


class Plant(Protocol):
    """Text of a simulator.toml, draws of its parameters (names, rows) or None, and its origin in words."""

    @property
    def simulator(self) -> str: ...
    @property
    def draws(self) -> tuple[tuple[str, ...], list[list[float]]] | None: ...
    @property
    def origin(self) -> str: ...


@dataclass(frozen=True)
class GivenPlant:
    """A ``Plant`` from a text, or the one that is shipped."""

    simulator: str
    draws: tuple[tuple[str, ...], list[list[float]]] | None
    origin: str

    @classmethod
    def of(cls, text: str, origin: str) -> GivenPlant:
        """InputError for a text that is no simulator.toml of a vehicle that a controller can fly."""
        from controllers.plants.plant import closed_loop_model

        from ..physics.simulator import loads

        closed_loop_model(loads(text, origin))
        return cls(text, None, origin)

    @classmethod
    def shipped(cls) -> GivenPlant:
        """The recorded vehicle with its draws."""
        from controllers.plants.ensemble import shipped_draws, shipped_simulator

        names, rows = shipped_draws()
        return cls(shipped_simulator(), (names, rows.tolist()), "the recorded vehicle as shipped")


@dataclass(frozen=True)
class Search:
    """The subject of the search: a controller with gains; ``plants`` to search on, as many others choose among the
    best, and twice as many others judge; ``radio_delay_s``: of every second plant 20 ms longer; ``budget``: trials."""

    controller: str
    searched: Sequence[PathSpec]
    judged: Sequence[PathSpec]
    plants: int
    radio_delay_s: float
    budget: int


@dataclass(frozen=True, repr=False)
class Report(Result):
    """How gains were found and what they are worth; ``file`` holds them."""

    better: bool
    as_they_were: bool
    ratio: float
    ci95: tuple[float, float]
    trials: int
    searched: Sequence[str]
    judged: Sequence[str]
    plants: str
    radio_delay_s: float
    seed: int
    file: str | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True)
class Outcome:
    """The judges' flights with the gains ``before`` and ``after``, compared."""

    before: Flown
    after: Flown
    found: Compared
    report: Report


@dataclass(frozen=True)
class Tuned:
    """Gains before and after; ``choices``: the best few on other plants. Without ``outcome`` a flight of the choice or
    of the judges failed; the options say why."""

    search: Search
    start: Mapping[str, float]
    trials: Sequence[Trial]
    choices: Sequence[Trial] = ()
    gains: Mapping[str, float] | None = None
    outcome: Outcome | None = None

    def rows(self) -> list[dict[str, Any]]:
        """One a judging path: RMSE [m] and losses of every plant, before and after."""
        if self.outcome is None:
            return []
        before, after = self.outcome.before, self.outcome.after
        return [{"reference": spec.family, "speed_m_s": spec.params.get("speed_mps"), "before_m": before.rmse_m[k],
                 "after_m": after.rmse_m[k], "lost_before": before.lost[k], "lost_after": after.lost[k]}
                for k, spec in enumerate(self.search.judged)]

    def to_json(self) -> dict[str, Any]:
        """tune.json; what a failure left of it."""
        content: dict[str, Any] = {"controller": self.search.controller, "trials": self.trials}
        if self.gains is not None:
            content |= {"choices": self.choices, "gains": self.gains}
        if self.outcome is not None:
            verdict = to_json(self.outcome.found) | to_json(self.outcome.report)
            content |= {"before": self.start, "rows": self.rows(), "verdict": verdict}
        return content

    @property
    def sentence(self) -> str:
        """Whether the gains are better on plants and paths not searched on, and by how much."""
        name = self.search.controller
        if self.outcome is None:
            return f"{name}: not judged, a flight failed"
        found, trials = self.outcome.found, len(self.trials)
        if self.outcome.report.as_they_were:
            return (f"{name}: {trials} trials found no gains that are better on plants not searched on; "
                    "they stay as they are")
        word = "better" if found.better else "not shown to be better"
        return (f"{name} tuned is {word}: RMSE {found.ratio:.3f} times what it was (95 % {found.ci95[0]:.3f} to "
                f"{found.ci95[1]:.3f}), {found.lost_before} of {found.paths * found.plants} flights lost before, "
                f"{found.lost_after} after; {trials} trials")


def paths(trajectories: Sequence[str], judges: Sequence[str], speeds: Sequence[float],
          seconds: float) -> tuple[list[PathSpec], list[PathSpec]]:
    """(searched on, judged on): families by name, empty for the usual ones, at speeds [m/s], each ``seconds`` long.

    UsageError for a family among both, or no judge."""
    from controllers.plants.simulated_flights import settled_s

    from ..protocols.simulated import specs_of

    searched = specs_of(trajectories or TRAINED, speeds, seconds)
    families = {spec.family for spec in searched}
    judged = specs_of(judges or [name for name in JUDGED if name not in families], speeds, seconds)
    both = sorted(families & {spec.family for spec in judged})
    if both or not judged:
        raise UsageError(f"--judge {', '.join(both) or 'nothing'}: a family that was searched on cannot judge; "
                         "give others")
    settled_s([*searched, *judged])
    return searched, judged


def tune_gains(options: Options, search: Search, plant: Plant) -> Tuned:
    """Searches, chooses among the best on other plants, and judges on others again, with paths not searched on.

    UsageError for a controller without gains."""
    from controllers.plants.simulated_flights import made
    from controllers.tuning import Trial, compared, evaluate, objective, shortlist

    from ..physics.simulator import loads

    controller, plants, seed = search.controller, search.plants, options.seed
    tunable = tunable_of(made(controller, loads(plant.simulator)), controller)

    def item(gains: Mapping[str, float], specs: Sequence[PathSpec], count: int, seed: int, what: str) -> Item:
        from ..harness import make_item

        return make_item(evaluate, {"name": controller, "gains": dict(gains), "specs": list(specs),
                                    "simulator": plant.simulator, "plants": count, "seed": seed,
                                    "radio_s": search.radio_delay_s, "draws": plant.draws}, what, file=controller)

    def flown(items: Sequence[Item], what: str) -> list[Flown] | None:
        values = options.run(items, what).values
        return [values[one.key] for one in items] if all(one.key in values for one in items) else None

    trials = _searched(options, tunable, search.budget,
                       lambda gains: item(gains, search.searched, plants, seed + SEED_APART, "trial"))
    start = {name: gain.value for name, gain in tunable.items()}
    short = shortlist(trials)
    chosen = flown([item(gains, search.searched, plants, seed + 2 * SEED_APART, f"choice {k}")
                    for k, gains in enumerate(short)], "choose")
    if chosen is None:
        return Tuned(search, start, trials)
    objectives = [objective(one) for one in chosen]
    best = short[objectives.index(min(objectives))]
    tuned = Tuned(search, start, trials, list(map(Trial, short, objectives)), best)
    judged = flown([item(gains, search.judged, 2 * plants, seed, f"judge {word}")
                    for gains, word in ((start, "before"), (best, "after"))], "judge")
    if judged is None:
        return tuned
    found = compared(judged[0], judged[1], seed)
    report = Report(found.better, best == start, found.ratio, found.ci95, len(trials),
                    sorted({spec.family for spec in search.searched}), sorted({spec.family for spec in search.judged}),
                    plant.origin, search.radio_delay_s, seed)
    return Tuned(search, start, trials, tuned.choices, best, Outcome(judged[0], judged[1], found, report))


def tunable_of(made: Any, controller: str) -> Mapping[str, Any]:
    """The gains of a controller by name; UsageError if it has none."""
    tunable: Mapping[str, Any] | None = getattr(made, "tunable", None)
    if not tunable:
        raise UsageError(f"controller {controller} has no gains to tune; it flies as it is")
    return tunable


def gains_toml(tuned: Tuned, plant: Plant) -> str:
    """The gains as a file that ``control --gains`` reads, with what they are worth."""
    from controllers.gains import dumps
    from controllers.plants.simulated_flights import made

    from ..physics.simulator import loads

    controller = tuned.search.controller
    tunable = tunable_of(made(controller, loads(plant.simulator)), controller)
    report = {} if tuned.outcome is None else to_json(tuned.outcome.report)
    return dumps(controller, tuned.gains or tuned.start, tunable, report)


class _Within(Progress):
    """Steps of one generation as steps of the whole search."""

    def __init__(self, step: Task, done: int) -> None:
        super().__init__(quiet=True)
        self._step, self._done = step, done

    @contextmanager
    def task(self, label: str, total: int) -> Iterator[Task]:
        yield lambda done, failed=0, total=None: self._step(self._done + done)


def _searched(options: Options, tunable: Mapping[str, Any], budget: int, item: Any) -> list[Trial]:
    """All trials; one that fails counts as one that loses every vehicle."""
    from controllers.tuning import LOST_M, objective, search

    from ..harness import run_items

    done = 0
    with options.progress.task("tune", budget) as step:
        def run(many: list[dict[str, float]]) -> list[float]:
            nonlocal done
            items = [item(gains) for gains in many]
            result: RunResult = run_items(items, options.store, options.jobs, options.scheduler, _Within(step, done))
            done += len(items)
            if done == 1 and result.failed:
                raise UsageError(result.failed[0]["error"])
            return [objective(result.values[one.key]) if one.key in result.values else math.log(LOST_M)
                    for one in items]

        return search(tunable, run, budget, options.seed)
