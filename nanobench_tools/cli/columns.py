"""``nanobench columns``: a column map for a table of one's own, drafted from names and numbers."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ..errors import InputError, UsageError
from ..steps.options import Options, one_line, write_lines
from ..tables.result_table import Table
from .closing import close
from .shared_options import PATH, shared_options


@click.command()
@click.argument("file", type=PATH, metavar="FILE")
@shared_options("data", "jobs", "scheduler", "seed", "clock", "columns")
def columns(options: Options, file: Path) -> int:
    """Draft a column map for a table, CSV or Parquet: which column is what, in which unit.

    Meanings come from names; units from names and numbers. Each unit is known, shown by the numbers, or assumed; where
    two are possible the command asks and leaves the columns out. What could not be guessed is a comment in the map.
    Check every line, then read the table with --columns MAP.toml.
    --out MAP.toml writes it, without overwriting; else it is printed.
    """
    from ..signals.column_draft import draft_columns

    if file.is_dir():
        raise UsageError(f"{file} is a folder; give one file of it")
    draft = draft_columns(file)
    body = {"file": str(file), "map": draft.text, "unknown": dict(draft.unknown), "notes": list(draft.notes),
            "questions": list(draft.questions),
            "columns": [{"stream": stream, "quantity": quantity, "column": column, "unit": unit,
                         "status": draft.status[column]}
                        for (stream, quantity), (column, unit) in draft.mapped.items()]}
    target, written = "MAP.toml", options.out is not None
    screen: list[Table | str] = []
    if options.out is None and sys.stdout.isatty() and not options.verbose:
        rows = [(stream or "time", "" if not stream else quantity, column, unit, draft.status[column])
                for (stream, quantity), (column, unit) in draft.mapped.items()]
        screen = [*draft.notes, *(f"question: {q}" for q in draft.questions),
                  Table.plain(f"Drafted from {file.name}; --verbose prints the map",
                              ("stream", "quantity", "column", "unit", "unit is"), rows)]
    elif options.out is None and not options.silent:
        write_lines(one_line_each(draft.text).splitlines())  # a line of a map is never folded
    elif options.out is not None:
        target = str(options.out)
        try:
            with open(options.out, "x", encoding="utf-8") as out:
                out.write(draft.text)
        except FileExistsError:
            raise InputError(target, "is there already", "give another name or remove it") from None
        except OSError as error:
            raise InputError(target, f"cannot be written ({error.strerror})", "give another place") from None
        for note in draft.notes:
            options.show(one_line(note))
        for question in draft.questions:
            options.show(one_line(f"question: {question}"))
        for column, why in draft.unknown.items():
            if why not in "".join(draft.questions):
                options.show(one_line(f"not guessed: {column}: {why}"))
        options.out = None
    n = len(draft.mapped)
    text = f"{n} of {n + len(draft.unknown)} columns mapped"
    if written:
        close(options, text, "after a look at the units", "nanobench", "audit", file, "--columns", target)
    else:
        close(options, text, "keep the map", "nanobench", "columns", file, "--out", target, screen=screen)
    return options.finish("columns", body)


def one_line_each(text: str) -> str:
    """``text`` with every line fit for a terminal."""
    return "\n".join(map(one_line, text.splitlines()))
