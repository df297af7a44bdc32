"""Tables of scores for a person at a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from ..metrics.statistics import Summary
from .options import one_line

if TYPE_CHECKING:
    from rich.table import Table

    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..protocols.published import MeanStd
    from ..protocols.result_rows import Ratios
    from ..results.fitted_values import LeftOut
    from .options import Options


def data_word(options: Options) -> str:
    """``real`` or ``SYNTHETIC``: what every table says about its data."""
    return "SYNTHETIC" if options.synthetic else "real"


def score_text(found: Summary | MeanStd | None, factor: float, digits: int) -> str:
    """``mean ± std`` of a summary, in units of 1/factor; ``-`` where the metric is not defined. Flights that do not
    differ, or one alone, have no deviation; one too small for the digits gets one that shows it."""
    if found is None or found.mean is None:
        return "-"
    text = f"{factor * found.mean:.{digits}f}"
    if not found.std:
        return text
    spread = f"{factor * found.std:.{digits}f}"
    if not float(spread):
        spread = f"{factor * found.std:.1g}"
    return f"{text} ± {spread}"


def interval_text(found: Summary | MeanStd | None, factor: float, digits: int) -> str:
    """``lo .. hi`` of a summary; ``-`` where it has none (one flight, one session)."""
    if not isinstance(found, Summary) or not found.ci95:
        return "-"
    return " .. ".join(f"{factor * edge:.{digits}f}" for edge in found.ci95)


def sessions_text(sessions: int | None) -> str:
    """How many sessions the flights of a row are of; ``?`` where that is unknown."""
    return "?" if sessions is None else str(sessions)


def rich_table(title: str, left: Iterable[str] = (), right: Iterable[str] = (), wrapped: Iterable[str] = ()) -> Table:
    """An empty table: headings of columns to the left, of numbers to the right, and of columns that may wrap."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for head in left:
        table.add_column(head, no_wrap=True)
    for head in right:
        table.add_column(head, justify="right")
    for head in wrapped:
        table.add_column(head)
    return table


def score_table(title: str, heads: Sequence[str], columns: Sequence[tuple[str, str, float, int]],
                lines: Sequence[tuple[Sequence[str], Mapping[str, Summary | MeanStd]]]) -> Table:
    """A table with ``heads`` and one column per (metric, heading, factor, digits); ``lines`` are (heads, metrics).

    The first metric also gets a column with its interval.
    """
    from rich.markup import escape

    table = rich_table(title, heads)
    for i, (_, heading, _, digits) in enumerate(columns):
        # on a narrow screen a score breaks after its mean, never inside a number
        widest = max([len(word) for word in heading.split()] + [digits + 4])
        table.add_column(heading, justify="right", min_width=widest)
        if i == 0:
            table.add_column("95 %", justify="right", min_width=widest)
    name, _, factor, digits = columns[0]
    for texts, metrics in lines:
        cells = [score_text(metrics.get(n), f, d) for n, _, f, d in columns]
        table.add_row(*map(escape, texts), cells[0], interval_text(metrics.get(name), factor, digits), *cells[1:])
    return table


def show_ratios(options: Options, rows: Sequence[tuple[str, Ratios | None]],
                columns: Sequence[tuple[str, str, float, int]], key: str = "") -> None:
    """A table of ratios, with the name of their row, by (metric, heading, ...); key: which of several horizons. Nothing
    where no row has one."""
    def cell(found: Ratios, metric: str) -> str:
        ratio, ends = found.ratio.get(metric), found.ci95.get(metric)
        return ratio_text(ratio[key], (ends or {})[key]) if ratio and key else ratio_text(ratio, ends)

    compared = [(name, found) for name, found in rows if found is not None]
    shown = [column for column in columns if any(cell(found, column[0]) != "-" for _, found in compared)]
    if not shown:
        return
    title = ("Error over that of another row, the same flights and windows drawn for both: ratio (95 %). An interval "
             "that holds 1 shows no difference.")
    table = rich_table(title, ("row", "over"),
                       [heading.removesuffix(" mm").removesuffix(" m") for _, heading, _, _ in shown])
    for name, found in compared:
        table.add_row(one_line(name), one_line(found.to), *(cell(found, metric) for metric, *_ in shown))
    options.detail(table)


def ratio_text(ratio: float | None, ci95: Sequence[float] | None) -> str:
    """``0.930 (0.881 .. 0.992)``; without interval the ratio alone."""
    if ratio is None:
        return "-"
    return f"{ratio:.3f}" + (f" ({ci95[0]:.3f} .. {ci95[1]:.3f})" if ci95 else "")


ALL_FAILED = "every method failed on it"
"""Reason for a recording that was tried but that no row counts."""


MOST_REASONS = 2


def say_reasons(options: Options, reasons: Iterable[tuple[str, str]]) -> None:
    """(recording, why it is left out), a line each; without ``--verbose`` the first ones, and how many more."""
    every = list(reasons)
    shown = every if options.verbose else every[:MOST_REASONS]
    for name, reason in shown:
        options.say(f"left out: {one_line(name)}: {one_line(reason)}")
    if more := len(every) - len(shown):
        options.say(f"left out: {more} more recording{'s' * (more != 1)}: --verbose")


def show_left_out(options: Options, flights: Sequence[Flight], used: Iterable[str],
                  audits: Mapping[str, Audit] | Iterable[str], needed: Mapping[str, Sequence[str]],
                  reasons: Mapping[str, str] | None = None) -> list[LeftOut]:
    """The recordings that no row counts (``used``: those that one does), said in a line.

    reasons: by name of the flight, where the verb knows why.
    """
    from ..auditing.usable import left_out

    found = left_out(flights, set(used), audits, needed, reasons)
    if found:
        kinds = Counter("copy or slice" if entry.reason.startswith(("copy of", "slice of")) else entry.reason
                        for entry in found)
        options.say("left out: " + "; ".join(f"{n} ({kind})" for kind, n in kinds.items()))
    return found
