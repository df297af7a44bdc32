"""A column map drafted for a table that nobody described: meanings by name, units by what the numbers can be.

The units are found as the audit finds unit faults: the table is read as its names say, and what is then a factor off
(gravity, battery, full command, the motion capture) gets the unit with that factor.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..flight import STREAM_QUANTITIES
from ..sources.cells import read_grid
from ..sources.column_map import FORCE_UNITS, PWM_STREAMS, PWM_UNITS, SCHEMA, UNITS
from ..sources.column_names import NUMBERED, guessed, meaning, words_of
from ..sources.header import header_of
from ..sources.payload import read_file, unpack
from ..sources.table import PARQUET_MAGIC, TableSource
from ..units import factor
from .context import Context
from .plausible_ranges import SLOWEST_STEP_S
from .unit_sign_errors import wrong_units

QUATERNION = ("qx", "qy", "qz", "qw")
Key = tuple[str, str]


@dataclass(frozen=True)
class ColumnDraft:
    """``text``: the map as TOML; ``mapped``: {(stream, quantity): (column, unit)}, time as ("", "time"); ``unknown``:
    {column: why nothing was guessed}; ``notes``: what was found in the numbers, and what to check."""

    text: str
    mapped: Mapping[Key, tuple[str, str]]
    unknown: Mapping[str, str]
    notes: tuple[str, ...]


def draft_columns(path: Path) -> ColumnDraft:
    """The draft for one table, CSV or Parquet. Raises InputError for a file that is no table or has no time column."""
    place = str(path)
    data = unpack(read_file(path), place).data
    values, texts = _numbers_of(data, place)
    found, unknown = guessed(values)
    notes: list[str] = []
    if ("", "time") not in found:
        seen = ", ".join(repr(name) for name in values)
        also = f"; of text: {', '.join(map(repr, texts))}" if texts else ""
        raise InputError(place, f"no column is named like a time; its columns: {seen}{also}",
                         "call one of them t (or time, timestamp); write dates as seconds since 1970")
    for stream in dict.fromkeys(stream for stream, _ in found):
        _order_turn(stream, found, values, unknown, notes)
        _check_turn(stream, found, values, unknown, notes)
    if len(found) == 1:
        raise InputError(place, f"no column beside {found['', 'time']!r} has a name that is known",
                         "name them like px, acc_x, gyro_x, m1, vbat, or write the map by hand: docs/recordings.md")
    units = {key: _stated(key, column, notes) for key, column in found.items()}
    units["", "time"] = _time_unit(found["", "time"], values, units["", "time"], notes)
    _mend_units(path, data, found, units, notes)
    if assumed := [column for key, column in found.items() if not words_of(column)[1] and len(_allowed(key)) > 1
                   and not any(note.startswith(f"{column}: ") or note.startswith(f"{column} ") for note in notes)]:
        notes.append(f"no unit is stated for {', '.join(assumed)}: the one below is assumed, since the numbers show no "
                     "other; check it")
    mapped = {key: (column, units[key]) for key, column in found.items()}
    return ColumnDraft(_toml(path, mapped, unknown, notes), mapped, unknown, tuple(notes))


def _numbers_of(data: bytes, place: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of numbers, and the names of those that hold text."""
    if data.startswith(PARQUET_MAGIC):
        try:
            table = pq.read_table(pa.BufferReader(data))
        except (pa.ArrowException, OSError, ValueError) as error:
            raise InputError(place, f"cannot be read as Parquet ({str(error).splitlines()[0]})",
                             "take another copy") from None
        kinds = {name: table.schema.field(name).type for name in table.column_names}
        numbers = {name: table.column(name).to_numpy().astype(float) for name, kind in kinds.items()
                   if pa.types.is_floating(kind) or pa.types.is_integer(kind)}
        return numbers, [name for name in kinds if name not in numbers]
    if b"\x00" in data and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(place, "is no table of text", "give a CSV or Parquet file")
    time = next((name for name in header_of(data)[0] if meaning(name) == ("", "time")), None)
    grid = read_grid(data, place, time=time)  # stamps since 1970 in ms are larger than any measurement
    return {name: np.asarray(column, dtype=float) for name, column in grid.columns.items()}, grid.text


def _order_turn(stream: str, found: dict[Key, str], values: Mapping[str, np.ndarray], unknown: dict[str, str],
                notes: list[str]) -> None:
    """Gives q0 .. q3 their letters where one order alone has the vehicle upright; a turn about z looks upright in the
    other, too, where it is half a turn."""
    columns = [column for digit in NUMBERED if (column := found.pop((stream, f"q{digit}"), None))]
    if not columns:
        return
    upright = []
    if len(columns) == len(QUATERNION):
        parts = np.stack([values[c] for c in columns], axis=1)
        for order in (("qw", "qx", "qy", "qz"), QUATERNION):
            x, y = (parts[:, order.index(q)] for q in ("qx", "qy"))
            if np.nanmedian(1.0 - 2.0 * (x * x + y * y)) > 0.0:
                upright.append(order)
    if len(upright) != 1:
        why = "of a quaternion by number: the scalar is the first or the last, and these numbers do not tell which"
        unknown.update(dict.fromkeys(columns, why))
        return
    found.update({(stream, quantity): column for quantity, column in zip(upright[0], columns, strict=True)})
    scalar = columns[upright[0].index("qw")]
    notes.append(f"{scalar}: the scalar, since only then is the vehicle upright")


def _check_turn(stream: str, found: dict[Key, str], values: Mapping[str, np.ndarray], unknown: dict[str, str],
                notes: list[str]) -> None:
    """Takes out what is called a quaternion and is none: four numbers of length 1."""
    turn = [found[stream, q] for q in QUATERNION if (stream, q) in found]
    if not turn:
        return
    length = float(np.nanmedian(np.linalg.norm(np.stack([values[c] for c in turn], axis=1), axis=1)))
    if len(turn) == len(QUATERNION) and np.isfinite(length) and round(length) == 1:
        notes.append(f"{', '.join(turn)} have length {length:.3f}: a quaternion")
        return
    for quantity in QUATERNION:
        if column := found.pop((stream, quantity), None):
            unknown[column] = (f"{len(turn)} of 4 parts of a quaternion" if len(turn) < len(QUATERNION) else
                               f"{', '.join(turn)} have length {length:.3g}, a quaternion has 1")


def _allowed(key: Key) -> tuple[str, ...]:
    stream, quantity = key
    if key == ("", "time"):
        return UNITS["s"]
    if stream in PWM_STREAMS:
        return (*PWM_UNITS, *(FORCE_UNITS if stream == "command" else ()))
    return UNITS[STREAM_QUANTITIES[stream][quantity][0]]


def _stated(key: Key, column: str, notes: list[str]) -> str:
    """The unit that the name states, if a map can hold it; else the SI unit."""
    unit, allowed = words_of(column)[1], _allowed(key)
    if unit and unit not in allowed:
        notes.append(f"{column}: its unit {unit!r} is none of {', '.join(allowed)}")
    return unit if unit in allowed else allowed[0]


def _time_unit(column: str, values: Mapping[str, np.ndarray], stated: str, notes: list[str]) -> str:
    steps = np.diff(values[column])
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not len(steps):
        notes.append(f"{column} never grows: is it the time?")
        return stated
    step = float(np.median(steps))
    if step * factor(stated) <= SLOWEST_STEP_S:
        return stated
    unit = next((u for u in UNITS["s"] if step * factor(u) <= SLOWEST_STEP_S), stated)
    if unit != stated:
        notes.append(f"{column}: rows are {step:g} apart, so it is in {unit}")
    return unit


def _mend_units(path: Path, data: bytes, found: Mapping[Key, str], units: dict[Key, str], notes: list[str]) -> None:
    """Sets the units that the audit of the table, read as drafted so far, finds to be others."""
    with tempfile.TemporaryDirectory() as folder:
        drafted = Path(folder) / "columns.toml"
        mapped = {key: (column, units[key]) for key, column in found.items()}
        drafted.write_text(_toml(path, mapped, {}, ()), encoding="utf-8")
        flight = TableSource(drafted).read(path, data)
    for wrong in Context(flight).once(wrong_units):
        for quantity in wrong.quantities:
            key = (wrong.stream, quantity)
            if key not in units:
                continue
            right = factor(units[key]) / wrong.factor
            unit = min(_allowed(key), key=lambda u: abs(np.log(factor(u) / right)))
            if unit != units[key]:
                unsure = "; cm are as possible, check it" if unit == "mm" and key[0] == "mocap" else ""
                notes.append(f"{found[key]}: {unit}, since {wrong.evidence}{unsure}")
                units[key] = unit
            else:
                notes.append(f"{found[key]}: check its unit, {wrong.evidence}")


def _toml(path: Path, mapped: Mapping[Key, tuple[str, str]], unknown: Mapping[str, str],
          notes: tuple[str, ...] | list[str]) -> str:
    def quoted(text: str) -> str:
        return json.dumps(text, ensure_ascii=not text.isprintable())

    def comment(text: str) -> str:
        return "# " + "".join(c if c.isprintable() else "?" for c in text)

    time, unit = mapped["", "time"]
    lines = [comment(f"Drafted from {path.name}: check every line."), *(comment(note) for note in notes),
             f'schema = "{SCHEMA}"', f"time = {{column = {quoted(time)}, unit = {quoted(unit)}}}"]
    for stream in dict.fromkeys(stream for stream, _ in mapped if stream):
        lines += ["", f"[streams.{stream}]"]
        lines += [f"{quantity} = {{column = {quoted(column)}, unit = {quoted(u)}}}"
                  for (s, quantity), (column, u) in mapped.items() if s == stream]
    if unknown:
        lines += ["", "# Not guessed:", *(comment(f"{column}: {why}") for column, why in unknown.items())]
    return "\n".join(lines) + "\n"
