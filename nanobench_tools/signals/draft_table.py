"""A table that nobody described, read for a draft: CSV or Parquet, numbers apart from dates and text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError, UsageError
from ..settings import count
from ..sources.cells import read_grid, read_text_columns
from ..sources.column_names import meaning, unit_of, words_of
from ..sources.dates import ISO, looks_like_dates, seconds_of_dates
from ..sources.dialect import normalise_text
from ..sources.discover import sources
from ..sources.header import NO_NAMES, find_header, is_number
from ..sources.mocap_export import program_of
from ..sources.payload import HEAD_BYTES, read_file, unpack
from ..sources.strangers import of_program
from ..sources.table import PARQUET_MAGIC
from .draft import TIME

WITHOUT_NAMES = {"rosbag": "write a map of its topics: docs/recordings.md",
                 "tum": "for a map, write names above its rows: t x y z qx qy qz qw"}
"""Source -> how to get a map where its files name no columns."""
OF_ROWS = frozenset({"id", "body", "rb", "drone", "vehicle", "agent", "sensor", "instance", "marker", "uav", "topic"})
"""Last words of columns of numbers that state of what a row is."""
MOST_KINDS, TURNS = 20, 0.2
"""Largest number of them, and the share of rows in which another one begins."""
SAMPLE = 1 << 20
"""Bytes of a table that are searched for thousands separators."""
MARKS = ",.' \N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}\N{FIGURE SPACE}"
DIGITS = re.compile(rf"[+-]?\d[\d{re.escape(MARKS)}]*")
GROUPED_CELLS = count("audit.draft_table.grouped_cells")


@dataclass(frozen=True)
class Table:
    """Columns of numbers and of dates; names of those that hold text; units of a row of units."""

    values: dict[str, np.ndarray]
    dates: dict[str, np.ndarray]
    texts: list[str]
    units: Mapping[str, str]


def read_table(path: Path) -> Table:
    """InputError for a file that is no table."""
    place = str(path)
    data = unpack(read_file(path), place).data
    if data.startswith(PARQUET_MAGIC):
        return _parquet(data, place)
    if program := program_of(data):
        raise InputError(place, f"an export of {program}, which needs no map", "nanobench audit reads it as it is")
    header = None if b"\x00" in data else find_header(normalise_text(data[: 1 << 16]))
    if header is None or (header.names and not any(c.isalpha() for c in "".join(header.names))):
        if source := next((n for n, s in sources().items() if s.recognises(path, data[:HEAD_BYTES])), ""):
            raise InputError(place, f"a recording of the source {source}, which nanobench audit reads as it is",
                             WITHOUT_NAMES.get(source, "convert it to a table (nanobench convert) for a map"))
        if header is None:
            raise InputError(place, "is no table of text", of_program(data) or "give a CSV or Parquet file")
        raise InputError(place, *NO_NAMES)
    if _one_variable_a_row(header.names):
        raise InputError(place, "long format: one variable per row, a name and its value",
                         "pivot it to one column per variable, for example pandas.DataFrame.pivot")
    stamps = [n for n in header.names if meaning(n) == TIME]
    grid = read_grid(data, place, time=stamps[0] if stamps else None)
    if twice := [n for n in grid.repeated if isinstance(meaning(n), tuple)]:
        appear = "appears" if len(twice) == 1 else "appear"
        raise InputError(place, f"{', '.join(map(repr, twice))} {appear} twice in the line of names",
                         "rename them, so that each names one column")
    if grouped := _thousands(data[:SAMPLE], place, [*grid.columns, *grid.text]):
        name, cell = grouped
        raise InputError(f"{place}: column {name}", f"{cell!r} has a thousands separator or a decimal comma",
                         "write plain numbers with a point")
    if set(grid.text) & {"name", "variable", "key", "signal"} and "value" in grid.columns:
        raise InputError(place, "long format: one variable per row, a name and its value",
                         "pivot it to one column per variable, for example pandas.DataFrame.pivot")
    dates = {}
    cells = read_text_columns(data, place, grid.text)[0] if grid.text else {}
    of_rows = {n: c for n, c in cells.items() if not looks_like_dates(c)} | {
        n: [f"{v:g}" for v in c] for n, c in grid.columns.items() if set(words_of(n)[0][-1:]) & OF_ROWS}
    for name, kinds in of_rows.items():
        if several := _alternating(kinds):
            raise InputError(f"{place}: column {name}", f"rows of {', '.join(several)} take turns: they are of several "
                             "sensors or bodies", "write the rows of each to a separate table")
    if cells:
        for name, c in cells.items():
            try:
                if looks_like_dates(c) and np.isfinite(seconds := seconds_of_dates(c, unit_of(name) or ISO)).any():
                    dates[name] = seconds
            except UsageError as error:
                if not stamps or name in stamps:
                    raise InputError(f"{place}: column {name}", *str(error).split("? ", 1)) from None
    values = {name: np.asarray(column, dtype=float) for name, column in grid.columns.items()}
    return Table(values, dates, [n for n in grid.text if n not in dates], grid.units)


def _one_variable_a_row(names: Sequence[str]) -> bool:
    """Whether the first line is a row such as ``1.000,33577,stateEstimate.z,0.500``."""
    numbers = [is_number(n) for n in names]
    return 2 < len(names) < 6 and numbers.count(False) == 1 and numbers[0] and numbers[-1]


def _alternating(cells: Sequence[str]) -> list[str]:
    """The few texts that take turns in a column from row to row; empty where each stays for long."""
    filled = [c for c in cells if c and c != "nan"]
    several = sorted(set(filled))
    changes = sum(a != b for a, b in pairwise(filled))
    return several if 1 < len(several) <= MOST_KINDS and changes > TURNS * len(filled) > 1.0 else []


def _thousands(data: bytes, place: str, names: Sequence[str]) -> tuple[str, str] | None:
    """A column whose numbers have a mark between groups of three digits from 1000 on, and one of its cells."""
    columns, _, dialect = read_text_columns(data.rpartition(b"\n")[0] or data, place, names)
    for name, cells in columns.items():
        filled = [c for c in cells if c]
        if not all(map(DIGITS.fullmatch, filled)):
            continue
        for mark in MARKS:
            grouped = [c for c in filled if mark in c]
            plain = [c for c in filled if mark not in c]
            of_groups = re.compile(rf"[+-]?[1-9]\d{{0,2}}({re.escape(mark)}\d{{3}})+([.,]\d*)?")
            if len(grouped) < GROUPED_CELLS or not all(map(of_groups.fullmatch, grouped)):
                continue
            small = all(len(re.split(r"[.,]", c.lstrip("+-"))[0]) < 4 for c in plain)
            if small and (mark != dialect.decimal or (plain and all(c.lstrip("+-").isdigit() for c in plain))):
                return name, grouped[0]
    return None


def _parquet(data: bytes, place: str) -> Table:
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(place, f"cannot be read as Parquet ({str(error).splitlines()[0]})",
                         "take another copy") from None
    kinds = {name: table.schema.field(name).type for name in table.column_names}
    numbers = {name: table.column(name).to_numpy().astype(float) for name, kind in kinds.items()
               if pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)}
    dates = {name: 1e-9 * table.column(name).cast(pa.timestamp("ns", tz=kind.tz)).cast(pa.int64()).to_numpy()
             for name, kind in kinds.items() if pa.types.is_timestamp(kind)}
    return Table(numbers, dates, [name for name in kinds if name not in {*numbers, *dates}], {})
