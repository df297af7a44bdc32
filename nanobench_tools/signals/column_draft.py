"""A column map drafted for a table that nobody described: names first, then what the numbers show.

A unit is known (an ecosystem's name, or the header), shown by the numbers, or assumed. Where two are possible the draft
asks, and drafts neither.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from .. import so3
from ..errors import InputError
from ..sources.cells import read_grid, read_text_columns
from ..sources.column_map import DATES, FORCE_UNITS, PWM_STREAMS, SCHEMA, allowed_units
from ..sources.column_names import NUMBERED, guessed, is_wanted, known_names, meaning, recognised, topic_in, unit_of
from ..sources.dates import looks_like_dates, seconds_of_dates
from ..sources.dialect import normalise_text
from ..sources.header import find_header, is_number
from ..sources.payload import read_file, unpack
from ..sources.table import PARQUET_MAGIC
from ..sources.tum_layout import NORM_TOLERANCE
from ..units import GRAVITY_M_S2, PWM_FULL_SCALE, factor, to_si
from . import column_evidence as evidence
from .plausible_ranges import SLOWEST_STEP_S

QUATERNION = ("qx", "qy", "qz", "qw")
Key = tuple[str, str]
TIME: Key = ("", "time")
COMMANDED_THRUST: Key = ("command", "thrust")
VECTORS: tuple[tuple[str, tuple[str, ...]], ...] = tuple(
    (stream, names) for stream, names in (
        ("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z")), ("setpoint", ("x", "y", "z")),
        ("mocap", ("vx", "vy", "vz")), ("estimator", ("vx", "vy", "vz")), ("estimator_acc", ("ax", "ay", "az")),
        ("imu", ("acc_x", "acc_y", "acc_z")), ("imu", ("gyro_x", "gyro_y", "gyro_z")),
        ("attitude", ("roll", "pitch", "yaw"))))
"""Quantities that share a unit."""


@dataclass(frozen=True)
class Drafted:
    """One column of the map. ``status``: known, shown or assumed; ``why``: the evidence in words."""

    column: str
    unit: str
    status: str = "assumed"
    why: str = ""
    sign: int = 1
    offset: float = 0.0


@dataclass
class Draft:
    """What is being drafted: columns by (stream, quantity), frames by stream, what was left out, and what is asked."""

    mapped: dict[Key, Drafted] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)

    def columns(self, stream: str, names: Sequence[str]) -> list[Key]:
        return [(stream, q) for q in names if (stream, q) in self.mapped]

    def ask(self, keys: Sequence[Key], question: str) -> None:
        """Leaves columns out, and asks about them."""
        columns = [self.mapped.pop(key).column for key in keys if key in self.mapped]
        text = f"{', '.join(columns)}: {question}"
        self.questions.append(text)
        self.unknown.update(dict.fromkeys(columns, question))


@dataclass(frozen=True)
class ColumnDraft:
    """``text``: the map as TOML; ``mapped``: {(stream, quantity): (column, unit)}, time as ("", "time"); ``unknown``:
    {column: why nothing was guessed}; ``notes``: what was found in the numbers, and what to check; ``questions``: what
    only the user knows; ``status``: {column: known, shown or assumed}."""

    text: str
    mapped: Mapping[Key, tuple[str, str]]
    unknown: Mapping[str, str]
    notes: tuple[str, ...]
    questions: tuple[str, ...] = ()
    status: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """Columns of numbers and of dates; names of those that hold text; units of a row of units."""

    values: dict[str, np.ndarray]
    dates: dict[str, np.ndarray]
    texts: list[str]
    units: Mapping[str, str]


def draft_columns(path: Path) -> ColumnDraft:
    """The draft for one table, CSV or Parquet. Raises InputError for a file that is no table or has no time column."""
    place = str(path)
    data = unpack(read_file(path), place).data
    table = _table(data, place)
    draft = Draft()
    _name(draft, table, path)
    time_s = _time(draft, table, place)
    _whose(draft)
    for stream in dict.fromkeys(stream for stream, _ in draft.mapped):
        _order_turn(stream, draft, table.values)
        _check_turn(stream, draft, table.values)
    _judge(draft, table.values, time_s)
    if len(draft.mapped) == 1:
        asked = f"; {draft.questions[0]}" if draft.questions else ""
        raise InputError(place, f"no column beside {draft.mapped[TIME].column!r} has a name that is known{asked}",
                         "name them like px, acc_x, gyro_x, m1, vbat, or write the map by hand: docs/recordings.md")
    if assumed := [d.column for d in draft.mapped.values() if d.status == "assumed"]:
        draft.notes.append(f"no unit is stated for {', '.join(assumed)}: the one below is assumed; check it")
    return ColumnDraft(_toml(path, draft), {k: (d.column, d.unit) for k, d in draft.mapped.items()}, draft.unknown,
                       tuple(draft.notes), tuple(draft.questions),
                       {d.column: d.status for d in draft.mapped.values()})


def _table(data: bytes, place: str) -> Table:
    if data.startswith(PARQUET_MAGIC):
        return _parquet(data, place)
    if b"\x00" in data and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(place, "is no table of text", "give a CSV or Parquet file")
    header = find_header(normalise_text(data[: 1 << 16]))
    if _one_variable_a_row(header.names):
        raise InputError(place, "long format: one variable per row, a name and its value",
                         "pivot it to one column per variable, for example pandas.DataFrame.pivot")
    stamps = [n for n in header.names if meaning(n) == TIME]
    grid = read_grid(data, place, time=stamps[0] if stamps else None)
    if twice := [n for n in grid.repeated if isinstance(meaning(n), tuple)]:
        raise InputError(place, f"{', '.join(map(repr, twice))} stand twice in the line of names",
                         "rename them, so that each names one column")
    if set(grid.text) & {"name", "variable", "key", "signal"} and "value" in grid.columns:
        raise InputError(place, "long format: one variable per row, a name and its value",
                         "pivot it to one column per variable, for example pandas.DataFrame.pivot")
    dates = {}
    if grid.text:
        cells = read_text_columns(data, place, grid.text)[0]
        dates = {n: seconds_of_dates(c) for n, c in cells.items() if looks_like_dates(c)}
    values = {name: np.asarray(column, dtype=float) for name, column in grid.columns.items()}
    return Table(values, dates, [n for n in grid.text if n not in dates], grid.units)


def _one_variable_a_row(names: Sequence[str]) -> bool:
    """Whether the first line is a row such as ``1.000,33577,stateEstimate.z,0.500``."""
    numbers = [is_number(n) for n in names]
    return 2 < len(names) < 6 and numbers.count(False) == 1 and numbers[0] and numbers[-1]


def _parquet(data: bytes, place: str) -> Table:
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(place, f"cannot be read as Parquet ({str(error).splitlines()[0]})",
                         "take another copy") from None
    kinds = {name: table.schema.field(name).type for name in table.column_names}
    numbers = {name: table.column(name).to_numpy().astype(float) for name, kind in kinds.items()
               if pa.types.is_floating(kind) or pa.types.is_integer(kind)}
    return Table(numbers, {}, [name for name in kinds if name not in numbers], {})


def _name(draft: Draft, table: Table, path: Path) -> None:
    """Meanings: of the ecosystems that are recognised, then by words."""
    names = [*table.values, *table.dates]
    stem = path.name.partition(".")[0]
    topic = topic_in(stem)
    systems = recognised(names, topic)
    if not topic and _like_px4(table):
        systems = recognised(names, topic := "vehicle_local_position")
    stated = {c: table.units.get(c) or unit_of(c) for c in names}
    for column, (known, title) in known_names(names, systems).items():
        key = (known.stream, known.quantity)
        if not known.quantity:
            draft.unknown[column] = f"{known.what} ({title})"
        elif key not in draft.mapped:
            unit = stated[column] if stated[column] in allowed_units(*key) else known.unit
            draft.mapped[key] = Drafted(column, unit, "known", title, int(known.sign), known.offset)
            if known.frame:
                draft.frames[known.stream] = known.frame
    left = [c for c in names if c not in draft.unknown and c not in {d.column for d in draft.mapped.values()}]
    found, why = guessed(left, taken=draft.mapped)
    draft.unknown.update(why)
    for key, column in found.items():
        allowed = ("1",) if re.fullmatch(r"q\d", key[1]) else allowed_units(
            key[0], "m1" if key[1] == "m0" else key[1])
        unit = stated[column]
        if unit and unit not in allowed:
            draft.notes.append(f"{column}: its unit {unit!r} is none of {', '.join(allowed)}")
        known_unit = unit in allowed
        draft.mapped[key] = Drafted(column, unit if known_unit else allowed[0],
                                    "known" if known_unit or len(allowed) == 1 else "assumed",
                                    "stated" if known_unit else "")


def _whose(draft: Draft) -> None:
    """Plain names beside those of an ecosystem: an axis that the estimate lacks is asked about; the sign of a pitch."""
    for plain, known in (("p", ""), ("v", "v")):
        lacking = [("mocap", plain + a) for a in "xyz" if ("mocap", plain + a) in draft.mapped
                   and ("estimator", known + a) not in draft.mapped]
        if lacking and any(("estimator", known + a) in draft.mapped for a in "xyz"):
            draft.ask(lacking, "the estimate's missing axis, or the motion capture's? write it in its stream")
    thrust = draft.mapped.get(COMMANDED_THRUST)
    if thrust is not None and thrust.why == "stated" and thrust.unit in FORCE_UNITS and not is_wanted(thrust.column):
        draft.ask([COMMANDED_THRUST], "a force: commanded, or measured by a load cell? a command belongs in "
                  "[streams.command]")
    pitch = draft.mapped.get(("attitude", "pitch"))
    if pitch is not None and pitch.why in ("", "stated"):
        draft.notes.append(f"{pitch.column}: taken as positive nose down; write sign = -1 if it is positive nose up")


def _like_px4(table: Table) -> bool:
    """Columns of PX4's local position, whose z only falls in flight and whose acceleration has no gravity in it."""
    need = ("timestamp", "x", "y", "z", "vx", "vy", "vz")
    if not all(n in table.values for n in need) or not evidence.falls_in_flight(table.values["z"]):
        return False
    az = table.values.get("az")
    return az is None or abs(float(np.nanmedian(az))) < 0.5 * GRAVITY_M_S2


def _time(draft: Draft, table: Table, place: str) -> np.ndarray:
    """Drafts the time, and gives (n,) s since the first row. Raises InputError if it is missing."""
    if TIME not in draft.mapped:
        seen = ", ".join(map(repr, table.values))
        also = f"; of text: {', '.join(map(repr, table.texts))}" if table.texts else ""
        rises = [c for c, v in table.values.items() if len(v) > 2 and np.all(np.diff(v) > 0.0)]
        hint = f"{rises[0]!r} rises from row to row: is it the time? " if rises else ""
        raise InputError(place, f"no column is named like a time; its columns: {seen}{also}",
                         f"{hint}call one of them t (or time, timestamp), or write the map by hand: "
                         'time = {column = "frame", rate_hz = 100} for a frame rate')
    time = draft.mapped[TIME]
    if time.column in table.dates:
        draft.mapped[TIME] = replace(time, unit=DATES, status="known", why="dates")
        seconds = table.dates[time.column]
        return np.asarray(seconds - seconds[np.isfinite(seconds)][:1])
    stamps = table.values[time.column]
    steps = np.diff(stamps)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not len(steps):
        draft.notes.append(f"{time.column} never grows: is it the time?")
        return np.arange(len(stamps), dtype=float)
    step = float(np.median(steps))
    unit = time.unit
    fits = [u for u in ("s", "ms", "us", "ns") if evidence.FASTEST_STEP_S <= step * factor(u) <= SLOWEST_STEP_S]
    if not fits:
        raise InputError(f"{place}: column {time.column}", f"rows are {step:g} apart: in no unit a recording's time",
                         "write its unit in the map, or name another column t")
    if unit not in fits or time.status != "known":
        unit = fits[0]
    if unit != time.unit or time.status == "assumed":
        draft.notes.append(f"{time.column}: rows are {step:g} apart, so it is in {unit}")
        draft.mapped[TIME] = replace(time, unit=unit, status="shown", why=f"rows are {step:g} apart")
    return np.asarray((stamps - stamps[np.isfinite(stamps)][0]) * factor(unit))


def _order_turn(stream: str, draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Gives q0 .. q3 their letters where one order alone has the vehicle upright; a turn about z looks upright in the
    other, too, where it is half a turn."""
    columns = [draft.mapped.pop((stream, f"q{d}")).column for d in NUMBERED if (stream, f"q{d}") in draft.mapped]
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
        draft.unknown.update(dict.fromkeys(columns, why))
        return
    for quantity, column in zip(upright[0], columns, strict=True):
        draft.mapped[stream, quantity] = Drafted(column, "1", "shown", "upright in one order only")
    draft.notes.append(f"{columns[upright[0].index('qw')]}: the scalar, since only then is the vehicle upright")


def _check_turn(stream: str, draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Takes out what is called a quaternion and is none: four numbers of length 1."""
    turn = [draft.mapped[k].column for k in draft.columns(stream, QUATERNION)]
    if not turn:
        return
    length = float(np.nanmedian(np.linalg.norm(np.stack([values[c] for c in turn], axis=1), axis=1)))
    if len(turn) == len(QUATERNION) and abs(length - 1.0) < NORM_TOLERANCE:
        draft.notes.append(f"{', '.join(turn)} have length {length:.3f}: a quaternion")
        return
    for key in draft.columns(stream, QUATERNION):
        draft.unknown[draft.mapped.pop(key).column] = (
            f"{len(turn)} of 4 parts of a quaternion" if len(turn) < len(QUATERNION) else
            f"{', '.join(turn)} have length {length:.3g}, a quaternion has 1")


def _si(draft: Draft, keys: Sequence[Key], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """(n, k) of drafted columns in SI."""
    return np.stack([draft.mapped[k].sign * to_si(values[draft.mapped[k].column], draft.mapped[k].unit)
                     + draft.mapped[k].offset for k in keys], axis=1)


def _judge(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Units that the numbers show, contradictions, and questions."""
    for stream, names in VECTORS:
        keys = draft.columns(stream, names)
        if len(keys) > 1 and stream != "attitude" and not evidence.one_unit(
                _si(draft, keys, values), stream in ("imu", "mocap") and not names[0].startswith("v")):
            draft.ask(keys, "their noise differs: are they all in one unit? write the unit of each")
    _battery(draft, values)
    _motors(draft, values)
    _gravity(draft, values)
    for stream, names in (("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z"))):
        _position(draft, stream, names, values, time_s)
    _angles(draft, values)
    _gyro(draft, values, time_s)
    _down(draft, values)


def _set(draft: Draft, keys: Sequence[Key], unit: str, why: str, status: str = "shown") -> None:
    for key in keys:
        draft.mapped[key] = replace(draft.mapped[key], unit=unit, status=status, why=why)
    if status == "shown" and keys:
        draft.notes.append(f"{', '.join(draft.mapped[k].column for k in keys)}: {unit}, since {why}")


def _open(draft: Draft, keys: Sequence[Key]) -> list[Key]:
    return [k for k in keys if draft.mapped[k].status == "assumed"]


def _battery(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    key = ("battery", "vbat")
    if key not in draft.mapped:
        return
    drafted = draft.mapped[key]
    cells = values[drafted.column][np.isfinite(values[drafted.column])]
    if not len(cells):
        return
    middle = float(np.median(cells))
    if drafted.status == "known":
        if not 0.5 * evidence.CELLS_V[0] <= middle * factor(drafted.unit) <= 2.0 * evidence.CELLS_V[1]:
            draft.ask([key], f"{middle:g} {drafted.unit} is no battery's voltage; what is it?")
        return
    whole, falling = bool(np.all(cells == np.round(cells))), bool(np.all(np.diff(cells) <= 0.0))
    low, high = evidence.CELLS_V
    if cells.min() >= 0.0 and cells.max() <= 1.0:
        draft.unknown[draft.mapped.pop(key).column] = "a battery level as a share (state of charge), no voltage"
    elif cells.max() <= 100.0 and (middle > high or whole) and (falling or middle > 2.0 * high):
        draft.unknown[draft.mapped.pop(key).column] = "a battery level as a percentage, which is no voltage"
    elif low <= middle <= high and not whole:
        draft.mapped[key] = replace(drafted, why=f"{middle:.3g} V is a battery's voltage")
    elif low <= 1e-3 * middle <= high:
        _set(draft, [key], "mV", f"the median is {middle:.4g}", "assumed" if whole and falling else "shown")
    else:
        draft.ask([key], f"a median of {middle:.3g}: volts or a percentage? write unit = \"V\", or leave it out")


def _motors(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    for stream in (*sorted(PWM_STREAMS), "rpm"):
        keys = [k for k in draft.mapped if k[0] == stream]
        numbered = sorted(int(k[1][1:]) for k in keys if k[1][1:].isdigit())
        if numbered and all(draft.mapped[k].status == "assumed" for k in keys):
            if numbered[0] == 0:
                moved = {(s, f"m{int(q[1:]) + 1}"): draft.mapped.pop((s, q)) for s, q in keys}
                draft.mapped.update(moved)
                draft.notes.append(f"{', '.join(d.column for d in moved.values())}: counted from 0, so they are m1 to "
                                   f"m{len(moved)}, in the order of the table")
                keys = list(moved)
            elif numbered == [1, 2, 3]:
                draft.ask(keys, "three motors, counted from 0 or from 1? write m1, m2 ... yourself")
                continue
        for key in [k for k in keys if k[1] == "m0"]:
            draft.ask([key], "motors are m1 to m8; which one is it?")
        keys = _open(draft, [k for k in keys if k in draft.mapped])
        if not keys:
            continue
        if stream == "rpm":
            _set(draft, keys, "rpm", "the name says so", "known")
            continue
        cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
        tops = np.nanquantile(cells, 0.99, axis=0)
        if tops.min() > 0.0 and tops.max() > 2.0 * evidence.SAME * tops.min():
            draft.ask(keys, "they are of different size: are they all in one unit? write the unit of each")
            continue
        top, bottom = float(np.nanquantile(cells, 0.99)), float(np.nanmin(cells))
        if top <= 1.2 and bottom >= -1.0:
            draft.mapped.update({k: replace(draft.mapped[k], why=f"between {bottom:g} and {top:.3g}") for k in keys})
        elif bottom >= 900.0 and top <= 2100.0:
            _set(draft, keys, "pulse_us", f"they lie between {bottom:g} and {top:g}: pulses (1000 us is 0, 2000 us 1)")
        elif bottom >= 0.0 and 2500.0 < top <= PWM_FULL_SCALE:
            _set(draft, keys, "pwm16", f"they reach {top:.4g}")
        else:
            choices = ", ".join(allowed_units(*keys[0]))
            draft.ask(keys, f"between {bottom:g} and {top:.4g}: the unit is unknown; write unit = one of {choices}")


def _gravity(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Specific force has gravity's size; what has none of it is no accelerometer."""
    keys = draft.columns("imu", ("acc_x", "acc_y", "acc_z"))
    if len(keys) < 3:
        if _open(draft, keys):
            draft.ask(keys, "an accelerometer with one or two axes: m/s^2 or g? write unit = \"m/s^2\" or \"g\"")
        return
    norm = float(np.nanmedian(np.linalg.norm(np.stack([values[draft.mapped[k].column] for k in keys], axis=1), axis=1)))
    factors = {"m/s^2": 1.0, "g": factor("g"), "mg": factor("mg"), "mm/s^2": factor("mm/s^2")}
    near = np.log(evidence.SAME)
    fits = [u for u, f in factors.items() if norm > 0.0 and abs(np.log(norm * f / GRAVITY_M_S2)) < near]
    if not _open(draft, keys):
        if draft.mapped[keys[2]].unit not in fits:
            draft.ask(keys, f"in {draft.mapped[keys[2]].unit} the median of the specific force is not gravity's "
                      f"({norm:.4g}); which unit is it? write unit = one of {', '.join(factors)}")
    elif fits:
        _set(draft, keys, fits[0], f"the median of the specific force is {norm:.4g}, which is gravity")
    else:
        draft.ask(keys, f"no accelerometer: the median is {norm:.4g}, without gravity. Is it the acceleration of an "
                  "estimate? write [streams.estimator_acc] ax, ay, az")


def _position(draft: Draft, stream: str, names: tuple[str, ...], values: Mapping[str, np.ndarray],
              time_s: np.ndarray) -> None:
    keys = draft.columns(stream, names)
    speeds = draft.columns(stream, tuple(f"v{n[-1]}" for n in names))
    if not keys:
        if _open(draft, speeds):
            draft.mapped.update({k: replace(draft.mapped[k], why="nothing shows it") for k in speeds})
        return
    pairs = [(k, s) for k in keys for s in speeds if k[1][-1] == s[1][-1]]
    if pairs:
        rate = evidence.rate_of(time_s, _si(draft, [k for k, _ in pairs], values))
        found = evidence.ratio(evidence.smooth(_si(draft, [s for _, s in pairs], values)), rate)
        if found.known and found.agrees(1.0):
            why = "velocity and position agree"
            _confirm(draft, [*keys, *speeds], why)
        elif found.known:
            shown = ", ".join(f"{r:.3g}" for r in found.known)
            draft.ask([*keys, *speeds],
                      f"the velocity is {shown} times the rate of the position; write the unit of each")
            return
    still = _open(draft, keys)
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    each = evidence.spans(cells)
    moving = each[each > 0.0]
    scaled = each * [factor(draft.mapped[k].unit) for k in keys]
    factors = {"m": 1.0, "cm": factor("cm"), "mm": factor("mm")}
    if len(moving) and still:
        fits = evidence.lengths_that_fit(cells, time_s, factors)
        alone = [evidence.lengths_that_fit(cells[:, [k]], time_s, factors) or list(factors) for k in range(len(keys))]
        if not set.intersection(*map(set, alone)):
            draft.ask(keys, "they are not of one size: are they all in one unit? write the unit of each")
        elif len(fits) > 1:
            draft.ask(keys, f"{' or '.join(fits)}? both are possible; write unit = \"{fits[-1]}\", or another, at each")
        elif fits and fits != ["m"]:
            _set(draft, still, fits[0], f"they span {moving.max():.4g}")
        elif not fits and moving.max() > evidence.SMALLEST_FLIGHT_M:
            draft.ask(keys, f"no vehicle flies such a path in m, cm or mm with the time in {draft.mapped[TIME].unit}; "
                      "write the unit of each")
    elif len(moving) and scaled.max() > 20.0 * evidence.LARGEST_FLIGHT_M:
        draft.ask(keys, f"they span {scaled.max():.4g} m: no flight; which unit is it?")


def _confirm(draft: Draft, keys: Sequence[Key], why: str) -> None:
    for key in keys:
        if draft.mapped[key].status == "assumed":
            draft.mapped[key] = replace(draft.mapped[key], why=why)


def _angles(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    keys = draft.columns("attitude", ("roll", "pitch", "yaw"))
    still = _open(draft, keys)
    if keys and not still and float(np.nanquantile(np.abs(_si(draft, keys, values)), 0.999)) > 4.0 * np.pi:
        draft.ask(keys, "angles of more than two turns; which unit is it? write the unit of each")
    if not still:
        return
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    top = float(np.nanquantile(np.abs(cells), 0.999))
    if top > 2.0 * np.pi:
        _set(draft, still, "deg", f"they reach {top:.3g}")
    elif top > 0.5 * np.pi:
        draft.ask(still, f"they reach {top:.3g}: rad or deg? write unit = \"rad\" or \"deg\" at each")


def _turning(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> np.ndarray | None:
    """(n, 3) body rate of an attitude of the table, rad/s."""
    for stream in ("attitude_qw", "mocap"):
        if len(keys := draft.columns(stream, QUATERNION)) == len(QUATERNION):
            q = so3.make_continuous(_si(draft, keys, values))
            step = evidence.rate_of(time_s, q)
            return 2.0 * so3.multiply(so3.conjugate(q), step)[:, :3]
    keys = draft.columns("attitude", ("roll", "pitch", "yaw"))
    if len(keys) == 3:
        return evidence.rate_of(time_s, np.unwrap(_si(draft, keys, values), axis=0))
    return None


def _gyro(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    keys = draft.columns("imu", ("gyro_x", "gyro_y", "gyro_z"))
    if not keys:
        return
    factors = {"rad/s": 1.0, "deg/s": factor("deg/s"), "mrad/s": factor("mrad/s")}
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    turning = _turning(draft, values, time_s)
    unit = draft.mapped[keys[0]].unit
    if turning is not None:
        axes = ["xyz".index(k[1][-1]) for k in keys]
        found = evidence.ratio(evidence.smooth(_si(draft, keys, values)), turning[:, axes])
        if found.known:
            fits = [u for u, f in factors.items() if found.agrees(factor(unit) / f)]
            if not fits or (fits[0] != unit and not _open(draft, keys)):
                shown = ", ".join(f"{r:.3g}" for r in found.known)
                draft.ask([*keys, *draft.columns("attitude", ("roll", "pitch", "yaw"))],
                          f"the gyro turns {shown} times as fast as the attitude; write the unit of each")
            elif _open(draft, keys):
                _set(draft, keys, fits[0], "it turns as fast as the attitude")
            _frd(draft, found, values)
            return
    fits = evidence.rates_that_fit(cells, factors)
    if _open(draft, keys):
        if len(fits) > 1:
            draft.ask(keys, f"{' or '.join(fits)}? both are possible; write unit = \"rad/s\" or \"deg/s\" at each")
        elif fits and fits != ["rad/s"]:
            _set(draft, keys, fits[0], f"it reaches {np.nanmax(np.abs(cells)):.3g}")
    elif float(np.nanquantile(np.abs(cells), 0.999)) * factor(unit) > 2.0 * evidence.FASTEST_RAD_S:
        draft.ask(keys, f"in {unit} it reaches more than any gyro measures; which unit is it?")


def _frd(draft: Draft, turns: evidence.Ratio, values: Mapping[str, np.ndarray]) -> None:
    """Turns the IMU where gravity lies along -z and the gyro turns against the attitude about y and z alone."""
    up = ("imu", "acc_z")
    if turns.sign[1:] == (-1, -1) and turns.sign[0] >= 0 and up in draft.mapped and "imu" not in draft.frames \
            and float(np.nanmedian(values[draft.mapped[up].column])) < 0.0:
        draft.frames["imu"] = "FRD"
        draft.notes.append("imu: forward, right, down (FRD), since gravity lies along -z and the gyro turns against "
                           "the attitude about y and z")


def _down(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """A height that only falls in flight: its axis points down. A flight whose height is y."""
    heights = [draft.mapped[k].column for k in draft.columns("mocap", ("py", "pz"))]
    if len(heights) == 2 and "mocap" not in draft.frames and evidence.falls_in_flight(-values[heights[0]]) and not any(
            evidence.falls_in_flight(sign * values[heights[1]]) for sign in (1.0, -1.0)):
        draft.notes.append(f"{heights[0]} rises and returns as a height does, {heights[1]} does not: is y up? if so, "
                           'write frame = "EUS/FUR" in [streams.mocap]')
    for stream, name in (("mocap", "pz"), ("estimator", "z")):
        key = (stream, name)
        if key in draft.mapped and stream not in draft.frames and draft.mapped[key].sign > 0 and \
                evidence.falls_in_flight(values[draft.mapped[key].column]):
            draft.notes.append(f"{draft.mapped[key].column} falls in flight: z points down (NED?); if so, write "
                               f"frame = \"NED\" in [streams.{stream}]")


def _toml(path: Path, draft: Draft) -> str:
    def quoted(text: str) -> str:
        return json.dumps(text, ensure_ascii=not text.isprintable())

    def comment(text: str) -> str:
        return "# " + "".join(c if c.isprintable() else "?" for c in text)

    def entry(d: Drafted) -> str:
        parts = [f"column = {quoted(d.column)}", f"unit = {quoted(d.unit)}"]
        parts += ["sign = -1"] * (d.sign < 0) + [f"offset = {d.offset}"] * bool(d.offset)
        parts += ["assumed = true"] * (d.status == "assumed")
        return f"{{{', '.join(parts)}}}"

    lines = [comment(f"Drafted from {path.name}: check every line."), *(comment(note) for note in draft.notes),
             *(comment(f"Question: {q}") for q in draft.questions),
             f'schema = "{SCHEMA}"', f"time = {entry(replace(draft.mapped[TIME], status='shown'))}"]
    for stream in dict.fromkeys(stream for stream, _ in draft.mapped if stream):
        lines += ["", f"[streams.{stream}]"]
        if stream in draft.frames:
            lines.append(f"frame = {quoted(draft.frames[stream])}")
        for (s, quantity), d in draft.mapped.items():
            if s == stream:
                told = f"{d.status}: {d.why}" if d.why else d.status
                lines.append(f"{quantity} = {entry(d)}  {comment(told)}")
    if draft.unknown:
        lines += ["", "# Not guessed:", *(comment(f"{column}: {why}") for column, why in draft.unknown.items())]
    return "\n".join(lines) + "\n"
