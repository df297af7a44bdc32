"""Recordings of several tables, such as imu.csv and mocap.csv: one column map has a part for each (``[[table]]``).

A part names its file; a * in it stands for what the files of one recording have in common (``*_imu.csv``). Tables whose
times do not overlap are refused.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight, Stream
from .base import Source
from .column_map import ColumnMap, read_column_map
from .members import Gathered
from .payload import PACKED_SUFFIXES
from .sheets import Sheet
from .table import TableSource, cells_of, flight_of


def table_source(columns: str | Path) -> Source:
    """The source of the tables of a map."""
    column_map = read_column_map(columns)
    return JoinedTables(column_map) if column_map.tables else TableSource(column_map)


ROTATION = ("qx", "qy", "qz", "qw")


class JoinedTables:
    """Source ``table`` of a map with several tables."""

    name = "table"

    def __init__(self, column_map: ColumnMap) -> None:
        self.map = column_map
        self.parts = {pattern: TableSource(part) for pattern, part in column_map.tables.items()}
        self.version = f"1-{column_map.digest[:16]}"

    def recognises(self, path: Path, head: bytes) -> bool:
        return (part := self._part(path.name)) is not None and self.parts[part[0]].recognises(path, head)

    def why_not(self, head: bytes) -> str | None:
        return f"no table of {self.map.path} (file = {', '.join(self.parts)})"

    def _part(self, name: str) -> tuple[str, str] | None:
        """Which part a file belongs to, and what stands for its *."""
        for suffix in PACKED_SUFFIXES:
            name = name.removesuffix(suffix)
        for pattern in self.parts:
            if match := re.fullmatch("(.*)".join(map(re.escape, pattern.split("*", 1))), name):
                return pattern, "".join(match.groups())
        return None

    def wanted(self, names: Sequence[str]) -> list[str]:
        return [name for name in names if self._part(name) is not None]

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """The tables of one folder with the same text for *."""
        found: dict[tuple[Path, str], dict[str, Path]] = {}
        for path in paths:
            if (part := self._part(path.name)) is not None:
                found.setdefault((path.parent, part[1]), {})[path.name] = path
        several = {folder for folder, _ in found if sum(other == folder for other, _ in found) > 1}
        return [Gathered(folder if folder not in several else next(iter(files.values())),
                         folder if folder not in several else folder / (text.strip("_-. ") or next(iter(files))), files)
                for (folder, text), files in found.items()]

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        """One flight. InputError where two tables are of one stream, or at no time together."""
        flights: dict[str, Flight] = {}
        for name in sorted(members):
            pattern, _ = self._part(name) or ("", "")
            part = self.parts[pattern].map
            path = (place if place.is_dir() else place.parent) / name
            flights[name] = flight_of(part, cells_of(members[name], str(path), part), path, self.name)
        flight = joined(place, flights)
        lacking = [f"there is no table {pattern} with it" for pattern in self.parts
                   if pattern not in {found[0] for name in members if (found := self._part(name)) is not None}]
        return replace(flight, metadata={**flight.metadata, "read_as": [*flight.metadata["read_as"], *lacking]})


def _one_stream(place: Path, one: Stream, other: Stream) -> Stream:
    """Quantities of two tables at the times of the one with more rows, such as those of gyro.csv and accel.csv."""
    fine, coarse = (one, other) if len(one) >= len(other) else (other, one)
    both = (fine.time_s >= coarse.time_s[0]) & (fine.time_s <= coarse.time_s[-1])
    if again := set(one.quantities) & set(other.quantities):
        raise InputError(str(place), f"two of its tables have {', '.join(sorted(again))}",
                         "keep one, or one folder for each recording")
    rows, turned = fine.rows(both), [q for q in ROTATION if q in coarse.quantities]
    smooth = np.where(np.array(coarse.unit) == "rad", np.unwrap(coarse.values, axis=0), coarse.values)
    at_rows = replace(coarse, values=smooth).interpolate(coarse.quantities, rows.time_s)
    if len(turned) == len(ROTATION):
        at_rows[:, [coarse.index(q) for q in turned]] = so3.interpolate(coarse.time_s, coarse[ROTATION], rows.time_s)
    values = np.hstack([rows.values, at_rows])
    return replace(rows, values=values, columns=rows.columns + coarse.columns, unit=rows.unit + coarse.unit,
                   quantities=rows.quantities + coarse.quantities)


def joined(place: Path, flights: Mapping[str, Flight]) -> Flight:
    """One recording from those of its tables, by name of the file."""
    epoch = min(flight.epoch_s for flight in flights.values())
    streams: dict[str, Stream] = {}
    findings, assumptions, notes = [], [], []
    spans = {}
    for name, flight in flights.items():
        late = flight.epoch_s - epoch
        for key, found in flight.streams.items():
            stream = replace(found, time_s=found.time_s + late)
            if key in streams:
                notes.append(f"{', '.join(stream.quantities)} of {name} at the times of the other table of {key}")
                stream = _one_stream(place, streams[key], stream)
            streams[key] = stream
        findings += [replace(f, start_s=f.start_s + late, end_s=f.end_s + late) for f in flight.provenance.findings]
        assumptions += [a for a in flight.provenance.assumptions if a not in assumptions]
        notes += [f"{name}: {note}" for note in flight.provenance.notes]
        spans[name] = (late + flight.span.start_s, late + flight.span.end_s)
    first, last = max(spans, key=lambda n: spans[n][0]), min(spans, key=lambda n: spans[n][1])
    if spans[first][0] >= spans[last][1]:
        raise InputError(str(place), f"{last} ends {spans[first][0] - spans[last][1]:.3g} s before {first} begins: not "
                         "of one flight, or of two clocks", "give each its own folder, or mend the times")
    one = next(iter(flights.values()))
    read_as = [f"{' and '.join(flights)} are one recording"] if len(flights) > 1 else []
    return Flight(place.name, streams, {**one.metadata, "read_as": read_as}, replace(
        one.provenance, path=str(place), findings=tuple(findings), notes=tuple(notes), assumptions=tuple(assumptions)),
        epoch_s=epoch)
