"""What a source format has to be, and how faults seen while reading are written down.

A new format is one file with a class like this and one line under ``nanobench.sources`` in setup.cfg.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from ..flight import Fault, Flight, Stream
from .cells import Grid
from .sheets import Sheet

MAX_FINDINGS = 50
"""Bad stretches of one stream listed one by one; the rest is summed up in one more finding."""


@runtime_checkable
class Source(Protocol):
    """A file format.

    ``version`` is raised whenever the same bytes would give another Flight. With the code of this package it is part
    of the key of the cache.
    ``recognises`` decides from the first bytes of the unpacked content alone. ``read`` gets the whole unpacked content
    and the sheet that belongs to it, if any, and raises InputError without a recording in it. Its ``path`` is for
    messages and for the label of the flight.
    """

    @property
    def name(self) -> str: ...

    @property
    def version(self) -> int | str: ...

    def recognises(self, path: Path, head: bytes) -> bool: ...

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight: ...


@runtime_checkable
class SeveralVehicles(Source, Protocol):
    """A format whose recordings may have several vehicles, each a flight. ``vehicles`` labels them, by one empty label
    where there is one; ``of`` is the source of one of them."""

    def vehicles(self, path: Path, parts: Sequence[bytes]) -> tuple[str, ...]: ...

    def of(self, vehicle: str) -> Source: ...


@runtime_checkable
class SheetSource(Source, Protocol):
    """A format whose recordings have sheets. They are matched by time, so the time of the first row is needed early."""

    def start_unix_s(self, head: bytes) -> float | None: ...

    def with_sheet(self, flight: Flight, sheet: Sheet, own: bool) -> Flight: ...


def row_edges(time_s: np.ndarray) -> np.ndarray:
    """(n + 1,) s: borders between rows, halfway between their times, so that a span can cut single rows."""
    if not len(time_s):
        return np.zeros(1)
    if len(time_s) == 1:
        return np.array([time_s[0] - 0.005, time_s[0] + 0.005])
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    return np.concatenate(([1.5 * time_s[0] - 0.5 * time_s[1]], middle, [1.5 * time_s[-1] - 0.5 * time_s[-2]]))


def _runs(rows: np.ndarray) -> list[np.ndarray]:
    """Consecutive stretches of sorted indices."""
    return np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []


def cell_faults(grid: Grid, time_s: np.ndarray, kept: np.ndarray, streams: Mapping[str, str]) -> list[Fault]:
    """bad_cell findings of a Grid: one per stretch of rows and stream, naming stream, column, row and line.

    time_s (n,) s of the rows that were kept; kept (n,) their indices in the Grid; ``streams``: column -> stream.
    Rows that were left out count for every stream (``stream`` empty).
    """
    edges = row_edges(time_s)
    position = np.full(len(grid.lines) + 1, -1)
    position[kept] = np.arange(len(kept))
    by_stream: dict[str, dict[str, np.ndarray]] = {}
    for column, bad in grid.bad.items():
        if column in streams and len(rows := position[bad.rows][position[bad.rows] >= 0]):
            by_stream.setdefault(streams[column], {})[column] = rows
    faults = []
    for stream, columns in by_stream.items():
        stretches = _runs(np.unique(np.concatenate(list(columns.values()))))
        if len(stretches) > MAX_FINDINGS:
            stretches[MAX_FINDINGS - 1 :] = [np.concatenate(stretches[MAX_FINDINGS - 1 :])]
        for rows in stretches:
            hit = {c: r[np.isin(r, rows)] for c, r in columns.items()}
            hit = {c: r for c, r in hit.items() if len(r)}
            count = sum(map(len, hit.values()))
            first = min(hit, key=lambda c: hit[c][0])
            row = int(kept[hit[first][0]])
            what = grid.bad[first].what.get(row, "no number")
            more = f"; {count} cells in {len(rows)} rows" if count > 1 else ""
            faults.append(
                Fault("bad_cell", stream, tuple(hit), float(edges[rows[0]]), float(edges[rows[-1] + 1]), float(count),
                      "cells", f"column {first}, row {row + 1} (line {int(grid.lines[row])}): {what}{more}")
            )
    return faults + _lost_faults(grid, time_s, kept)


def _lost_faults(grid: Grid, time_s: np.ndarray, kept: np.ndarray) -> list[Fault]:
    """Rows left out: ragged lines and rows whose time cannot be read. The span is the hole they leave."""
    n = len(time_s)
    holes: dict[int, list[str]] = {}
    for lost in grid.lost:
        after = int(np.searchsorted(kept, lost.after, side="right")) - 1
        holes.setdefault(after, []).append(f"line {lost.line}: {lost.reason}")
    faults = []
    for after, reasons in sorted(holes.items()):
        start = float(time_s[max(after, 0)]) if n else 0.0
        end = float(time_s[min(after + 1, n - 1)]) if n else 0.0
        more = f" (and {len(reasons) - 1} more rows)" if len(reasons) > 1 else ""
        faults.append(Fault("bad_cell", "", (), min(start, end), max(start, end), float(len(reasons)), "rows",
                            f"row left out, {reasons[0]}{more}"))
    if len(faults) > MAX_FINDINGS:
        rest = faults[MAX_FINDINGS - 1 :]
        faults[MAX_FINDINGS - 1 :] = [
            Fault("bad_cell", "", (), rest[0].start_s, rest[-1].end_s, sum(f.size for f in rest), "rows",
                  f"{len(rest)} further stretches of rows left out, first {rest[0].evidence}")
        ]
    return faults


def text_fault(kind: str, stream: str, columns: tuple[str, ...], evidence: str, span: tuple[float, float],
               size: float = float("nan"), unit: str = "1") -> Fault:
    """A finding about the file as a whole or about one column."""
    return Fault(kind, stream, columns, span[0], span[1], size, unit, evidence)


def not_numbers(streams: Mapping[str, Stream]) -> list[Fault]:
    """One bad_cell finding per stream that holds values which are none."""
    faults = []
    for name, stream in streams.items():
        wrong = np.isnan(stream.values)
        if not wrong.any():
            continue
        rows, columns = np.flatnonzero(wrong.any(axis=1)), np.flatnonzero(wrong.any(axis=0))
        edges = row_edges(stream.time_s)
        names = tuple(stream.columns[i] for i in columns)
        first = names[int(np.argmax(wrong[rows[0], columns]))]
        faults.append(
            text_fault(
                "bad_cell",
                name,
                names,
                f"column {first}, record {rows[0] + 1}: no number a measurement could have; {wrong.sum()} values in "
                f"{len(rows)} records",
                (float(edges[rows[0]]), float(edges[rows[-1] + 1])),
                float(wrong.sum()),
                "cells",
            )
        )
    return faults
