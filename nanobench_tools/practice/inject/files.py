"""Faults of a file: columns too many or too few, cut off, cells that are no numbers. They act on the bytes of a CSV.

Signature: (data, rng, size) -> (data, truth). Times of the truth are in seconds from the first row of the file.
"""

import numpy as np

from ...auditing.faults.kind import Injection
from ...flight import Fault
from .place import truth

BAD_CELLS = (b"abc", b"", b"1.2.3", b"--", b"0x1F", b"#N/A", b"1e400")


def _lines(data: bytes) -> list[bytes]:
    return data.rstrip(b"\n").split(b"\n")


def _time(lines: list[bytes], row: int) -> float:
    """Seconds of data row ``row`` from the first; the time is the first column."""
    return float(lines[1 + row].split(b",", 1)[0]) - float(lines[1].split(b",", 1)[0])


def missing_column(data: bytes, rng: np.random.Generator, size: float = 1) -> tuple[bytes, Fault]:
    """``size`` columns other than the time are taken out."""
    table = [line.split(b",") for line in _lines(data)]
    gone = set((1 + rng.permutation(len(table[0]) - 1)[: int(size)]).tolist())
    names = [table[0][i].decode() for i in sorted(gone)]
    end = _time(_lines(data), len(table) - 2)
    out = b"\n".join(b",".join(c for i, c in enumerate(row) if i not in gone) for row in table) + b"\n"
    return out, truth("missing_column", "", names, (0.0, end), len(names), "columns", "left out")


def extra_column(data: bytes, rng: np.random.Generator, size: float = 1) -> tuple[bytes, Fault]:
    """Insert ``size`` unknown columns, at random places after the time."""
    table = [line.split(b",") for line in _lines(data)]
    names = [f"extra_{k}" for k in range(int(size))]
    for name in names:
        at = int(rng.integers(1, len(table[0]) + 1))
        values = rng.standard_normal(len(table))
        for row, value in zip(table, values, strict=True):
            row.insert(at, b"%.6f" % value)
        table[0][at] = name.encode()
    end = _time(_lines(data), len(table) - 2)
    return (b"\n".join(map(b",".join, table)) + b"\n",
            truth("extra_column", "extra", names, (0.0, end), len(names), "columns", "put in"))


def truncated(data: bytes, rng: np.random.Generator, size: float = 0.3) -> tuple[bytes, Fault]:
    """About the last ``size`` share of the bytes is gone; the cut is in the middle of a row."""
    start = data.rindex(b"\n", 0, int(len(data) * (1.0 - size)))
    cut = (start + data.index(b"\n", start + 1)) // 2
    lines = _lines(data[:cut])
    lost = len(_lines(data)) - len(lines)
    at = _time(lines, len(lines) - 3)
    return data[:cut], truth("truncated", "", (), (at, at), lost, "rows", "file cut")


def bad_cell(data: bytes, rng: np.random.Generator, size: float = 1, *, ragged: bool = False) -> tuple[bytes, Fault]:
    """``size`` cells hold text (one column, random rows); ``ragged``: the rows have a cell too few instead."""
    lines = _lines(data)
    header = lines[0].split(b",")
    column = int(rng.integers(1, len(header)))
    rows = np.sort(rng.choice(np.arange(1, len(lines) - 2), int(size), replace=False))
    for row in rows:
        cells = lines[1 + row].split(b",")
        if ragged:
            del cells[column]
        else:
            cells[column] = BAD_CELLS[int(rng.integers(len(BAD_CELLS)))]
        lines[1 + row] = b",".join(cells)
    span = _time(lines, int(rows[0])), _time(lines, int(rows[-1]))
    columns = () if ragged else (header[column].decode(),)
    return (b"\n".join(lines) + b"\n",
            truth("bad_cell", "", columns, span, len(rows), "cells", "a cell missing" if ragged else "text in a cell"))


MISSING_COLUMN = Injection(missing_column, (1, 5), "columns")
EXTRA_COLUMN = Injection(extra_column, (1, 3), "columns")
TRUNCATED = Injection(truncated, (0.001, 0.1, 0.6), "share of the bytes")
BAD_CELL = Injection(bad_cell, (1, 10), "cells", ({}, {"ragged": True}))
