"""Tables and sentences as lines of a terminal. Words and numbers are never cut. Where the width does not suffice,
spreads are left out first. Then text is folded between words. Then long words of sentences (topics, paths) are broken.
Then columns are left out and listed, or stacked below each other."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace

from .quantities import DASH, MINUS
from .result_table import Cell, Column, Score, Table, score_text

GAP = 2
FOLDED = 14
"""Least width of a column whose text is folded."""
UNBROKEN = 24
"""Characters of a word of a sentence that stay together; a number has fewer."""
NAMED = 4
"""Columns left out that are named."""
UNBOUNDED = 100_000
"""Width of a file or a pipe: a row is one line."""
Row = list[str]


def folded(text: str, width: int) -> list[str]:
    """The lines of a text, broken between words; a single word that is longer than the width is broken anywhere."""
    return [line for part in text.split("\n") for line in (textwrap.wrap(part, width, break_on_hyphens=False) or [""])]


def lines_of(table: Table, width: int, stack: bool = False, most: int | None = None) -> list[str]:
    """The table within ``width``; at most ``most`` lines, the last saying how many rows are left out. ``stack``:
    columns that do not fit are placed below instead of being left out."""
    table = table.for_readers()
    table = table.keep([i for i, c in enumerate(table.columns)
                        if i == 0 or c.kind != "text" or not table.rows or any(row[i] for row in table.rows)])
    blocks, without = _blocks(table, width, stack)
    head, note = folded(table.title, width) if table.title else [], folded(table.note, width) if table.note else []
    if without:
        names = ", ".join(without[:NAMED]) + f" and {len(without) - NAMED} more" * (len(without) > NAMED)
        note += folded(f"Left out at this width: {names}.", width)
    room = None if most is None else most - len(head) - len(note)
    return [*head, *(line for block in blocks for line in _drawn(block, width, room)), *note]


def _blocks(table: Table, width: int, stack: bool) -> tuple[list[Table], list[str]]:
    """Tables that fit, one below the other, and the headings of the columns that are in none."""
    for spreads in ("all", "first", "none"):
        if _widths(table, width, spreads) is not None:
            return [table], []
    if _widths(table, width, "none", broken=True) is not None:
        return [table], []
    first = next((i for i, c in enumerate(table.columns) if c.kind != "text"), 1) or 1
    lead, others = list(range(first)), list(range(first, len(table.columns)))
    blocks: list[Table] = []
    while others:
        taken = len(others)
        while taken > 1 and _fits(table, [*lead, *others[:taken]], width) is None:
            taken -= 1
        blocks.append(table.keep([*lead, *others[:taken]]))
        others = others[taken:]
        if not stack:
            return blocks, [table.columns[i].heading for i in others]
    return blocks or [table], []


def _fits(table: Table, keep: list[int], width: int) -> list[int] | None:
    return _widths(table.keep(keep), width, "none")


def _widths(table: Table, width: int, spreads: str, broken: bool = False) -> list[int] | None:
    """The width of every column, None where they do not fit. Text is folded, the widest column first. ``broken``: long
    words of sentences are, too."""
    rows = _texts(table, spreads)
    natural = [max((len(row[i]) for row in rows), default=0) for i in range(len(table.columns))]
    found = [max(n, _longest(_whole(c.heading))) for n, c in zip(natural, table.columns, strict=True)]
    least = [max(min(n, max(FOLDED, *(_longest(row[i], broken) for row in rows))) if rows and c.kind == "text" else n,
                 _longest(_whole(c.heading))) for i, (n, c) in enumerate(zip(natural, table.columns, strict=True))]
    over = sum(found) + GAP * (len(found) - 1) - width
    while over > 0:
        i = max(range(len(found)), key=lambda k: (found[k] - least[k] > 0, found[k]))
        if found[i] <= least[i]:
            return None
        found[i] -= 1
        over -= 1
    return found


def _whole(heading: str) -> str:
    """A heading whose percent sign stays with its number."""
    return heading.replace(" %", "\u00a0%")


def _longest(text: str, broken: bool = False) -> int:
    longest = max(map(len, text.split(" ")))
    return min(longest, UNBROKEN) if broken and " " in text else longest


def _texts(table: Table, spreads: str) -> list[Row]:
    first = next((i for i, c in enumerate(table.columns) if c.kind == "score"), -1)
    return [[_text(cell, c, spreads == "all" or (spreads == "first" and i == first), spreads != "none" or i == first)
             for i, (c, cell) in enumerate(zip(table.columns, row, strict=True))] for row in table.rows]


def _text(cell: Cell, column: Column, interval: bool, deviation: bool) -> str:
    if isinstance(cell, Score):
        middle, ends = score_text(cell if deviation else replace(cell, std=None), column)
        text = " ".join(filter(None, (middle, ends if interval else "")))
        return text.replace(MINUS, "-").replace(DASH, "-")
    return "-" if cell in (None, "") and column.kind != "text" else " ".join(str("" if cell is None else cell).split())


def _drawn(table: Table, width: int, most: int | None) -> list[str]:
    """One block: headings, a rule, rows; at most ``most`` lines."""
    spreads = next((s for s in ("all", "first", "none") if _widths(table, width, s) is not None), "none")
    widths = _widths(table, width, spreads) or _widths(table, width, spreads, broken=True) or _forced(table, width)
    right = [c.kind != "text" for c in table.columns]
    heads = [folded(_whole(c.heading), w) for c, w in zip(table.columns, widths, strict=True)]
    lines = [*_row(heads, widths, right), "-" * (sum(widths) + GAP * (len(widths) - 1))] if any(
        c.heading for c in table.columns) else []
    texts = _texts(table, spreads)
    for k, row in enumerate(texts):
        drawn = _row([folded(text, w) for text, w in zip(row, widths, strict=True)], widths, right)
        last = k == len(texts) - 1
        if most is not None and len(lines) + len(drawn) + (not last) > most:
            left = len(texts) - k
            return [*lines, f"... {left} more row{'s' * (left != 1)}: --verbose"]
        lines += drawn
    return lines


def _forced(table: Table, width: int) -> list[int]:
    """Of a table that fits in no way: the columns share the width."""
    each = max(1, (width - GAP * (len(table.columns) - 1)) // len(table.columns))
    return [each] * len(table.columns)


def _row(cells: Sequence[list[str]], widths: Sequence[int], right: Sequence[bool]) -> list[str]:
    height = max(map(len, cells))
    filled = [[*lines, *[""] * (height - len(lines))] for lines in cells]
    return [(" " * GAP).join(line.rjust(w) if r else line.ljust(w) for line, w, r in zip(
        at, widths, right, strict=True)).rstrip() for at in zip(*filled, strict=True)]
