"""Command-line options that verbs share."""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..errors import UsageError
from ..steps.options import Options, cores
from ..time_offsets.moving.votes import AS_RECORDED, CLOCKS

PATH = click.Path(path_type=Path)


class FiniteRange(click.FloatRange):
    """A number within bounds; nan, which no bound holds back, and inf are none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        found = super().convert(value, param, ctx)
        if not math.isfinite(found):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return found


OPTIONS: dict[str, Callable[..., Any]] = {
    "data": click.option("--data", multiple=True, type=PATH, metavar="PATH",
                         help="Folder (read recursively) or file, the same as PATH; may repeat. Default: "
                              "$NANOBENCH_DATA, ./data, ../shared/data/nanobench."),
    "out": click.option("--out", type=PATH, metavar="DIR",
                        help="Folder for results. A killed run that is started again continues from there."),
    "json": click.option("--json", type=click.Path(path_type=Path, allow_dash=True), metavar="FILE",
                         help="Write the result as JSON; - prints it."),
    "jobs": click.option("--jobs", type=click.IntRange(min=1), default=cores, show_default="all cores", metavar="N",
                         help="Processes; the result is the same for any number."),
    "scheduler": click.option("--scheduler", metavar="tcp://HOST:PORT",
                              help="Dask scheduler of a cluster instead of --jobs."),
    "seed": click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True,
                         help="Seed of everything random."),
    "clock": click.option("--clock", type=click.Choice(CLOCKS), default=AS_RECORDED,
                          show_default=True,
                          help="Correct the timestamps of the vehicle first: offset (constant), retimed or joint "
                               "(moving). The moving correction is estimated from streams that are not judged; joint "
                               "also uses the logged position. All use the motion capture of the whole flight; rows "
                               "show which streams were used."),
    "columns": click.option("--columns", type=PATH, metavar="FILE", help="Column map (TOML) for a table of your own."),
    "verbose": click.option("--verbose/--no-verbose", default=False,
                            help="Everything that was found, beyond one screen."),
    "quiet": click.option("--quiet", is_flag=True, help="Nothing but errors."),
}


def shared_options(*leave_out: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Gives a verb the shared options (all but ``leave_out``) as one argument ``options: Options``."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def with_options(**kwargs: Any) -> Any:
            from ..harness.pool import shared_workers

            shared = {name: kwargs.pop(name) for name in OPTIONS if name in kwargs}
            if "data" in shared:
                shared["data"] += kwargs.pop("paths")
            with shared_workers():
                return function(Options(**shared), **kwargs)

        for name in reversed([name for name in OPTIONS if name not in leave_out]):
            with_options = OPTIONS[name](with_options)
        if "data" not in leave_out:
            with_options = click.argument("paths", nargs=-1, type=PATH, metavar="[PATH]...")(with_options)
        return with_options

    return decorate


def no_paths_beside(options: Options, option: str) -> None:
    """UsageError where paths are given in addition to an ``option`` (--train) for all recordings: ``--train A B``."""
    if options.data:
        raise UsageError(f"{options.data[-1]} is listed with paths of {option}; "
                         f"write {option} (or --test) before every path")
