"""``nanobench settings``: every number that was set by looking at data, and what it was set on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..steps.options import Options, one_line
from ..tables.result_table import Table as Grid
from .closing import close
from .shared_options import shared_options

if TYPE_CHECKING:
    from ..settings import Model, Setting


SHORT = 24
"""Characters of a value on a narrow screen."""


@click.command()
@click.argument("areas", nargs=-1, metavar="[AREA]...")
@shared_options("data", "out", "jobs", "scheduler", "seed", "clock", "columns")
def settings(options: Options, areas: tuple[str, ...]) -> int:
    """Every number that was set by looking at data: value, unit, what it does, what it was set on.

    AREA shows one part, such as audit or mismatch. Without it the areas are shown, with --verbose everything. "not
    recorded" means that the data a number was set on were not written down. A whole model is one row: it is a file.
    """
    from ..settings import areas as known
    from ..settings import everything, models

    if unknown := sorted(set(areas) - set(known())):
        raise UsageError(f"no area {', '.join(map(repr, unknown))}; there are {', '.join(known())}")
    chosen = [entry for entry in everything().values() if not areas or entry.area in areas]
    files = () if areas else models()
    detail = [_table(area, [entry for entry in chosen if entry.area == area])
              for area in dict.fromkeys(entry.area for entry in chosen)]
    unknown_n = sum(entry.set_on == "not_recorded" for entry in chosen)
    close(options, f"{len(chosen)} settings; what {unknown_n} of them were set on was not recorded",
          "all of them" if areas else "those of one area",
          *(("nanobench", "settings", *areas, "--verbose") if areas else ("nanobench", "settings", known()[0])),
          screen=[_short(area, [entry for entry in chosen if entry.area == area]) for area in areas]
          or [_overview(chosen)], detail=[*detail, *([_models(files)] if files else [])])
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


def _overview(entries: Sequence[Setting]) -> Grid:
    """How many settings each area has."""
    from ..settings import areas

    mine = {area: [entry for entry in entries if entry.area == area] for area in areas()}
    return Grid.plain("Settings by area", ("area", "settings", "set on not recorded"), [
        (area, str(len(found)), str(sum(entry.set_on == "not_recorded" for entry in found)))
        for area, found in mine.items()])


def _short(area: str, entries: Sequence[Setting]) -> Grid:
    return Grid.plain(area, ("key", "value", "unit"), [
        (entry.key, text if len(text := one_line(_text(entry.value))) <= SHORT else "several: --verbose", entry.unit)
        for entry in entries])


def _table(area: str, entries: Sequence[Setting]) -> Grid:
    return Grid.plain(area, ("key", "value", "unit", "what it does", "set on"), [
        (entry.key, *map(one_line, (_text(entry.value), entry.unit, entry.does, _described(entry.set_on)
                                    + (f" ({entry.how})" if entry.how else "")))) for entry in entries])


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _models(files: Sequence[Model]) -> Grid:
    return Grid.plain("models in separate files", ("file", "what it is", "set on"), [
        (model.file, one_line(model.does), one_line(_described(model.set_on))) for model in files])
