"""The column map of a user's own table (``--columns FILE``): which column is what, in which unit, with which sign.

Everything wrong with it is an InputError that names the key and the line.
"""

from __future__ import annotations

import hashlib
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, UsageError, did_you_mean
from ..flight import STREAM_QUANTITIES, Assumption, Stream
from ..units import to_si
from .axes import Frame, frame_of, in_our_axes
from .dates import DATE_UNITS
from .payload import read_file

SCHEMA = "nanobench-columns/1"
TABLE = "table"
"""Key of the maps of several tables."""

UNITS: dict[str, tuple[str, ...]] = {
    "m": ("m", "mm", "cm", "in", "ft"),
    "1": ("1",),
    "rad": ("rad", "deg", "mrad"),
    "m/s": ("m/s", "mm/s", "cm/s", "in/s", "ft/s", "km/h", "mph"),
    "rad/s": ("rad/s", "deg/s", "mrad/s", "mdeg/s", "rpm"),
    "m/s^2": ("m/s^2", "g", "mg", "mm/s^2"),
    "V": ("V", "mV"),
    "N": ("N", "mN", "gram_force", "kgf", "lbf"),
    "A": ("A", "mA"),
    "s": ("s", "ms", "us", "ns", "min", "h"),
}
"""SI unit of a quantity -> units a table may give it in."""

MESSAGE_TIME = "header.stamp"
"""A map of topics needs no time column: messages carry their own timestamps."""

SENSES = {"pitch": ("nose down", "nose up"), "yaw": ("counter-clockwise", "clockwise")}
"""Angles whose sign differs between programs: ours, and the other."""
ENTRY_KEYS = ("column", "index", "unit", "sign", "offset", "assumed", "invalid")
PWM_UNITS = ("1", "pwm16", "%", "pulse_us", "dshot")
PWM_STREAMS = frozenset({"motor", "motor_request", "command"})
FORCE_UNITS = UNITS["N"]
"""A collective command may also be a force."""


@dataclass(frozen=True)
class Entry:
    """One quantity: ``value_SI = sign * to_si(cell, unit) + offset`` (or of the cell's element ``index``).

    ``assumed``: nothing shows the unit; ``invalid``: the cell that means no reading; ``other_si``: SI unit of the value
    where it is not the vocabulary's.
    """

    stream: str
    quantity: str
    column: str
    index: int | None = None
    unit: str = "1"
    sign: float = 1.0
    offset: float = 0.0
    assumed: bool = False
    invalid: float | None = None
    other_si: str = ""

    def to_si(self, cells: np.ndarray) -> np.ndarray:
        """(n,) cells as found -> SI, NaN where there is no reading."""
        if self.invalid is not None:
            cells = np.where(cells == self.invalid, np.nan, cells)
        return self.sign * to_si(cells, self.unit) + self.offset

    @property
    def topic(self) -> str | None:
        """Of a column ``/topic.field.path`` of a ROS bag (``/topic:body`` for one body of a list of poses); None for a
        column of a table."""
        topic, _, field = self.column.partition(".")
        return topic if field and topic.startswith("/") else None

    @property
    def field(self) -> str:
        """Field behind the topic."""
        return self.column.partition(".")[2]


@dataclass(frozen=True)
class ColumnMap:
    """``time`` is an Entry of stream ``""``. A second column ``time_rest`` is added to it (nanoseconds to seconds);
    ``rate_hz`` turns numbers of frames into seconds; ``frames``: stream -> the axes it was recorded in; vehicle as
    found; ``digest`` of the file's bytes keys the cache."""

    path: str
    time: Entry
    entries: tuple[Entry, ...]
    vehicle: Mapping[str, Any]
    digest: str
    time_rest: Entry | None = None
    rate_hz: float | None = None
    frames: Mapping[str, Frame] = field(default_factory=dict)
    chosen: Mapping[str, str] = field(default_factory=dict)
    """Stream -> topic of a bag that is read as its type is meant."""
    tables: Mapping[str, ColumnMap] = field(default_factory=dict)
    """Name of a file, * for what its files have in common -> its map, of a recording of several tables."""

    @property
    def times(self) -> tuple[Entry, ...]:
        """The entries of the time: one, or two."""
        return (self.time,) if self.time_rest is None else (self.time, self.time_rest)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the table that are needed, each once."""
        return tuple(dict.fromkeys(e.column for e in (*self.times, *self.entries)))

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """Units, and signs of pitch and yaw, that nothing shows."""
        why = f"{Path(self.path).name} marks it as assumed"
        return tuple(Assumption(e.stream, e.column, ", ".join(
                         filter(None, (e.unit, sense_of(e.stream, e.quantity, e.sign)))), why)
                     for e in (*self.times, *self.entries) if e.assumed)

    def turned(self, name: str, stream: Stream) -> Stream:
        """``stream`` from the axes that the map names for it into ours. InputError names the stream."""
        if name not in self.frames:
            return stream
        try:
            return in_our_axes(stream, self.frames[name])
        except UsageError as error:
            raise InputError(f"{self.path}: streams.{name}.frame", str(error), "name their columns, too") from None

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of a bag that are needed, each once; none for a map of tables."""
        return tuple(dict.fromkeys(e.topic for e in self.entries if e.topic is not None))


def sense_of(stream: str, quantity: str, sign: float) -> str:
    """``positive nose down``: of an angle whose sign differs between programs; "" for others."""
    senses = SENSES.get(quantity) if stream == "attitude" else None
    return f"positive {senses[sign < 0]}" if senses else ""


class _Reader:
    """The text of the map, so that an error can name the line; of a part of it, from the line ``above`` on."""

    def __init__(self, path: Path, text: str, above: int = 0) -> None:
        self.path, self.lines, self.above = str(path), text.splitlines(), above

    def fail(self, key: str, found: str, advice: str) -> InputError:
        return InputError(f"{self.path}: line {self.above + self._line(key)}, {key}", found, advice)

    def _line(self, key: str) -> int:
        """Line of a dotted key: the table header above it, then the key itself."""
        section, _, last = key.rpartition(".")
        here, best = "", 1
        for number, line in enumerate(self.lines, start=1):
            if match := re.match(r"\s*\[([^\[\]]+)\]", line):
                here = match[1].replace(" ", "").replace('"', "")
                if key == here or key.startswith(f"{here}."):
                    best = number
            elif match := re.match(r"\s*([\w.\-\"']+)\s*=", line):
                full = f"{here}.{match[1]}".strip(".").replace('"', "").replace("'", "")
                if key == full or key.startswith(f"{full}.") or (here == section and match[1] == last):
                    best = number
                    if key == full:
                        return number
        return best


def read_column_map(path: str | Path) -> ColumnMap:
    """Parse and check a map. Raises InputError naming key and line."""
    return column_map_of(read_file(Path(path)), Path(path))


def column_map_of(data: bytes, path: Path) -> ColumnMap:
    """``read_column_map`` of the bytes of a map."""
    try:
        text = data.decode("utf-8")
        content = tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise InputError(str(path), f"not UTF-8 text at byte {error.start}", "mend the file") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"bad TOML: {error}", "mend the line") from None
    reader = _Reader(path, text)
    if content.get("schema") != SCHEMA:
        raise reader.fail("schema", f"schema is {content.get('schema')!r}", f'write schema = "{SCHEMA}"')
    digest = hashlib.sha256(data).hexdigest()
    if TABLE not in content:
        return _map_of(reader, content, path, digest)
    for key in content:
        if key not in ("schema", TABLE):
            raise reader.fail(key, "unknown key next to [[table]]", "write it into a [[table]]")
    above = [k for k, line in enumerate(reader.lines, start=1) if re.match(rf"\s*\[\[\s*{TABLE}\s*\]\]", line)]
    tables: dict[str, ColumnMap] = {}
    for part, start, end in zip(content[TABLE], above, [*above[1:], len(reader.lines) + 1], strict=True):
        block = "\n".join(line.replace(f"[{TABLE}.", "[") for line in reader.lines[start:end - 1])
        part_reader = _Reader(path, block, start)
        name = part.get("file")
        if not isinstance(name, str) or not name or name in tables:
            raise part_reader.fail("file", f"file is {name!r}", 'write the name of each table once, file = "imu.csv"')
        tables[name] = _map_of(part_reader, {key: what for key, what in part.items() if key != "file"}, path, digest)
    entries = [e for part in tables.values() for e in part.entries]
    _check_once(reader, entries)
    return replace(next(iter(tables.values())), tables=tables, entries=tuple(entries))


def _map_of(reader: _Reader, content: Mapping[str, Any], path: Path, digest: str) -> ColumnMap:
    """The map of one table."""
    for key in content:
        if key not in ("schema", "time", "streams", "vehicle"):
            raise reader.fail(key, "unknown key", "known: schema, time, streams, vehicle")
    streams = content.get("streams", {})
    if not isinstance(streams, Mapping) or not streams:
        raise reader.fail("streams", "the map names no stream", "give at least one [streams.NAME]")
    entries: list[Entry] = []
    frames: dict[str, Frame] = {}
    chosen: dict[str, str] = {}
    for stream, quantities in streams.items():
        known = STREAM_QUANTITIES.get(stream)
        if known is None:
            raise reader.fail(f"streams.{stream}", "unknown stream",
                              f"{did_you_mean(stream, STREAM_QUANTITIES)}known: {', '.join(STREAM_QUANTITIES)}")
        if isinstance(quantities, str) and quantities.startswith("/"):
            chosen[stream] = quantities
            continue
        if not isinstance(quantities, Mapping):
            raise reader.fail(f"streams.{stream}", "a stream is a table of quantities, or the topic of a bag",
                              "see docs/recordings.md")
        for quantity, what in quantities.items():
            key = f"streams.{stream}.{quantity}"
            if quantity == "frame":
                frames[stream] = _frame(reader, key, what)
                continue
            if quantity not in known:
                raise reader.fail(key, "unknown quantity",
                                  f"{did_you_mean(quantity, known)}{stream} has {', '.join(known)}, frame")
            entries.append(_entry(reader, key, stream, quantity, what, known[quantity][0]))
    if not entries and not chosen:
        raise reader.fail("streams", "the map names no quantity", "give at least one, such as px")
    _check_once(reader, entries)
    if "time" not in content and not all(e.topic for e in entries):
        raise reader.fail("time", "the map names no time column", 'write time = {column = "t", unit = "s"}')
    time, rest, rate_hz = _time(reader, content.get("time", MESSAGE_TIME))
    vehicle = content.get("vehicle", {})
    if not isinstance(vehicle, Mapping):
        raise reader.fail("vehicle", "vehicle is a table", "write [vehicle]")
    return ColumnMap(str(path), time, tuple(entries), vehicle, digest, rest, rate_hz, frames, chosen)


def _frame(reader: _Reader, key: str, what: object) -> Frame:
    try:
        return frame_of(str(what))
    except UsageError as error:
        raise reader.fail(key, *str(error).split("; ", 1)) from None


def _time(reader: _Reader, what: object) -> tuple[Entry, Entry | None, float | None]:
    """The entry of the time, of what is added to it, and the rate of frames."""
    if isinstance(what, Mapping) and "rate_hz" in what:
        rate = what["rate_hz"]
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not rate > 0.0:
            raise reader.fail("time.rate_hz", f"rate {rate!r}", "a rate is a number of frames a second")
        if "unit" in what or "add" in what:
            raise reader.fail("time", "rate_hz beside a unit", "a number of frames has none: keep one of them")
        return _entry(reader, "time", "", "time", {k: v for k, v in what.items() if k != "rate_hz"}, "s"), None, rate
    rest = None
    if isinstance(what, Mapping) and "add" in what:
        rest = _entry(reader, "time.add", "", "time", what["add"], "s")
        what = {k: v for k, v in what.items() if k != "add"}
    time = _entry(reader, "time", "", "time", what, "s")
    if rest is not None and {time.unit, rest.unit} & {*DATE_UNITS}:
        raise reader.fail("time", "dates need no second column", "leave add out")
    return time, rest, None


def _entry(reader: _Reader, key: str, stream: str, quantity: str, what: object, si: str) -> Entry:
    if isinstance(what, str):
        what = {"column": what}
    if not isinstance(what, Mapping):
        raise reader.fail(key, f"{what!r} where a table belongs", 'write {column = "..."}')
    for name in what:
        if name not in ENTRY_KEYS:
            raise reader.fail(f"{key}.{name}", "unknown key", f"known: {', '.join(ENTRY_KEYS)}")
    column, index, sign = what.get("column"), what.get("index"), what.get("sign", 1)
    offset, assumed, invalid = what.get("offset", 0.0), what.get("assumed", False), what.get("invalid")
    if not isinstance(column, str) or not column:
        raise reader.fail(key, "names no column", 'write column = "..."')
    if index is not None and (not isinstance(index, int) or isinstance(index, bool) or index < 0):
        raise reader.fail(f"{key}.index", f"index {index!r}", "an index is a whole number from 0")
    if isinstance(sign, bool) or sign not in (1, -1):
        raise reader.fail(f"{key}.sign", f"sign {sign!r}", "a sign is 1 or -1")
    if isinstance(offset, bool) or not isinstance(offset, int | float) or not math.isfinite(offset):
        raise reader.fail(f"{key}.offset", f"offset {offset!r}", "an offset is a number in SI, added last")
    if not isinstance(assumed, bool):
        raise reader.fail(f"{key}.assumed", f"assumed {assumed!r}", "write true or false")
    if invalid is not None and (isinstance(invalid, bool) or not isinstance(invalid, int | float) or not stream):
        raise reader.fail(f"{key}.invalid", f"invalid {invalid!r}", "a number as the table has it; a time has none")
    allowed = allowed_units(stream, quantity, si)
    unit = what.get("unit", allowed[0])
    if unit not in allowed:
        raise reader.fail(f"{key}.unit", f"unit {unit!r}", f"here: {', '.join(allowed)}")
    if stream == "motor" and unit == "rpm":
        stream = "rpm"
    other = "N" if stream == "command" and unit in FORCE_UNITS else ""
    return Entry(stream, quantity, column, index, unit, float(sign), float(offset), assumed,
                 None if invalid is None else float(invalid), other)


def allowed_units(stream: str, quantity: str, si: str | None = None) -> tuple[str, ...]:
    """Units a map may give a quantity in, the SI unit first; stream "" is the time."""
    if not stream:
        return (*UNITS["s"], *DATE_UNITS)
    if quantity == "tick":
        return UNITS["s"]
    if stream in PWM_STREAMS or (stream, quantity) == ("pid", "cmd_thrust"):
        return (*PWM_UNITS, *{"motor": ("rpm",), "command": FORCE_UNITS}.get(stream, ()))
    return UNITS[STREAM_QUANTITIES[stream][quantity][0] if si is None else si]


def in_units(stream: Stream, entries: Sequence[Entry]) -> Stream:
    """The stream with the units of its entries where they are not the vocabulary's."""
    return replace(stream, unit=tuple(e.other_si or known for e, known in zip(entries, stream.unit, strict=True)))


def _check_once(reader: _Reader, entries: list[Entry]) -> None:
    seen: set[tuple[str, str]] = set()
    for entry in entries:
        if (entry.stream, entry.quantity) in seen:
            raise reader.fail(f"streams.{entry.stream}.{entry.quantity}", "given twice (motor in rpm is stream rpm)",
                              "keep one")
        seen.add((entry.stream, entry.quantity))
