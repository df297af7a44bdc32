"""How a verb ends: its result in a line or two, and the next command, which works when it is pasted."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from ..steps.options import Options, one_line, screen_height, screen_width, write_lines
from ..tables.result_table import Table
from ..tables.terminal import folded, lines_of

WORDS = "nanobench.words"
"""Where the context keeps the words of the command line."""
PROMPT = 1
"""Lines of a terminal for the prompt that follows."""
LONGEST_COMMAND = 320
"""Characters of a next command: four lines of a narrow terminal."""


def close(options: Options, result: str, why: str = "", *command: object, screen: Sequence[Table | str] = (),
          detail: Sequence[Table | str] = (), lines: int = 0, first: bool = False) -> None:
    """Print the end of a verb: its screen, its result, and the next ``command`` (its words) with its purpose ``why``.

    The ``screen`` is cut to the terminal, or to ``lines``. ``first`` keeps all rows of its first table.
    ``--verbose`` prints all of ``detail`` instead.
    """
    if options.silent:
        return
    width = screen_width()
    terminal = sys.stdout.isatty()
    tail = [] if not result else folded(one_line(result), width) if terminal else [one_line(result)]
    if command:
        text = f"Next, {one_line(why)}: {one_line(shlex.join(map(str, command)))}"
        if len(text) > LONGEST_COMMAND and len(options.data) > 1:
            text = f"Next, {one_line(why)}: nanobench {command[1]}, with the same paths"
        tail.append(text)  # one line, so that it can be copied; a terminal folds it
    if options.verbose:
        for part in detail or screen:
            options.show(part)
    else:
        height = sum(-(-len(line) // width) or 1 for line in tail)
        if sys.stderr.isatty():
            height += sum(len(folded(text, width)) for text in (*options.said, *options.failures()))
        _show_within(options, screen, max(screen_height(), lines) - PROMPT - height, first)
    write_lines(tail)


def _show_within(options: Options, parts: Sequence[Table | str], lines: int, first: bool) -> None:
    """The parts on ``lines``. Where they do not fit, rows of the longest tables are left out and counted, then the
    last tables. ``first``: the last tables before rows of the first one."""
    width = screen_width()
    sizes = [len(lines_of(part, width) if isinstance(part, Table) else folded(part, width)) for part in parts]
    least = [_with_one_row(part, width) if isinstance(part, Table) else size
             for part, size in zip(parts, sizes, strict=True)]
    tables = [i for i, part in enumerate(parts) if isinstance(part, Table)]
    dropped: list[int] = []
    cut = least[tables[0]] if tables else 0
    if first and tables:
        least[tables[0]] = sizes[tables[0]]
    while sum(least) + bool(dropped) > lines and len(tables) > 1:
        dropped.append(tables.pop())
        least[dropped[-1]] = sizes[dropped[-1]] = 0
    if tables:
        least[tables[0]] = least[tables[0]] if len(tables) > 1 else cut
    limits = list(sizes)
    while sum(limits) + bool(dropped) > lines and (
            longer := [i for i, shortest in enumerate(least) if limits[i] > shortest]):
        limits[max(longer, key=lambda i: limits[i])] -= 1
    for i, part in enumerate(parts):
        if i not in dropped:
            options.show(part, limits[i] if limits[i] < sizes[i] else None)
    if dropped:
        options.show(f"... {len(dropped)} more table{'s' * (len(dropped) > 1)}: --verbose")


def _with_one_row(table: Table, width: int) -> int:
    """Lines of a table that is cut to its headings, its first row and the number of the others. All rows decide how
    wide the columns are."""
    whole = len(lines_of(table, width))
    none = f"... {len(table.rows)} more row"
    return next((most for most in range(1, whole) if not any(
        line.startswith(none) for line in lines_of(table, width, most=most))), whole)


def shortened(text: str, characters: int = 600) -> str:
    """The first sentences of a text."""
    return text if len(text) <= characters else f"{text[:characters].rpartition('. ')[0]}. More: --verbose"


def again(*more: object) -> list[object]:
    """The words of this command, and ``more`` behind them: an option, and its value if it takes one. It replaces that
    option where the command has it."""
    context = click.get_current_context(silent=True)
    words = list(context.meta.get(WORDS, ())) if context is not None else []
    for at in reversed([i for i, word in enumerate(words) if more and str(word).partition("=")[0] == more[0]]):
        del words[at:at + (1 if "=" in str(words[at]) else len(more))]
    return ["nanobench", *words, *more]


def same(options: Options) -> list[object]:
    """What makes another verb read the same recordings: their paths and the column map."""
    return [*options.data, *(["--columns", options.columns] if options.columns is not None else [])]


def shown_page(path: Path) -> tuple[str, ...]:
    """The command that opens a page."""
    return ("python", "-m", "webbrowser", str(path.absolute()))


def close_scores(options: Options, result: str, kind: str, screen: Sequence[Table | str] = (),
                 detail: Sequence[Table | str] = (), scored: bool = False) -> None:
    """Of a verb that scores methods: its page where results were written, else a method of one's own. scored: the user
    has one already."""
    if options.out is not None:
        close(options, result, "as a page with pictures", "nanobench", "report", options.out, *_recordings(options),
              screen=screen, detail=detail)
    elif scored:
        close(options, result, "as files", *again("--out", "results"), screen=screen, detail=detail)
    else:
        close(options, result, f"your {kind} next to these", "nanobench", "new", kind, f"my_{kind}",
              screen=screen, detail=detail)


def _recordings(options: Options) -> list[object]:
    columns = [] if options.columns is None else ["--columns", options.columns]
    return [*(word for path in options.data for word in ("--data", path)), *columns]
