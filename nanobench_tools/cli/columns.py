"""``nanobench columns``: a column map for a table of one's own, drafted from names and numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError, UsageError
from ..steps.options import Options, one_line, write_lines
from ..tables.result_table import Table
from .closing import close
from .shared_options import PATH, shared_options

if TYPE_CHECKING:
    from ..signals.draft import ColumnDraft

MOST_LINES = 4
"""Notes, and columns that are not guessed, on one screen."""
TABLES = ("csv", "tsv", "txt", "tum", "parquet")
TO_CHECK = r"\?|check it|if it is|\baxes\b|\bFRD\b|\bNED\b"
"""In notes that ask for a look at the data, or that state turned axes."""


@click.command()
@click.argument("files", type=PATH, metavar="FILE...", nargs=-1, required=True)
@shared_options("data", "out", "jobs", "scheduler", "seed", "clock", "columns")
@click.option("--out", type=PATH, metavar="MAP.toml", help="File for the column map; it is not overwritten.")
def columns(options: Options, files: tuple[Path, ...]) -> int:
    """Draft a column map for a table, CSV or Parquet: which column is what, in which unit.

    A recording of several tables gets one map: give all of them, or their folder. Meanings come from names; units from
    names and numbers. Each unit is known, shown by the numbers, or assumed; where two are possible the command asks and
    leaves the columns out. What could not be guessed is a comment in the map. Check every line, then read the table
    with --columns MAP.toml. --out MAP.toml writes it, without overwriting, and --verbose prints it. Otherwise a table
    shows what is in it.
    """
    from ..signals.column_draft import draft_columns, draft_tables

    given = files[0] if len(files) == 1 else files[0].parent
    files = tuple(_tables_in(files[0])) if files[0].is_dir() and len(files) == 1 else files
    if folders := [file for file in files if file.is_dir()]:
        raise UsageError(f"{folders[0]} is a folder; give files, or one folder alone")
    draft = draft_columns(files[0]) if len(files) == 1 else draft_tables(files)
    file = files[0] if len(files) == 1 else given
    body = {"file": ", ".join(map(str, files)), "map": draft.text, "unknown": dict(draft.unknown),
            "notes": list(draft.notes), "questions": list(draft.questions),
            "columns": [{"stream": stream, "quantity": quantity, "column": column, "unit": unit,
                         "status": draft.status[column]}
                        for (stream, quantity), (column, unit) in draft.mapped.items()]}
    n, target, shortest = len(draft.mapped), "MAP.toml", _shortest(files, given)
    text = f"{n} of {n + len(draft.unknown)} columns mapped"
    if options.out is not None:
        target = str(options.out)
        try:
            with open(options.out, "x", encoding="utf-8") as out:
                out.write(draft.text)
        except FileExistsError:
            raise InputError(target, "is there already", "give another name or remove it") from None
        except OSError as error:
            raise InputError(target, f"cannot be written ({error.strerror})", "give another place") from None
        options.out = None
        close(options, text, "after a look at the units", "nanobench", "audit", file, "--columns", target,
              screen=[*_said(draft, options.verbose), _table("", draft)])
    elif not options.verbose:
        names = ", ".join(f.name for f in files)
        close(options, text, "keep the map", "nanobench", "columns", *shortest, "--out", target, screen=[
            *_said(draft), _table(f"Drafted from {names}; --verbose prints the map", draft)])
    elif not options.silent:  # stdout is the map alone, so that it can be redirected; its lines are never folded
        write_lines(one_line_each(draft.text).splitlines())
        options.say(f"{text}; keep the map: nanobench columns {' '.join(map(str, shortest))} --out {target}")
    return options.finish("columns", body)


def _tables_in(folder: Path) -> list[Path]:
    """The tables in a folder that no source reads."""
    found = [path for path in sorted(folder.iterdir()) if path.is_file() and path.name.partition(".")[2].split(".")[0]
             in TABLES and not path.name.startswith(".")]
    if not found:
        raise InputError(str(folder), "no table in it", f"give a file ({', '.join(TABLES)})")
    return found


def _shortest(files: Sequence[Path], given: Path) -> list[Path]:
    """The folder, if all its tables were given."""
    return [given] if given.is_dir() and list(files) == _tables_in(given) else list(files)


def _said(draft: ColumnDraft, every: bool = False) -> list[str]:
    """Every question; notes, those to check first, and columns that were not guessed, some of each unless ``every``."""
    why = [f"not guessed: {column}: {why}" for column, why in draft.unknown.items()
           if why not in "".join(draft.questions)]
    notes = sorted(draft.notes, key=lambda note: not re.search(TO_CHECK, note))
    return [*_first(notes, "notes", every), *(one_line(f"question: {q}") for q in draft.questions),
            *_first(why, "columns that are not guessed", every)]


def _first(lines: Sequence[str], what: str, every: bool) -> list[str]:
    shown = lines if every else lines[:MOST_LINES]
    more = [f"... {len(lines) - len(shown)} more {what}: --verbose"] * (len(shown) < len(lines))
    return [*map(one_line, shown), *more]


def _table(title: str, draft: ColumnDraft) -> Table:
    rows = [(stream or "time", "" if not stream else quantity, column, unit, draft.status[column])
            for (stream, quantity), (column, unit) in draft.mapped.items()]
    return Table.plain(title, ("stream", "quantity", "column", "unit", "unit is"), rows)


def one_line_each(text: str) -> str:
    """``text`` with every line fit for a terminal."""
    return "\n".join(map(one_line, text.splitlines()))
