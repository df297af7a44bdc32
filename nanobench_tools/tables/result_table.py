"""One table model for the terminal, the page, the spreadsheet, LaTeX and pandas, so that all show the same rows."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .quantities import DASH, MINUS, format_number, number

if TYPE_CHECKING:
    import pandas as pd

SENTENCE = 30
"""Characters from which on a cell that begins like a number is a sentence."""
_NUMBER = re.compile(r"[-+−±]?\d|-$|–$")
NOT_GIVEN = "the results hold no value: the metric does not apply to this row or could not be computed"


@dataclass(frozen=True)
class Score:
    """A number with its spread, in SI. ``reason`` says why ``mean`` is None; ``exact``: it was published with the
    column's decimals and gets no further ones."""

    mean: float | None
    std: float | None = None
    median: float | None = None
    p90: float | None = None
    low: float | None = None
    high: float | None = None
    reason: str = NOT_GIVEN
    exact: bool = False

    @classmethod
    def of(cls, found: Any, ci95: Any = None, reason: str = NOT_GIVEN, exact: bool = False) -> Score:
        """From a plain number, ``{mean | value, std, median, p90, ci95: [lo, hi], n}``, or an empty value.

        One flight (``n`` = 1) has no deviation, even if one is given.
        """
        body = found if isinstance(found, Mapping) else {"mean": found}
        interval = body.get("ci95", ci95) or (None, None)
        mean = number(body.get("mean", body.get("value")))
        if mean is None:
            mean = number(body.get("median"))
        std = None if body.get("n") == 1 else number(body.get("std"))
        return cls(mean, std, number(body.get("median")), number(body.get("p90")),
                   number(interval[0]), number(interval[1]), str(body.get("reason") or reason), exact)


@dataclass(frozen=True)
class Column:
    """``kind``: ``text``, ``count``, ``number`` (formatted already) or ``score``. An SI score times ``factor`` is in
    ``unit``. ``aside``: only in the CSV file, so that the page and the LaTeX table stay readable. ``noted``: long
    texts, shown as numbers explained under the table."""

    key: str
    title: str
    kind: str = "text"
    unit: str = ""
    factor: float = 1.0
    decimals: int = 3
    aside: bool = False
    noted: bool = False

    @property
    def heading(self) -> str:
        return f"{self.title} [{self.unit}]" if self.unit else self.title


Cell = str | int | None | Score


@dataclass(frozen=True)
class Table:
    """``name`` is the stem of its files, ``title`` its caption; a row has one cell per column. Rows after the first
    ``main`` are in the CSV file only; None means all are main."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    main: int | None = None

    @classmethod
    def plain(cls, title: str, heads: Sequence[str], rows: Sequence[Sequence[Cell]], note: str = "",
              name: str = "") -> Table:
        """From formatted cells. A column is right-aligned if all cells begin like numbers and none is a sentence."""
        kinds = ["number" if rows and all(_NUMBER.match(str(row[i] or "-")) and len(str(row[i])) < SENTENCE
                                          for row in rows) and any(row[i] for row in rows) else "text"
                 for i in range(len(heads))]
        columns = tuple(Column(head, head, kind) for head, kind in zip(heads, kinds, strict=True))
        return cls(name, title, columns, tuple(map(tuple, rows)), note)

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame: a column per column, scores in SI with their intervals as ``KEY_low`` and ``KEY_high``."""
        import pandas as pd

        found: dict[str, list[Any]] = {}
        for i, column in enumerate(self.columns):
            cells = [row[i] for row in self.rows]
            if column.kind != "score":
                found[column.key] = cells
                continue
            scores = [cell if isinstance(cell, Score) else Score(None) for cell in cells]
            found[column.key] = [score.mean for score in scores]
            if any(score.low is not None for score in scores):
                found[f"{column.key}_low"] = [score.low for score in scores]
                found[f"{column.key}_high"] = [score.high for score in scores]
        return pd.DataFrame(found)

    def without_empty_columns(self) -> Table:
        """The same table less the score columns in which no row has a number."""
        def has_number(i: int) -> bool:
            cells = (row[i] for row in self.rows)
            return any(isinstance(cell, Score) and cell.mean is not None for cell in cells)

        return self.keep([i for i, column in enumerate(self.columns) if column.kind != "score" or has_number(i)])

    def for_readers(self) -> Table:
        """The same table without the rows and columns of the CSV file alone, long texts moved to the note."""
        table = replace(self, rows=self.rows[:self.main], main=None)
        for i, column in enumerate(self.columns):
            if column.noted:
                texts = [text for text in dict.fromkeys(str(row[i] or "") for row in table.rows) if text]
                marks = {text: str(k + 1) for k, text in enumerate(texts)}
                rows = tuple((*row[:i], marks.get(str(row[i] or ""), ""), *row[i + 1:]) for row in table.rows)
                notes = "; ".join(f"{mark}: {text}" for text, mark in marks.items())
                note = f"{table.note} {column.title} {notes}." if notes else table.note
                table = replace(table, rows=rows, note=note)
        return table.keep([i for i, column in enumerate(self.columns) if not column.aside])

    def without_published(self) -> Table:
        """Less published values and the rows of the published protocol."""
        theirs = [i for i, row in enumerate(self.rows) if row[-1] == "published" or self._protocol(row)]
        return self._rows([i for i in range(len(self.rows)) if i not in theirs])

    def published(self) -> Table:
        """Published values, each with the row below it for comparison, and the corrected protocol."""
        found = {i for i, row in enumerate(self.rows) if row[-1] == "published" or self._protocol(row)}
        pairs = sorted(found | {i + 1 for i in found if self.rows[i][-1] == "published"})
        keep = [i for i in pairs if i < len(self.rows)]
        return self._rows(keep if any(self.rows[i][-1] == "published" for i in keep) else [])

    def _protocol(self, row: tuple[Cell, ...]) -> bool:
        return any(c.key == "protocol" and str(cell).startswith("as-published")
                   for c, cell in zip(self.columns, row, strict=True))

    def _rows(self, keep: Sequence[int]) -> Table:
        main = None if self.main is None else sum(i < self.main for i in keep)
        return replace(self, rows=tuple(self.rows[i] for i in keep), main=main)

    def select(self, heads: Mapping[str, str], where: Callable[[Mapping[str, Cell]], bool] = lambda row: True,
               title: str | None = None, note: str | None = None) -> Table:
        """The rows that match ``where`` ({key: cell}), with the columns ``heads`` ({key: title}) in this order. Keys
        that the table lacks are ignored."""
        keys = [column.key for column in self.columns]
        rows = tuple(row for row in self.rows if where(dict(zip(keys, row, strict=True))))
        found = replace(self, rows=rows, main=None).keep([keys.index(key) for key in heads if key in keys])
        columns = tuple(replace(c, title=heads[c.key], aside=False, noted=False) for c in found.columns)
        return replace(found, columns=columns, title=self.title if title is None else title,
                       note=self.note if note is None else note)

    def without_column(self, key: str) -> Table:
        return self.keep([i for i, column in enumerate(self.columns) if column.key != key])

    def keep(self, keep: Sequence[int]) -> Table:
        """The same table with these columns alone."""
        return replace(self, columns=tuple(self.columns[i] for i in keep),
                       rows=tuple(tuple(row[i] for i in keep) for row in self.rows))


def score_text(cell: Score, column: Column) -> tuple[str, str]:
    """Printed cells: (``mean ± std``, ``[low, high]``), the second empty without an interval."""
    if cell.mean is None:
        return DASH, ""
    mean = cell.mean * column.factor

    def text(value: float) -> str:
        return format_number(value * column.factor, column.decimals, cell.exact, like=mean)

    spread = text(cell.std) if cell.std else ""  # flights that do not differ have no deviation
    if cell.std and not cell.exact and not spread.strip("0."):
        spread = f"{cell.std * column.factor:.1g}"
    middle = text(cell.mean) + (f" ± {spread}" if spread else "")
    return middle, "" if cell.low is None or cell.high is None else f"[{text(cell.low)}, {text(cell.high)}]"


_SPREAD = (("std", "std"), ("median", "median"), ("p90", "p90"), ("ci95_low", "low"), ("ci95_high", "high"))


def to_csv(table: Table) -> str:
    """The table for a spreadsheet: one column per number, unit in the heading, empty if missing.

    Text that a spreadsheet would take for a formula (first character = + - @ or a control) gets an apostrophe.
    """
    out = io.StringIO(newline="")
    writer = csv.writer(out)
    spreads = {c.key: [(label, name) for label, name in _SPREAD
                       if any(isinstance(r[i], Score) and getattr(r[i], name) is not None for r in table.rows)]
               for i, c in enumerate(table.columns) if c.kind == "score"}
    heading: list[str] = []
    for c in table.columns:
        if c.kind == "score":
            unit = f" [{_ascii_unit(c.unit)}]" if c.unit else ""
            heading += [c.key + unit, *(f"{c.key} {label}{unit}" for label, _ in spreads[c.key])]
        else:
            heading.append(c.key)
    writer.writerow(heading)
    for row in table.rows:
        line: list[Any] = []
        for c, cell in zip(table.columns, row, strict=True):
            if c.kind == "score":
                names = ["mean", *(name for _, name in spreads[c.key])]
                values = [getattr(cell, name) if isinstance(cell, Score) else None for name in names]
                line += ["" if v is None else float(f"{v * c.factor:.10g}") for v in values]
            else:
                line.append(_spreadsheet_text(cell))
        writer.writerow(line)
    return out.getvalue()


def _ascii_unit(unit: str) -> str:
    return unit.replace("²", "^2")


def _spreadsheet_text(cell: Cell) -> str | int:
    if cell is None or isinstance(cell, Score):
        return ""
    if isinstance(cell, int):
        return cell
    return "'" + cell if cell[:1] in ("=", "+", "-", "@", "\t", "\r") else cell


_LATEX = {"\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "_": r"\_", "%": r"\%",
          "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
          "|": r"\textbar{}", '"': r"\textquotedbl{}", "±": r"$\pm$", DASH: "--", MINUS: "$-$",
          "²": r"\textsuperscript{2}", "\n": " ", "\r": " "}


def latex_escape(text: str) -> str:
    """Text in which LaTeX finds no command: every special character is replaced."""
    return "".join(_LATEX.get(character, character) for character in text)


def to_latex(table: Table, label: str = "") -> str:
    """A bare ``tabular`` that needs no package, to be \\input into a table environment."""
    table = table.for_readers()
    align = "".join("l" if c.kind == "text" else "r" for c in table.columns)
    lines = [f"% {_one_line(table.title)}" + (f" ({label})" if label else ""),
             rf"\begin{{tabular}}{{{align}}}", r"\hline",
             " & ".join(latex_escape(c.heading) for c in table.columns) + r" \\", r"\hline"]
    for row in table.rows:
        cells = []
        for c, cell in zip(table.columns, row, strict=True):
            if isinstance(cell, Score):
                cells.append(latex_escape(" ".join(filter(None, score_text(cell, c)))))
            else:
                cells.append("--" if cell in (None, "") else latex_escape(str(cell)))
        lines.append(" & ".join(cells) + r" \\")
    note = [f"% {_one_line(table.note)}"] if table.note else []
    return "\n".join([*lines, r"\hline", r"\end{tabular}", *note, ""])


def _one_line(text: str) -> str:
    return " ".join(text.split())


def write_tables(out_dir: Path, tables: list[Table], label: str = "") -> list[Path]:
    """Writes ``<name>.csv`` (UTF-8 with the mark spreadsheets look for) and ``<name>.tex`` of every table."""
    from ..results.result_files import write_bytes

    written = []
    for table in tables:
        for suffix, data in ((".csv", to_csv(table).encode("utf-8-sig", "replace")),
                             (".tex", to_latex(table, label).encode(errors="replace"))):
            path = Path(out_dir) / f"{table.name}{suffix}"
            write_bytes(path, data)
            written.append(path)
    return written
