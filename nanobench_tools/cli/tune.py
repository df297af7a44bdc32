"""``nanobench tune``: gains of a controller, searched on some plants and paths and judged on others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..harness.progress import Progress, Task
from ..results.result import OPTIONAL, Result, to_json
from ..steps.options import Options, one_line
from ..tables.result_table import Table as Grid
from .closing import again, close
from .shared_options import PATH, FiniteRange, shared_options

if TYPE_CHECKING:
    from controllers.tuning import Compared, Flown, Trial

    from ..harness import Item, RunResult
    from ..practice.references import PathSpec

TRAINED = ("circle", "star", "linear_ramp", "minimum_snap")
"""Bends and corners, as the families that judge have both."""
JUDGED = ("figure_eight", "oval", "helix", "trefoil", "lissajous", "staircase_climb")
SEED_APART = 1000
"""Between the seeds of the plants that judge, that train and that choose among the best."""


@click.command()
@shared_options("data", "columns")
@click.option("--controller", required=True, metavar="NAME", help="A registered name or module:Class with gains.")
@click.option("--plant", type=click.Choice(["simulated"]), default="simulated", show_default=True,
              help="What it is tuned on: an ensemble of plants about the simulator.")
@click.option("--simulator", type=PATH, metavar="FILE", help="simulator.toml of the plant. Default: as shipped.")
@click.option("--train", multiple=True, type=PATH, metavar="PATH",
              help="Identify the plant from these recordings; may repeat.")
@click.option("--trajectory", "trajectories", multiple=True, metavar="NAME",
              help=f"A family to search on; may repeat. Default: {', '.join(TRAINED)}.")
@click.option("--judge", "judges", multiple=True, metavar="NAME",
              help=f"A family to judge on; may repeat. Default: those of {', '.join(JUDGED)} that are not searched on.")
@click.option("--speed", "speeds", multiple=True, type=FiniteRange(min=0.05, max=5.0), metavar="M_S",
              help="Speed along the paths [m/s]; may repeat. Default: 0.5 and 1.0.")
@click.option("--seconds", type=FiniteRange(min=7.0, max=600.0), default=7.5, show_default=True,
              help="Length of every path, of which the first 3 s are not scored.")
@click.option("--plants", type=click.IntRange(min=2), default=8, show_default=True, metavar="N",
              help="Plants to search on; as many others choose among the best, and twice as many others judge.")
@click.option("--radio-delay-s", type=FiniteRange(min=0.0, max=0.1), default=0.03, show_default=True, metavar="S",
              help="Delay of the radio; every second plant's is 20 ms longer than controllers assume.")
@click.option("--budget", type=click.IntRange(min=2), default=120, show_default=True, metavar="N",
              help="Trials, each of all paths on all plants.")
def tune(options: Options, controller: str, plant: str, simulator: Path | None, train: tuple[Path, ...],
         trajectories: tuple[str, ...], judges: tuple[str, ...], speeds: tuple[float, ...], seconds: float,
         plants: int, radio_delay_s: float, budget: int) -> int:
    """Searches gains or weights of a controller on an ensemble of plants.

    The best few fly on plants not searched on, and the best of those, or the gains as they are if none is better, is
    judged on other plants and other families of paths, both whole: better is said only if the interval of the ratio
    says so. Writes gains_CONTROLLER.toml to --out, which control --gains reads. A killed search goes on.
    """
    from controllers.gains import dumps
    from controllers.plants.simulated_flights import made, settled_s
    from controllers.tuning import Trial, compared, evaluate, objective, shortlist

    from ..physics.simulator import loads
    from ..protocols.simulated import specs_of
    from ..results.result_files import write_bytes
    from .control_plants import Chosen

    if simulator is not None and train:
        raise UsageError("--simulator and --train both choose the plant; give one")
    searched = specs_of(trajectories or TRAINED, speeds, seconds)
    families = {spec.family for spec in searched}
    judged = specs_of(judges or [name for name in JUDGED if name not in families], speeds, seconds)
    both = sorted(families & {spec.family for spec in judged})
    if both or not judged:
        raise UsageError(f"--judge {', '.join(both) or 'nothing'}: a family that was searched on cannot judge; "
                         "give others")
    settled_s([*searched, *judged])
    chosen = Chosen.of(options, simulator, train)
    tunable = getattr(made(controller, loads(chosen.simulator)), "tunable", None)
    if not tunable:
        raise UsageError(f"controller {controller} has no gains to tune; it flies as it is")

    def item(gains: Mapping[str, float], specs: Sequence[PathSpec], count: int, seed: int, what: str) -> Item:
        from ..harness import make_item

        return make_item(evaluate, {"name": controller, "gains": dict(gains), "specs": list(specs),
                                    "simulator": chosen.simulator, "plants": count, "seed": seed,
                                    "radio_s": radio_delay_s, "draws": chosen.draws}, what, file=controller)

    trials = _searched(options, tunable, budget,
                       lambda gains: item(gains, searched, plants, options.seed + SEED_APART, "trial"))
    start = {name: gain.value for name, gain in tunable.items()}
    short = shortlist(trials)
    items = [item(gains, searched, plants, options.seed + 2 * SEED_APART, f"choice {k}")
             for k, gains in enumerate(short)]
    result = options.run(items, "choose")
    if len(result.values) < len({one.key for one in items}):
        return options.finish("tune", {"controller": controller, "trials": trials})
    objectives = [objective(result.values[one.key]) for one in items]
    best = short[objectives.index(min(objectives))]
    choices = list(map(Trial, short, objectives))
    items = [item(gains, judged, 2 * plants, options.seed, f"judge {word}") for gains, word in ((start, "before"),
                                                                                               (best, "after"))]
    result = options.run(items, "judge")
    if len(result.values) < len({one.key for one in items}):
        return options.finish("tune", {"controller": controller, "trials": trials, "choices": choices, "gains": best})
    before, after = (result.values[one.key] for one in items)
    found = compared(before, after, options.seed)
    report = Report(found.better, best == start, found.ratio, found.ci95, len(trials), sorted(families),
                    sorted({spec.family for spec in judged}), chosen.origin, radio_delay_s, options.seed)
    if options.out is not None:
        path = options.out / f"gains_{controller.replace(':', '.')}.toml"
        write_bytes(path, dumps(controller, best, tunable, to_json(report)).encode())
        report = replace(report, file=str(path))
    _show(options, controller, judged, before, after, found, report)
    rows = [{"reference": spec.family, "speed_m_s": spec.params.get("speed_mps"), "before_m": before.rmse_m[k],
             "after_m": after.rmse_m[k], "lost_before": before.lost[k], "lost_after": after.lost[k]}
            for k, spec in enumerate(judged)]
    return options.finish("tune", {"controller": controller, "before": start, "gains": best, "rows": rows,
                                   "verdict": to_json(found) | to_json(report), "choices": choices, "trials": trials})


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
    import math

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


def _show(options: Options, controller: str, judged: Sequence[PathSpec], before: Flown, after: Flown,
          found: Compared, report: Report) -> None:
    import numpy as np
    from rich import box
    from rich.table import Table

    table = Table(title=f"{one_line(controller)} tuned: SIMULATED flights of {found.plants} plants and of families "
                  "not searched on", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("reference", no_wrap=True)
    for head in ("m/s", "RMSE before m", "after m", "worst plant before m", "after m", "lost before", "after"):
        table.add_column(head, justify="right")
    for k, spec in enumerate(judged):
        b, a = np.array(before.rmse_m[k], float), np.array(after.rmse_m[k], float)
        speed = spec.params.get("speed_mps")
        table.add_row(spec.family, "-" if speed is None else f"{speed:g}", f"{np.median(b):.3f}", f"{np.median(a):.3f}",
                      f"{b.max():.3f}", f"{a.max():.3f}", str(sum(before.lost[k])), str(sum(after.lost[k])))
    options.detail(table)
    if report.as_they_were:
        result = (f"{controller}: {report.trials} trials found no gains that are better on plants not searched on; "
                  "they stay as they are")
    else:
        word = "better" if found.better else "not shown to be better"
        result = (f"{controller} tuned is {word}: RMSE {found.ratio:.3f} times what it was (95 % "
                  f"{found.ci95[0]:.3f} to {found.ci95[1]:.3f}), "
                  f"{found.lost_before} of {found.paths * found.plants} flights lost before, "
                  f"{found.lost_after} after; {report.trials} trials")
    rows = [(spec.family, f"{np.median(np.array(before.rmse_m[k], float)):.3f}",
             f"{np.median(np.array(after.rmse_m[k], float)):.3f}", str(sum(before.lost[k])), str(sum(after.lost[k])))
            for k, spec in enumerate(judged)]
    _close(options, controller, report, result, [Grid.plain(
        f"{controller} tuned: SIMULATED flights of {found.plants} plants and of families not searched on",
        ("reference", "RMSE before m", "after m", "lost before", "after"), rows)])


def _close(options: Options, controller: str, report: Report, result: str, screen: Sequence[Grid]) -> None:
    if report.file is None:
        close(options, result, "keep the gains", *again("--out", "tuned"), screen=screen)
    else:
        close(options, f"{result}; gains: {report.file}", "against the gains as they are", "nanobench", "control",
              "--plant", "simulated", "--controller", controller, "--gains", report.file, screen=screen)
