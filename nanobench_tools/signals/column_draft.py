"""A column map drafted for a table that nobody described: names first, then what the numbers show.

A unit is known (an ecosystem's name, or the header), shown by the numbers, or assumed. Where two are possible the draft
asks, and drafts neither.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import make_stream
from ..settings import number
from ..sources.clock_jumps import far_rows, many_far_rows
from ..sources.column_map import FORCE_UNITS, allowed_units, column_map_of, sense_of
from ..sources.column_names import (
    NUMBERED,
    directed,
    guessed,
    is_wanted,
    known_names,
    meaning,
    recognised,
    rest_of_seconds,
    topic_in,
    unit_of,
    vehicles_of,
    words_of,
)
from ..sources.dates import DATE_UNITS, ISO
from ..sources.joined_tables import joined
from ..sources.lost_poses import POSITION, placeholders
from ..sources.payload import read_file, unpack
from ..sources.stand import is_a_stand
from ..sources.table import TableSource
from ..sources.timestamps import counted_on
from ..sources.topic_columns import topic_columns
from ..sources.tum_layout import NORM_TOLERANCE
from ..units import GRAVITY_M_S2, factor
from . import column_evidence as evidence
from .draft import PITCH_ASSUMED, QUATERNION, TIME, ColumnDraft, Draft, Drafted, Key, as_toml, joined_toml
from .draft_axes import TURNED_PITCH, judge_axes
from .draft_frames import judge_frames
from .draft_motion import judge_motion
from .draft_table import Table, read_table
from .draft_targets import judge_targets
from .draft_topics import name_topics
from .draft_units import judge_units
from .plausible_ranges import SLOWEST_STEP_S

OURS = "ENU"
FALLS = number("audit.column_draft.falls")
OF_SET_POINTS = ("thrust[0]", "acceleration[0]", "jerk[0]", "acc_x")
"""Columns that PX4's set-points have in addition to yawspeed, and its local position does not."""
OF_TOPICS = {"delta_q_reset[0]": "vehicle_attitude", "velocity_frame": "vehicle_odometry"}
"""Columns of which PX4 has them in one topic, or in several of one message: the vehicle's estimate, then."""
SECONDS = ("s", "ms", "us", "ns")
"""Units of a time that states none."""
SAME_COLUMN = 1e-3
"""Share of the largest value by which a column and the same in another unit differ, at most: rounding."""
PITCH: Key = ("attitude", "pitch")
YAW: Key = ("attitude", "yaw")
YAW_ASSUMED = ": taken as counter-clockwise from x; check it, since a compass counts clockwise from north"
FEWEST_NINES, FAR = 3, 10.0
"""Rows that have such a number, and its distance from all others, at least."""
COMMANDED_THRUST: Key = ("command", "thrust")


def draft_columns(path: Path) -> ColumnDraft:
    """The draft for one table, CSV or Parquet. Raises InputError for a file that is no table or has no time column."""
    place = str(path)
    table = read_table(path)
    draft = Draft()
    _name(draft, table, path)
    _which_vehicle(draft, table)
    time_s = _time(draft, table, place)
    far = far_rows(time_s)
    if (error := many_far_rows(time_s, far, f"{place}: column {draft.mapped[TIME].column}")) is not None:
        raise error
    if not (rows := np.isfinite(time_s) & ~far).all() and rows.any():  # such as a line of text in the middle
        table = replace(table, values={column: cells[rows] for column, cells in table.values.items()})
        time_s = time_s[rows]
    _whose(draft)
    judge_targets(draft, table.values, path.name)
    _without_placeholders(draft, table)
    _without_nines(draft, table)
    for stream in dict.fromkeys(stream for stream, _ in draft.mapped):
        _order_turn(stream, draft, table.values)
        _check_turn(stream, draft, table.values)
    judge_units(draft, table.values, time_s)
    judge_axes(draft, table.values, time_s)
    judge_motion(draft, table.values, time_s)
    judge_frames(draft, table.values, time_s)
    if len(draft.mapped) == 1:
        if draft.questions:
            raise InputError(place, f"nothing can be drafted before this is known: {draft.questions[0]}",
                             "write the map by hand: docs/recordings.md")
        raise InputError(place, f"no column except {draft.mapped[TIME].column!r} has a known name",
                         "name them like px, acc_x, gyro_x, m1, vbat, or write the map by hand: docs/recordings.md")
    if assumed := [d.column for d in draft.mapped.values() if d.status == "assumed" and TURNED_PITCH not in d.why]:
        draft.notes.append(f"no unit is stated for {', '.join(assumed)}: the one below is assumed; check it")
    pitch = draft.mapped.get(PITCH)
    if pitch is not None and f"{pitch.column}{PITCH_ASSUMED}" in " ".join(draft.notes):
        turning = [] if ("imu", "acc_z") in draft.mapped else draft.columns("imu", ("gyro_y", "gyro_z"))
        for key in (*draft.columns("attitude", ("pitch", "yaw")), *turning):
            sense = sense_of(*key, draft.mapped[key].sign) or "the sign of the angle"
            draft.mapped[key] = replace(draft.mapped[key], status="assumed", why=f"{sense} is assumed")
    yaw = draft.mapped.get(YAW)
    if yaw is not None and f"{yaw.column}{YAW_ASSUMED}" in draft.notes:
        draft.mapped[YAW] = replace(yaw, status="assumed", why=f"{sense_of(*YAW, yaw.sign)} is assumed")
    return ColumnDraft(as_toml(path, draft), {k: (d.column, d.unit) for k, d in draft.mapped.items()}, draft.unknown,
                       tuple(draft.notes), tuple(draft.questions),
                       {d.column: d.status for d in draft.mapped.values()})


def draft_tables(paths: Sequence[Path]) -> ColumnDraft:
    """The draft for the tables of one recording. InputError where two have the same stream, or no time in common."""
    drafts = {path: draft_columns(path) for path in paths}
    owner: dict[Key, Path] = {}
    for path, draft in drafts.items():
        for key in draft.mapped:
            if owner.setdefault(key, path) != path and key != TIME:
                raise InputError(f"{owner[key]}, {path}", f"both have {key[1]} of {key[0]}: they are not tables of one "
                                 "recording", "name those of one (nanobench columns FILE FILE), or one file if "
                                 "each is a recording")
    text = joined_toml({path.name: draft.text for path, draft in drafts.items()})
    parts = column_map_of(text.encode(), Path("the draft")).tables
    if not any(draft.questions for draft in drafts.values()):
        joined(paths[0].parent, {path.name: TableSource(parts[name]).read(path, unpack(read_file(path), str(path)).data)
                                 for path, name in zip(paths, parts, strict=True)})
    return ColumnDraft(
        text,
        {(s, q if s else f"time of {p.name}"): (f"{p.name}: {c}", unit) for p, d in drafts.items()
         for (s, q), (c, unit) in d.mapped.items()},
        {f"{p.name}: {column}": why for p, d in drafts.items() for column, why in d.unknown.items()},
        tuple(f"{p.name}: {note}" for p, d in drafts.items() for note in d.notes),
        tuple(f"{p.name}: {question}" for p, d in drafts.items() for question in d.questions),
        {f"{p.name}: {column}": status for p, d in drafts.items() for column, status in d.status.items()})


def _name(draft: Draft, table: Table, path: Path) -> None:
    """Meanings: of the ecosystems that are recognised, then by words."""
    names = [*table.values, *table.dates]
    stem = path.name.partition(".")[0]
    topic = topic_in(stem)
    systems = recognised(names, topic)
    frames = draft.frames
    if not topic and (shown := _topic_of_px4(table)):
        systems, frames = recognised(names, shown), draft.likely
    stated = {c: table.units.get(c) or unit_of(c) for c in names}
    for column, (known, title) in (known_names(names, systems) | topic_columns(names)).items():
        key = (known.stream, known.quantity)
        if known.what:
            draft.unknown[column] = f"{known.what} ({title})"
        elif key not in draft.mapped and known.stream and any(
                k[0] == known.stream and frames.get(known.stream, "") != known.frame for k in draft.mapped):
            draft.unknown[column] = f"{known.stream} in {known.frame or OURS} axes, others are not ({title})"
        elif key not in draft.mapped:
            written = stated[column] in allowed_units(*key)
            status = "assumed" if known.generic and not written else "known"
            draft.mapped[key] = Drafted(column, stated[column] if written else known.unit, status, title,
                                        int(known.sign), known.offset, known.invalid)
            if known.invalid is not None:
                cells = table.values[column]
                table.values[column] = np.where(cells == known.invalid, np.nan, cells)
            if known.frame:
                frames[known.stream] = known.frame
    name_topics(draft, table.values)
    left = [c for c in names if c not in draft.unknown and c not in {d.column for d in draft.mapped.values()}]
    axes = directed(left)
    found, why = guessed(left, taken=draft.mapped, called={column: name for column, (name, _) in axes.items()})
    draft.unknown.update(why)
    for key, column in found.items():
        allowed = ("1",) if re.fullmatch(r"q\d", key[1]) else allowed_units(
            key[0], "m1" if key[1] == "m0" else key[1])
        unit = stated[column]
        if unit and key == TIME and unit not in allowed and column not in table.dates:
            raise InputError(f"{path}: column {column}", f"its unit {unit!r} is none of {', '.join(allowed)}",
                             "convert it, or call another column t")
        if unit and unit not in allowed and key != TIME:
            question = f"its unit {unit!r} is none of {', '.join(allowed)}; convert it"
            draft.questions.append(f"{column}: {question}")
            draft.unknown[column] = question
            continue
        if column in axes:
            _in_axes(draft, key, axes[column][1], column)
        known_unit = unit in allowed
        draft.mapped[key] = Drafted(column, unit if known_unit else allowed[0],
                                    "known" if known_unit or len(allowed) == 1 else "assumed",
                                    "stated" if known_unit else "")
    for key in [key for key, d in draft.mapped.items() if d.column in table.dates and key != TIME]:
        draft.unknown[draft.mapped.pop(key).column] = "its cells are dates"
    _which_column(draft, {c: meaning(axes[c][0] if c in axes else c) for c in left}, table.values)


def _which_column(draft: Draft, meanings: Mapping[str, Key | str], values: Mapping[str, np.ndarray]) -> None:
    """Asks where a second column has the meaning of a drafted one, and other values than this in another unit."""
    others: dict[Key, str] = {}
    for column, key in meanings.items():
        if isinstance(key, str) or key == TIME or key not in draft.mapped or column not in values:
            continue
        drafted = draft.mapped[key]
        if drafted.column == column or vehicles_of(drafted.column) != vehicles_of(column):
            continue
        both = np.stack([values[drafted.column], values[column]])
        a, b = both[:, np.isfinite(both).all(axis=0)]
        scale = float(a @ b) / max(float(b @ b), 1e-300)
        if len(a) and np.abs(a - scale * b).max() > SAME_COLUMN * np.abs(a).max():
            others.setdefault(key, column)
    for stream in dict.fromkeys(stream for stream, _ in others):
        of_stream = {key: column for key, column in others.items() if key[0] == stream}
        draft.ask(list(of_stream), f"or {', '.join(of_stream.values())}, which have other values? name one of them in "
                  "the map")


def _in_axes(draft: Draft, key: Key, axes: str, column: str) -> None:
    """Notes the axes that the names of a vector state."""
    if not axes:
        if key[1] == "gyro_x" and words_of(column)[0] == ["p"]:
            draft.notes.append("p, q, r: body rates; where y points right and z down, write frame = \"FRD\" in "
                               "[streams.imu]")
    elif axes != OURS:
        draft.frames[key[0]] = axes


def _which_vehicle(draft: Draft, table: Table) -> None:
    """Asks where columns of two vehicles have one meaning, and drafts neither."""
    of_column = {c: (meaning(c), vehicles_of(c)) for c in (*table.values, *table.dates)}
    double: dict[Key, set[tuple[str, ...]]] = {}
    for what, vehicles in of_column.values():
        if isinstance(what, tuple) and vehicles:
            double.setdefault(what, set()).add(vehicles)
    keys = [key for key, drafted in draft.mapped.items()
            if len(double.get(key, ())) > 1 and vehicles_of(drafted.column)]
    if keys:
        names = sorted({" ".join(v) for key in keys for v in double[key]})
        draft.ask(keys, f"which vehicle: {', '.join(names)}? keep the columns of one, or write one map for each")


def _whose(draft: Draft) -> None:
    """Plain names in addition to those of an ecosystem. Asks for an axis that the estimate lacks, and for the sign of
    a pitch."""
    for plain, known in (("p", ""), ("v", "v")):
        lacking = [("mocap", plain + a) for a in "xyz" if ("mocap", plain + a) in draft.mapped
                   and ("estimator", known + a) not in draft.mapped]
        if lacking and any(("estimator", known + a) in draft.mapped for a in "xyz"):
            draft.ask(lacking, "the estimate's missing axis, or the motion capture's? write it in its stream")
    thrust = draft.mapped.get(COMMANDED_THRUST)
    if thrust is not None and thrust.why == "stated" and thrust.unit in FORCE_UNITS and not is_wanted(thrust.column):
        draft.ask([COMMANDED_THRUST], "a force: commanded, or measured by a load cell? a command belongs in "
                  "[streams.command]")
    pitch = draft.mapped.get(PITCH)
    if pitch is not None and pitch.why in ("", "stated"):
        draft.notes.append(f"{pitch.column}{PITCH_ASSUMED}; write sign = -1 if it is positive nose up")
    yaw = draft.mapped.get(YAW)
    if yaw is not None and yaw.why in ("", "stated") and not {PITCH, ("imu", "gyro_z")} & set(draft.mapped):
        draft.notes.append(f"{yaw.column}{YAW_ASSUMED}")


def _without_placeholders(draft: Draft, table: Table) -> None:
    """Rows in which the tracker lost the body are no part of the path: without a number, as an audit reads them."""
    keys = draft.columns("mocap", (*POSITION, *QUATERNION))
    if [key[1] for key in keys[:len(POSITION)]] != list(POSITION):
        return
    cells = np.stack([table.values[draft.mapped[key].column] for key in keys], axis=1)
    lost = placeholders(make_stream("mocap", np.arange(float(len(cells))), cells, [q for _, q in keys]))
    for key in keys if lost.any() else ():
        column = draft.mapped[key].column
        table.values[column] = np.where(lost, np.nan, table.values[column])


def _without_nines(draft: Draft, table: Table) -> None:
    """A number such as 9999 that several rows have, and that is far from all others, is no reading."""
    found: dict[float, list[str]] = {}
    for key, drafted in draft.mapped.items():
        cells = table.values.get(drafted.column)
        if cells is None or key == TIME or drafted.invalid is not None:
            continue
        largest = cells[int(np.nanargmax(np.abs(cells)))] if np.isfinite(cells).any() else 0.0
        others = np.abs(cells[np.isfinite(cells) & (cells != largest)])
        if re.fullmatch(r"-?99+(\.9+)?", f"{largest:.12g}") and np.sum(cells == largest) >= FEWEST_NINES and len(
                others) and FAR * others.max() < abs(largest):
            draft.mapped[key] = replace(drafted, invalid=float(largest))
            found.setdefault(float(largest), []).append(drafted.column)
            table.values[drafted.column] = np.where(cells == largest, np.nan, cells)
    draft.notes += [f"{', '.join(columns)}: {value:g} is no reading, since no other number is near it"
                    for value, columns in found.items()]


def _topic_of_px4(table: Table) -> str:
    """The topic that the columns of a renamed file are, or "": the attitude, a set-point, or the local position.

    The z of the local position only falls in flight, and its acceleration has no gravity in it."""
    for column, topic in OF_TOPICS.items():
        if column in table.values:
            return topic
    need = ("timestamp", "x", "y", "z", "vx", "vy", "vz")
    if not all(n in table.values for n in need):
        return ""
    if "yawspeed" in table.values and any(n in table.values for n in OF_SET_POINTS):
        return "vehicle_local_position_setpoint"
    az = table.values.get("az")
    level = az is None or abs(float(np.nanmedian(az))) < 0.5 * GRAVITY_M_S2
    return "vehicle_local_position" if level and evidence.falls_in_flight(table.values["z"]) else ""


def _time(draft: Draft, table: Table, place: str) -> np.ndarray:
    """Drafts the time, and gives (n,) s since the first row. Raises InputError if it is missing."""
    if TIME not in draft.mapped and is_a_stand([*table.values]):
        raise InputError(place, "the table of a thrust stand, which has no time and needs no map",
                         "nanobench thrust reads it as it is")
    rising = [c for c, dates in table.dates.items() if float(np.nanmedian(np.diff(dates))) > 0.0]
    if TIME not in draft.mapped and len(rising) == 1:  # by any name
        draft.mapped[TIME] = Drafted(rising[0], _date_unit(rising[0]), "known", "dates")
        draft.unknown.pop(draft.mapped[TIME].column, None)
    if TIME not in draft.mapped:
        seen = ", ".join(map(repr, table.values))
        also = f"; of text: {', '.join(map(repr, table.texts))}" if table.texts else ""
        rises = [c for c, v in table.values.items() if len(v) > 2 and np.all(np.diff(v) > 0.0)]
        hint = f"{rises[0]!r} rises from row to row: is it the time? " if rises else ""
        raise InputError(place, f"no column is named like a time; its columns: {seen}{also}",
                         f"{hint}rename it to t, time or timestamp. Or write the map by hand; for a frame rate: "
                         'time = {column = "frame", rate_hz = 100}')
    time = draft.mapped[TIME]
    if time.column in table.dates:
        draft.mapped[TIME] = replace(time, unit=_date_unit(time.column), status="known", why="dates")
        seconds = table.dates[time.column]
        return np.asarray(seconds - seconds[np.isfinite(seconds)][:1])
    stamps = counted_on(table.values[time.column])
    if stamps is not table.values[time.column]:
        draft.notes.append(f"{time.column}: a counter that begins again at 0, and is counted on")
    rest, rest_unit = rest_of_seconds(time.column, table.values)
    if rest and float(np.nanmax(table.values[rest], initial=0.0)) * factor(rest_unit) <= 1.0:
        seconds = stamps + table.values[rest] * factor(rest_unit)
        draft.mapped[TIME] = replace(time, unit="s", status="known", why="whole seconds and a fraction",
                                     add=(rest, rest_unit))
        draft.unknown.pop(rest, None)
        return np.asarray(seconds - seconds[np.isfinite(seconds)][:1])
    steps = np.diff(stamps)
    if (falls := int(np.sum(steps < 0.0))) > FALLS * len(steps):
        raise InputError(f"{place}: column {time.column}", f"falls in {falls} of {len(stamps)} rows: they are out of "
                         "order, or it is no time", "sort the rows by time, or name another column t")
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not len(steps):
        draft.notes.append(f"{time.column} never grows: is it the time?")
        return np.arange(len(stamps), dtype=float)
    step = float(np.median(steps))
    unit = time.unit
    fits = [u for u in dict.fromkeys((*SECONDS, unit)) if evidence.FASTEST_STEP_S <= step * factor(u) <= SLOWEST_STEP_S]
    if not fits:
        raise InputError(f"{place}: column {time.column}", f"rows are {step:g} apart: in no unit a recording's time",
                         "write its unit in the map, or name another column t")
    dated = [u for u in fits if evidence.is_recent(float(stamps[np.isfinite(stamps)][0]) * factor(u))]
    if time.unit == "ns" and time.why != "stated" and not dated and len(fits) > 1:
        time = replace(time, status="assumed")  # an ecosystem whose nanoseconds are since 1970, and these are not
    if unit not in fits or time.status != "known":
        unit = fits[0]
    if len(dated) == 1 and (unit != dated[0] or len(fits) > 1):
        draft.mapped[TIME] = replace(time, unit=dated[0], status="shown", why="seconds since 1970 in this unit")
        if unit != dated[0] and time.status == "known":
            draft.notes.append(f"{time.column}: in {unit}, as its name implies, it would be decades ago; {dated[0]}, "
                               "since its rows are then of this century")
        return np.asarray((stamps - stamps[np.isfinite(stamps)][0]) * factor(dated[0]))
    late = not dated and float(np.nanmax(stamps)) * factor(unit) > evidence.LONGEST_COUNT_S
    if late:
        draft.notes.append(f"{time.column}: no date of this century in any unit, and too long for a clock that started "
                           f"at 0: {unit} is assumed; check it")
        draft.mapped[TIME] = replace(time, unit=unit, status="assumed", why="no date of this century")
    elif time.status != "known" and len(fits) > 1:
        either = " or ".join(fits)
        draft.notes.append(f"{time.column}: rows are {step:g} apart, in {either}: {unit} is assumed; check it")
        draft.mapped[TIME] = replace(time, unit=unit, status="assumed", why=f"rows are {step:g} apart")
    elif unit != time.unit or time.status == "assumed":
        draft.notes.append(f"{time.column}: rows are {step:g} apart, so it is in {unit}")
        draft.mapped[TIME] = replace(time, unit=unit, status="shown", why=f"rows are {step:g} apart")
    return np.asarray((stamps - stamps[np.isfinite(stamps)][0]) * factor(unit))


def _date_unit(column: str) -> str:
    return unit if (unit := unit_of(column)) in DATE_UNITS else ISO


def _order_turn(stream: str, draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Gives q0 .. q3 their letters where only one order has the vehicle upright. A turn about z looks upright in the
    other order, too, when it is half a turn."""
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
        why = "of a quaternion by number: the scalar is the first or the last, and these numbers do not show which"
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


