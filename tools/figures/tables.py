"""Tables of the pages.

docs/figures/SOURCE.toml lays a table out:

    [tables.clocks]
    header = ["clock", "ATE mm"]
    cells = ["{ate mm.1} ({ate.ci95 mm.1})"]                   # {KEY FORMAT}; keys begin at the key of the row
    rows = [["as recorded", "clean.as-recorded"], ["joint", "clean.joint?"]]     # labels, then the key of the row
    note = "{clean.retimed.n} flights"                         # printed below; optional

A row whose key ends in `?` is left out while nothing is stored for it. A table without `cells` has its cells in `rows`.
Where the numbers come from is said below every table.
"""

import re
from collections.abc import Callable

from tools.figures.store import FigureError, Store

Fill = Callable[..., str]


def table(key: str, store: Store, fill: Fill) -> str:
    """The table `SOURCE/NAME` as Markdown with a line that says where its numbers come from."""
    source, _, name = key.partition("/")
    layout = store.layouts.get(source, {}).get("tables", {}).get(name)
    if layout is None:
        raise FigureError(f"{key}: not in docs/figures/{source}.toml")
    rows, sources = [], []
    for entry in layout["rows"]:
        if "cells" not in layout:
            rows.append([fill(cell, base=source) for cell in entry])
            sources += [m for cell in entry for m in re.findall(r"\{([\w-]+)/", cell)]
            continue
        *labels, place = entry
        base = place.rstrip("?")
        base = base if "/" in base else f"{source}/{base}"
        if place.endswith("?") and not (store.has(base) and store.node(base) is not None):
            continue
        sources.append(base.partition("/")[0])
        rows.append([*labels, *(fill(cell, base=base) for cell in layout["cells"])])
    note = fill(layout.get("note", ""), base=source)
    return markdown(layout["header"], rows, layout.get("labels")) + f"\n\n{origin(sources or [source], store, note)}"


def markdown(header: list[str], rows: list[list[str]], labels: int | None = None) -> str:
    """A Markdown table; every row has as many cells as the header. labels: how many first columns are text; those
    behind them are numbers, aligned to the right (None: all to the left)."""
    for row in rows:
        if len(row) != len(header):
            raise FigureError(f"row {row[0]!r} has {len(row)} cells, the header {len(header)}")
    text = len(header) if labels is None else labels
    lines = [header, ["---"] * text + ["---:"] * (len(header) - text), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def origin(names: list[str], store: Store, note: str = "") -> str:
    """One line: real or SYNTHETIC, command, version and date of every source that is stored."""
    commands: dict[tuple[str, str, str], list[str]] = {}
    for name in dict.fromkeys(names):
        if "command" in (of := store.sources.get(name, {})):
            commands.setdefault((of["data"], of["version"], of["date"]), []).append(f"`{of['command']}`")
    whence = [
        f"{data}; {', '.join(dict.fromkeys(typed))}, version {version}, {when}"
        for (data, version, when), typed in commands.items()
    ]
    return f"*{'. '.join(filter(None, [note.rstrip('.'), *whence]))}.*"


def settings() -> str:
    """Numbers set by looking at data (nanobench_tools.settings), by part and by what they were set on."""
    from nanobench_tools.settings import everything, recordings

    counts: dict[tuple[str, str], int] = {}
    for entry in everything().values():
        counts[entry.area, entry.set_on] = counts.get((entry.area, entry.set_on), 0) + 1
    rows = []
    for (area, name), n in sorted(counts.items(), key=lambda item: (item[0][0], -item[1])):
        on = recordings()[name]
        rows.append([f"`nanobench settings {area}`", str(n), ": ".join(filter(None, (on.n, on.what))), on.kind])
    return markdown(["part", "settings", "set on", "real or SYNTHETIC"], rows)
