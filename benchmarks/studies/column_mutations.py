"""One column of every table of bug reports changed: read right, asked about, or silently wrong?

It is removed, renamed, negated, swapped with the next, or rescaled. Separators and decimal commas are changed as well.

``python benchmarks/studies/column_mutations.py [FOLDER]`` counts outcomes over the tables below FOLDER (default
``../shared/data/reports``) and lists silent errors. A silent error is a value in SI that differs from that of the
whole table, in a flight whose audit reports no fault. Its unit is neither marked as assumed nor questioned.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import NanobenchError
from nanobench_tools.flight import Flight
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

SCALES = (1000.0, 0.001, 100.0, 180.0 / np.pi, np.pi / 180.0)
"""Millimetres, kilometres and centimetres for metres, degrees for radians and the reverse."""
SAYING = frozenset({"unit", "frame", "body_frame", "axis_swap", "sign", "quaternion_order", "bad_cell", "coarse_time",
                    "no_common_time", "saturated_sensor", "gyro_bias", "never_flew", "constant_offset",
                    "backward_time"})
"""Kinds of fault that say of a quantity that it is not what it should be, rather than of rows that some are lost."""
QUATERNION = ("qx", "qy", "qz", "qw")
SUFFIXES = (".csv", ".tsv", ".txt", ".tum")
SAME = 1e-6
"""Relative difference of two readings of one value."""
SAME_ROW = 1e-3
"""Difference of two times, in rows: written times are rounded."""


@dataclass(frozen=True)
class Reading:
    """A flight as read; ``doubted``: quantities whose unit is assumed; ``asked``: whether a question was put."""

    flight: Flight
    doubted: frozenset[tuple[str, str]]
    asked: bool


@dataclass(frozen=True)
class Sheet:
    """The text of a table: lines above the names, names, rows."""

    above: tuple[str, ...]
    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    delimiter: str

    def text(self) -> str:
        join = self.delimiter.join
        return "\n".join([*self.above, *([join(self.names)] if self.names else []), *map(join, self.rows)]) + "\n"

    def without(self, k: int) -> Sheet:
        return Sheet(self.above, _without(self.names, k), tuple(_without(r, k) for r in self.rows), self.delimiter)

    def renamed(self, k: int) -> Sheet:
        return Sheet(self.above, (*self.names[:k], "foo", *self.names[k + 1:]), self.rows, self.delimiter)

    def swapped(self, k: int) -> Sheet:
        def change(cells: tuple[str, ...]) -> tuple[str, ...]:
            return (*cells[:k], cells[k + 1], cells[k], *cells[k + 2:])

        return Sheet(self.above, self.names, tuple(map(change, self.rows)), self.delimiter)

    def scaled(self, k: int, by: float) -> Sheet:
        return Sheet(self.above, self.names, tuple((*r[:k], _times(r[k], by), *r[k + 1:]) for r in self.rows),
                     self.delimiter)


def _without(cells: tuple[str, ...], k: int) -> tuple[str, ...]:
    return (*cells[:k], *cells[k + 1:])


def _times(cell: str, by: float) -> str:
    try:
        return repr(by * float(cell))
    except ValueError:
        return cell


def sheet_of(text: str) -> Sheet:
    """Rows are the longest run of lines at the end with one number of cells; the line before has the names."""
    lines = text.splitlines()
    delimiter = max(("\t", ";", ",", " "), key=lambda d: min((line.count(d) for line in lines[-5:]), default=0))
    split = [tuple(line.split(delimiter)) for line in lines]
    like_last = [len(row) == len(split[-1]) for row in split]
    first = next((i for i, row in enumerate(split) if like_last[i] and all(map(_number_or_empty, row))),
                 like_last.index(True) + 1)
    named = first > 0 and len(split[first - 1]) == len(split[-1])
    return Sheet(tuple(lines[: first - named]), split[first - 1] if named else (), tuple(split[first:]), delimiter)


def _number_or_empty(cell: str) -> bool:
    try:
        return not cell.strip() or float(cell) is not None
    except ValueError:
        return False


def read(path: Path) -> Reading | None:
    """As a user reads it: without a map where that works, else by the draft. None where it is refused in one line."""
    known = load_recordings([path], cache=False)
    if known.flights:
        return Reading(known.flights[0], frozenset(), False)
    try:
        draft = draft_columns(path)
        written = path.with_suffix(".toml")
        written.write_text(draft.text, encoding="utf-8")
        loaded = load_recordings([path], columns=written, cache=False)
        written.unlink()
    except NanobenchError:
        return None
    doubted = frozenset(key for key, (column, _) in draft.mapped.items() if draft.status[column] == "assumed")
    if not loaded.flights:
        return None
    if any(line.startswith("time = ") and "assumed" in line for line in draft.text.splitlines()):
        doubted |= {(name, "t") for name in loaded.flights[0].streams}
    return Reading(loaded.flights[0], doubted, bool(draft.questions))


def outcome(whole: Reading, found: Reading | None) -> tuple[str, str]:
    """(right, refused, asked, assumed, audited, open or SILENT; the first quantity that differs). Open: the audit lists
    the column as unchecked.

    Only a new fault in a quantity that differs counts as said, and only of a kind in ``SAYING``."""
    if found is None:
        return "refused", ""
    differs = [(s, q) for s, q in _quantities(found.flight) if not _same(whole.flight, found.flight, s, q)]
    sure = [key for key in differs if key not in found.doubted]
    if not differs:
        return "right", ""
    first = ".".join((sure or differs)[0])
    if not sure:
        return "assumed", first
    if found.asked:
        return "asked", first
    before = {(f.kind, f.stream, f.columns) for f in audit(whole.flight).faults}
    faults = {f"{f.kind} {f.stream} {','.join(f.columns)}" for f in audit(found.flight).faults
              if (f.kind, f.stream, f.columns) not in before and f.kind in SAYING
              and (not f.columns or any((f.stream == s and {q, _column(found.flight, s, q)} & set(f.columns))
                                        or q in f.evidence.split() or q == "t" in f.columns for s, q in sure))}
    if faults:
        return "audited", f"{first}: {'; '.join(sorted(faults))}"
    left = " ".join(audit(found.flight).unchecked)
    return ("open" if all(f" {q}" in left.replace(",", "") for _, q in sure) else "SILENT"), first


def _same(whole: Flight, found: Flight, stream: str, quantity: str) -> bool:
    if stream not in whole or (quantity != "t" and quantity not in whole[stream]):
        return quantity == "t"  # values that the whole table does not give differ
    ours, theirs = (f[stream].time_s if quantity == "t" else f[stream][quantity] for f in (found, whole))
    if quantity in QUATERNION and len(ours) == len(theirs) and all(n in f[stream] for f in (found, whole)
                                                                   for n in QUATERNION):
        ours = ours * np.sign((found[stream][QUATERNION] * whole[stream][QUATERNION]).sum(axis=1))  # q and -q are one
    within = SAME_ROW * abs(float(np.nanmedian(np.diff(theirs)))) if quantity == "t" and len(theirs) > 1 else 1e-12
    return len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=SAME, atol=within, equal_nan=True)


def _column(flight: Flight, stream: str, quantity: str) -> str:
    return "t" if quantity == "t" else flight[stream].columns[flight[stream].quantities.index(quantity)]


def _quantities(flight: Flight) -> Iterator[tuple[str, str]]:
    """Without columns that are only carried along, which no command uses."""
    for name, stream in flight.streams.items():
        yield from ((name, q) for q in ("t", *stream.quantities) if not name.startswith("extra"))


def mutations(sheet: Sheet) -> Iterator[tuple[str, Sheet]]:
    if sheet.delimiter != ",":
        yield "decimal commas", replace(sheet, rows=tuple(tuple(c.replace(".", ",") for c in r) for r in sheet.rows))
    else:
        commas = tuple(tuple(c.replace(".", ",") for c in r) for r in sheet.rows)
        yield "semicolons and decimal commas", replace(sheet, rows=commas, delimiter=";")
        yield "tabs", replace(sheet, delimiter="\t")
    for k in range(len(sheet.rows[0])):
        name = sheet.names[k].strip() if sheet.names else f"column {k + 1}"
        yield f"{name} removed", sheet.without(k)
        if sheet.names:
            yield f"{name} renamed", sheet.renamed(k)
        if k + 1 < len(sheet.rows[0]):
            yield f"{name} swapped with the next", sheet.swapped(k)
        for by in (-1.0, *SCALES):
            yield f"{name} times {by:.4g}", sheet.scaled(k, by)


def main(folder: Path) -> None:
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        for table in sorted(p for p in folder.rglob("*") if p.suffix in SUFFIXES):
            path = Path(scratch) / table.name
            path.write_bytes(table.read_bytes())
            whole = read(path)
            if whole is None:
                print(f"{table.parent.name}/{table.name}: not read")
                continue
            of_table: Counter[str] = Counter()
            for what, sheet in mutations(sheet_of(table.read_text(encoding="utf-8-sig"))):
                path.write_text(sheet.text(), encoding="utf-8")
                kind, where = outcome(whole, read(path))
                of_table[kind] += 1
                if kind in ("SILENT", "audited"):
                    print(f"  {kind} {table.parent.name}/{table.name}: {what}: {where}", flush=True)
            print(f"{table.parent.name}/{table.name}: {dict(of_table)}", flush=True)
            path.unlink()
            counts += of_table
    print(f"{counts['SILENT']} of {sum(counts.values())} silently wrong: {dict(counts)}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data/reports"))
