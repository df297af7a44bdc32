"""How a verb ends: its result in a line or two, and the next command, which works when it is pasted."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from ..steps.options import Options, one_line

WORDS = "nanobench.words"
"""Where the context keeps the words of the command line."""


def close(options: Options, result: str, why: str = "", *command: object) -> None:
    """Shows ``result`` and, where there is one, the next ``command`` (its words) and what it is for."""
    if result:
        options.show(one_line(result))
    if command:
        options.show(f"Next, {one_line(why)}: {one_line(shlex.join(map(str, command)))}", fold=False)


def again(*more: object) -> list[object]:
    """The words of this command, and ``more`` behind them."""
    context = click.get_current_context(silent=True)
    return ["nanobench", *(context.meta.get(WORDS, ()) if context is not None else ()), *more]


def same(options: Options) -> list[object]:
    """What makes another verb read the same recordings: their paths and the column map."""
    return [*options.data, *(["--columns", options.columns] if options.columns is not None else [])]


def shown_page(path: Path) -> tuple[str, ...]:
    """The command that opens a page."""
    return ("python", "-m", "webbrowser", str(path.absolute()))


def close_scores(options: Options, result: str, kind: str) -> None:
    """Of a verb that scores methods: its page where results were written, else a method of one's own."""
    if options.out is not None:
        close(options, result, "as a page with pictures", "nanobench", "report", options.out, *_recordings(options))
    else:
        close(options, result, f"a {kind} of your own beside these", "nanobench", "new", kind, f"my_{kind}")


def _recordings(options: Options) -> list[object]:
    return [word for path in options.data for word in ("--data", path)]
