"""``nanobench settings``: every number that was set by looking at data, and what it was set on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..steps.options import Options, one_line
from .shared_options import shared_options

if TYPE_CHECKING:
    from ..settings import Model, Setting


@click.command()
@click.argument("areas", nargs=-1, metavar="[AREA]...")
@shared_options("data", "out", "jobs", "scheduler", "seed", "clock", "columns")
def settings(options: Options, areas: tuple[str, ...]) -> int:
    """Every number that was set by looking at data: value, unit, what it does, what it was set on.

    AREA shows one part, such as audit or mismatch; without it all are shown. "not recorded" means that nobody wrote
    down what a number was set on. A whole model is one row: it is a file.
    """
    from ..settings import areas as known
    from ..settings import everything, models

    if unknown := sorted(set(areas) - set(known())):
        raise UsageError(f"no area {', '.join(map(repr, unknown))}; there are {', '.join(known())}")
    chosen = [entry for entry in everything().values() if not areas or entry.area in areas]
    files = () if areas else models()
    for area in dict.fromkeys(entry.area for entry in chosen):
        options.show(_table(area, [entry for entry in chosen if entry.area == area]))
    if files:
        options.show(_models(files))
    unknown_n = sum(entry.set_on == "not_recorded" for entry in chosen)
    options.show(f"{len(chosen)} settings; what {unknown_n} of them were set on was not recorded. "
                 f"Next: nanobench settings {'' if areas else known()[0]}".rstrip())
    return options.finish("settings", {
        "settings": [{"key": s.key, "value": s.value, "unit": s.unit, "does": s.does, **_set_on(s.set_on), "how": s.how}
                     for s in chosen],
        "models": [{"file": m.file, "does": m.does, **_set_on(m.set_on)} for m in files],
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
