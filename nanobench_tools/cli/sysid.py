"""``nanobench sysid``: scores of predictive models (Task 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from .methods import load_methods
from .options import PATH, Options, shared_options
from .show import data_word, show_left_out

if TYPE_CHECKING:
    from ..audit import Audit
    from ..flight import Flight
    from ..protocols.task1 import Split

DEFAULT_METHODS = ("naive", "published_physics", "published_physics_ratio2")
SHOWN = (("position_mae_m", "position m"), ("velocity_mae_m_s", "velocity m/s"), ("attitude_mae_rad", "attitude rad"),
         ("rate_mae_rad_s", "rate rad/s"))


@click.command()
@shared_options()
@click.option("--method", "methods", multiple=True, metavar="NAME|module:Class",
              help="Predictor to score beside the default ones; may repeat.")
@click.option("--train", multiple=True, type=PATH, metavar="PATH", help="Train on these recordings (with --test).")
@click.option("--test", multiple=True, type=PATH, metavar="PATH", help="Test on these recordings (with --train).")
def sysid(options: Options, methods: tuple[str, ...], train: tuple[Path, ...], test: tuple[Path, ...]) -> int:
    """Task 1: what will it do? Errors of predictive models over 1 to 50 steps of 10 ms.

    Windows start every 10 rows of clean flight. The default split trains on the earliest flight of each trajectory of
    five families and tests on the others, seen and unseen families apart.
    """
    if bool(train) != bool(test):
        raise UsageError("--train and --test go together")
    predictors = load_methods("predictors", (*DEFAULT_METHODS, *methods))
    flights = options.load([*train, *test] if train else None)
    audits, _ = options.audit(flights)
    flights, audits = options.on_clock(flights, audits)
    parts = None
    if train:
        inside = [any(Path(f.provenance.path).is_relative_to(place) for place in train) for f in flights]
        parts = ([f for f, known in zip(flights, inside, strict=True) if known],
                 [f for f, known in zip(flights, inside, strict=True) if not known])
    return options.finish("sysid", sysid_body(options, flights, audits, predictors, parts))


def sysid_body(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit],
               predictors: Sequence[Any] | None = None,
               parts: tuple[Sequence[Flight], Sequence[Flight]] | None = None) -> dict[str, Any]:
    """The keys of sysid.json, with the table shown; ``parts`` (train, test) replaces the split."""
    from ..harness import make_item
    from ..protocols import task1

    predictors = load_methods("predictors", DEFAULT_METHODS) if predictors is None else predictors
    chosen = task1.split(flights, audits) if parts is None else task1.given_split(*parts, audits)
    work = [(predictor, truth, case) for predictor in predictors for truth in task1.TRUTHS for case in chosen.test]
    items = [make_item(task1.score, {"case": case, "predictor": predictor, "truth": truth},
                       f"{predictor.name} {truth} {case.flight.name}", file=case.flight.provenance.path)
             for predictor, truth, case in work]
    values = options.run(items, "sysid").values
    rows: list[dict[str, Any]] = []
    for predictor in predictors:
        for truth in task1.TRUTHS:
            mine = [(case, values[item.key]) for (p, t, case), item in zip(work, items, strict=True)
                    if p is predictor and t == truth and item.key in values]
            rows += task1.tabulate(predictor, truth, mine, options.seed)
    for row in rows:
        row["clock"] = options.clock
    _show(options, rows, chosen)
    return {"rows": rows, "parameters": {p.name: p.parameters for p in predictors if hasattr(p, "parameters")},
            "best": task1.best_model(rows), "simulator": None, "split": chosen.note,
            "train": [case.flight.name for case in chosen.train], "test": [case.flight.name for case in chosen.test],
            "left_out": show_left_out(options, flights, [{"flights": [case.flight.name for case in cases]}
                                                         for cases in (chosen.train, chosen.test)], audits,
                                      task1.NEEDED, chosen.left_out)}


def _show(options: Options, rows: Sequence[Mapping[str, Any]], chosen: Split) -> None:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    title = (f"Task 1: {data_word(options)} data, clock {options.clock}, mean error after 1, 10, 50 steps of 10 ms "
             "and sum over 1..50 \\[95 % interval of the sum]")
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for head in ("model", "information", "truth", "group", "windows", "flights"):
        table.add_column(head, no_wrap=head != "model")
    for _, heading in SHOWN:
        table.add_column(heading, justify="right")
    for row in rows:
        if row["group"] not in ("all", "seen", "unseen"):
            continue
        labels = [row["model"], row["information"], row["truth"], row["group"]]
        counts = (str(row["n_windows"]), str(row["n_flights"]))
        table.add_row(*map(escape, labels), *counts, *(_cell(row["metrics"][m], row["ci95"][m]) for m, _ in SHOWN))
        if published := row.get("published"):
            table.add_row(escape(row["model"]), "", "", "(published)", "", "",
                          *(_cell(published[m], {}) for m, _ in SHOWN))
    options.show(table)
    options.show(f"Split: {chosen.note}. {len(chosen.train)} flights train, {len(chosen.test)} test.")


def _cell(found: Mapping[str, float], ci95: Mapping[str, Any]) -> str:
    text = " ".join(f"{found[h]:.4f}" for h in ("1", "10", "50") if h in found)
    if "sum" in found:
        text += f" Σ {found['sum']:.2f}"
    if interval := ci95.get("sum"):
        text += f" \\[{interval[0]:.2f}, {interval[1]:.2f}]"
    return text
