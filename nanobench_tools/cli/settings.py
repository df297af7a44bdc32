"""``nanobench settings``: every number that was set by looking at data, and what it was set on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..steps.options import Options, one_line
from .shared_options import shared_options

if TYPE_CHECKING:
    from ..settings import Model, Setting
    from ..settings.literals import Literal, Origin


@click.command()
@click.argument("areas", nargs=-1, metavar="[AREA]...")
@click.option("--origins", is_flag=True, help="Numbers of another origin, too: what declares them, and why.")
@click.option("--unexplained", is_flag=True, help="Numbers in the source that nothing explains, by module.")
@shared_options("data", "out", "jobs", "scheduler", "seed", "clock", "columns")
def settings(options: Options, areas: tuple[str, ...], origins: bool, unexplained: bool) -> int:
    """Every number that was set by looking at data: value, unit, what it does, what it was set on.

    AREA shows one part, such as audit or mismatch; without it all are shown. --origins and --unexplained then keep to
    the modules that ask for its settings. "not recorded" means that nobody wrote down what a number was set on. Whole
    models stand as one row each: they are files of their own.
    """
    from ..settings import areas as known
    from ..settings import everything, models
    from ..settings.literals import by_module, modules_of
    from ..settings.literals import origins as declared
    from ..settings.literals import unexplained as left

    if unknown := sorted(set(areas) - set(known())):
        raise UsageError(f"no area {', '.join(map(repr, unknown))}; there are {', '.join(known())}")
    chosen = [entry for entry in everything().values() if not areas or entry.area in areas]
    files = () if areas else models()
    asking = modules_of(areas) if areas and (origins or unexplained) else None
    bare = [b for b in left() if asking is None or b.module in asking] if unexplained else []
    declarations = [o for o in declared() if asking is None or any(map(o.speaks_of, asking))] if origins else []
    for area in dict.fromkeys(entry.area for entry in chosen):
        options.show(_table(area, [entry for entry in chosen if entry.area == area]))
    if files:
        options.show(_models(files))
    if origins:
        options.show(_origins(declarations))
    if unexplained:
        options.show(_bare(bare))
    unknown_n = sum(entry.set_on == "not_recorded" for entry in chosen)
    options.show(f"{len(chosen)} settings; what {unknown_n} of them were set on was not recorded. "
                 "Next: nanobench settings --origins")
    return options.finish("settings", {
        "settings": [{"key": s.key, "value": s.value, "unit": s.unit, "does": s.does, **_set_on(s.set_on), "how": s.how}
                     for s in chosen],
        "models": [{"file": m.file, "does": m.does, **_set_on(m.set_on)} for m in files],
        "origins": [vars(origin) for origin in declarations],
        "unexplained": by_module(bare),
    })


def _set_on(name: str) -> dict[str, str]:
    from ..settings import recordings

    on = recordings()[name]
    return {"set_on": on.what, "kind": on.kind, "n": on.n}


def _described(name: str) -> str:
    from ..settings import recordings

    on = recordings()[name]
    kind = on.kind if on.kind in ("real", "SYNTHETIC") else ""
    return ": ".join(filter(None, (" ".join(filter(None, (on.n, kind))), on.what)))


def _plain_table(title: str, *columns: str) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for k, column in enumerate(columns):
        table.add_column(column, overflow="fold", no_wrap=k == 0)
    return table


def _table(area: str, entries: list[Setting]) -> Any:
    table = _plain_table(area, "key", "value", "unit", "what it does", "set on")
    for entry in entries:
        declarations = _described(entry.set_on) + (f" ({entry.how})" if entry.how else "")
        table.add_row(entry.key, *map(one_line, (_text(entry.value), entry.unit, entry.does, declarations)))
    return table


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _models(files: tuple[Model, ...]) -> Any:
    table = _plain_table("models in files of their own", "file", "what it is", "set on")
    for model in files:
        table.add_row(model.file, one_line(model.does), one_line(_described(model.set_on)))
    return table


def _origins(declared: Sequence[Origin]) -> Any:
    table = _plain_table("numbers of another origin", "where", "origin", "why")
    for origin in declared:
        table.add_row(origin.where, origin.kind, one_line(origin.why))
    return table


def _bare(bare: list[Literal]) -> Any:
    from ..settings.literals import by_module

    table = _plain_table(f"{len(bare)} numbers that nothing explains", "module", "n", "line: value of the first ones")
    for module, n in by_module(bare).items():
        some = [f"{b.line}: {b.value:.6g}" for b in bare if b.module == module]
        table.add_row(module, str(n), ", ".join(some[:6]) + (" ..." if n > 6 else ""))
    return table
