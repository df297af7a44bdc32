"""``nanobench tune``: gains of a controller, searched on some plants and paths and judged on others."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from ..errors import UsageError
from ..steps.gain_search import JUDGED, TRAINED, Report, Search, Tuned, gains_toml, paths, tune_gains
from ..steps.options import Options, one_line
from ..steps.show import rich_table
from ..tables.result_table import Table as Grid
from .closing import again, close
from .shared_options import PATH, FiniteRange, shared_options


@click.command()
@shared_options("data", "columns")
@click.option("--controller", required=True, metavar="NAME", help="A registered name or module:Class with gains.")
@click.option("--plant", type=click.Choice(["simulated"]), default="simulated", show_default=True,
              help="Tuned on an ensemble of plants about the simulator.")
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

    The best few fly on plants not searched on. The best of those, or the original gains if none is better, is judged
    on other plants and other families of paths, both whole. Gains are called better only if the interval of the ratio
    shows it. Writes gains_CONTROLLER.toml to --out, which control --gains reads. A killed search goes on."""
    from ..results.result_files import write_bytes
    from .control_plants import Chosen

    if simulator is not None and train:
        raise UsageError("--simulator and --train both choose the plant; give one")
    searched, judged = paths(trajectories, judges, speeds, seconds)
    chosen = Chosen.of(options, simulator, train)
    tuned = tune_gains(options, Search(controller, searched, judged, plants, radio_delay_s, budget), chosen)
    if tuned.outcome is None:
        return options.finish("tune", tuned.to_json())
    if options.out is not None:
        path = options.out / f"gains_{controller.replace(':', '.')}.toml"
        write_bytes(path, gains_toml(tuned, chosen).encode())
        report = replace(tuned.outcome.report, file=str(path))
        tuned = replace(tuned, outcome=replace(tuned.outcome, report=report))
    _show(options, tuned)
    return options.finish("tune", tuned.to_json())


def _show(options: Options, tuned: Tuned) -> None:
    import numpy as np

    controller, judged, outcome = tuned.search.controller, tuned.search.judged, tuned.outcome
    if outcome is None:
        return
    before, after, found, report = outcome.before, outcome.after, outcome.found, outcome.report
    title = f"{controller} tuned: SIMULATED flights of {found.plants} plants and of families not searched on"
    heads = ("reference", "m/s", "RMSE before m", "after m", "lost before", "after", "worst plant before m", "after m")
    rows = []
    for k, spec in enumerate(judged):
        b, a = np.array(before.rmse_m[k], float), np.array(after.rmse_m[k], float)
        speed = spec.params.get("speed_mps")
        rows.append((spec.family, "-" if speed is None else f"{speed:g}", f"{np.median(b):.3f}", f"{np.median(a):.3f}",
                     str(sum(before.lost[k])), str(sum(after.lost[k])), f"{b.max():.3f}", f"{a.max():.3f}"))
    table = rich_table(one_line(title), heads[:1], heads[1:])
    for row in rows:
        table.add_row(*row)
    options.detail(table)
    _close(options, controller, report, tuned.sentence, [Grid.plain(title, heads[:6], [row[:6] for row in rows])])


def _close(options: Options, controller: str, report: Report, result: str, screen: Sequence[Grid]) -> None:
    if report.file is None:
        close(options, result, "keep the gains", *again("--out", "tuned"), screen=screen)
    else:
        close(options, f"{result}; gains: {report.file}", "against the gains as they are", "nanobench", "control",
              "--plant", "simulated", "--controller", controller, "--gains", report.file, screen=screen)
