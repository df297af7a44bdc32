"""Recordings of the IDSIA nano-quadrotor benchmark (Crazyflie 2.1 Brushless): raw CSV, or Parquet of its model export.

All columns are on a grid of 100 Hz that holds the last value. ``m1_thrust`` .. are motor commands as a share of full.
``m1_erpm`` .. are electrical speeds of motors with six pole pairs. ``ax ay az`` is the acceleration of the onboard
estimate in the world, with gravity. There is no accelerometer, and the motion capture has positions only. ``torch_yaw``
is a copy of ``thrust`` and is not read.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..flight import Fault, Flight
from ..units import GRAVITY_M_S2, factor
from .base import text_fault
from .cells import GIGANTIC, Grid, read_grid
from .column_map import ColumnMap, Entry
from .header import header_of
from .payload import check_size
from .sheets import Sheet
from .strangers import PARQUET_MAGIC
from .table import flight_of
from .tum_layout import NORM_TOLERANCE

POLE_PAIRS = 6
"""Of the motors of the Crazyflie 2.1 Brushless."""
INVALID_ERPM = (65535.0, 6553500.0)
"""The cell of a telegram that was lost, as it is and in hundreds."""
ROTOR_RAD_S = (200.0, 6000.0)
"""Median speed of a rotor in flight."""
STAMP = "ros_timestamp"
APART_S = 0.25
"""A row whose grid time is farther from its arrival is not where the grid puts it; held values lag by up to 0.1 s."""
MOST_APART = 0.02
"""Share of such rows up to which they are left out. Beyond, the grid is no clock, and the arrivals are the time."""
_NEEDED = {"t", "x", "y", "z", "qx", "qw", "wx", "m1_thrust", "m1_erpm", "Vbat"}
_TRUTH = {"x_poses": "{}_poses", "x_mocap": "{}_mocap"}
_WANTED = {"x_setpoint": "{}_setpoint", "x_r": "{}_r"}
_FILTERED = "m1_rads"
"""A column of the processed tables, whose values were smoothed."""


class Idsia:
    """Source ``idsia``."""

    name = "idsia"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if head.startswith(PARQUET_MAGIC):
            try:
                names = set(pq.read_schema(path).names)
            except (pa.ArrowException, OSError, ValueError):
                return False
        elif b"\x00" in head[:512] or b"_erpm" not in head:
            return False
        else:
            names = set(header_of(head)[0])
        return names >= _NEEDED and bool(names & _TRUTH.keys()) and _FILTERED not in names

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        grid = _grid(data, place)
        notes, faults = _cleaned(grid, place)
        clock, apart = _clock(grid)
        gravity = GRAVITY_M_S2 if float(np.nanmedian(grid.columns.get("az", np.zeros(1)))) > 0.5 * GRAVITY_M_S2 else 0.0
        flight = flight_of(_map(grid, clock, gravity), grid, path, self.name)
        if clock == STAMP:
            flight = _first_of_each(flight)
            notes.append(f"time is {STAMP}: the grid leaves it by more than {APART_S} s in many rows")
        elif len(apart):
            flight, fault = _without(flight, grid, apart)
            faults.append(fault)
        if clock == "t" and STAMP in grid.columns:
            flight = replace(flight, epoch_s=float(np.nanmedian(grid.columns[STAMP] - grid.columns["t"])))
        notes += ["estimator_acc: gravity taken off az"] * bool(gravity)
        provenance = replace(flight.provenance, notes=(*flight.provenance.notes, *notes),
                             findings=(*flight.provenance.findings, *faults))
        return replace(flight, provenance=provenance, metadata={**flight.metadata, "read_as": notes})


def _grid(data: bytes, place: str) -> Grid:
    if not data.startswith(PARQUET_MAGIC):
        grid = read_grid(data, place, numeric=_NEEDED)
        grid.columns = {name: np.array(cells) for name, cells in grid.columns.items()}
        return grid
    try:
        with pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True) as file:
            check_size(place, file.metadata.num_rows * file.metadata.num_columns, data)
            table = file.read()
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(place, f"cannot be read as Parquet ({str(error).splitlines()[0][:80]})",
                         "take another copy") from None
    grid = Grid({}, np.arange(1, table.num_rows + 1), table.num_rows)
    for name in table.column_names:
        kind = table.schema.field(name).type
        if pa.types.is_floating(kind) or pa.types.is_integer(kind):
            values = table.column(name).to_numpy().astype(float)
            values[~(np.abs(values) < GIGANTIC)] = np.nan
            if np.isfinite(values).any():
                grid.columns[name] = values
    return grid


def _cleaned(grid: Grid, place: str) -> tuple[list[str], list[Fault]]:
    """Marks invalid cells as missing, and brings rotor speeds to rad/s. InputError for motors in another unit."""
    columns, notes, faults = grid.columns, [], []
    motors = [f"m{k}_thrust" for k in (1, 2, 3, 4) if f"m{k}_thrust" in columns]
    if motors and (top := max(float(np.nanmax(columns[m])) for m in motors)) > 1.0 + 1e-6:
        raise InputError(f"{place}: column {motors[0]}", f"reaches {top:.4g}, where a share of full command belongs",
                         "read it with a column map")
    speeds = [n for n in (f"m{k}_erpm" for k in (1, 2, 3, 4)) if n in columns]
    for name in speeds:
        cells = np.where(np.isin(columns[name], INVALID_ERPM), np.nan, columns[name])
        columns[name] = cells / POLE_PAIRS * factor("rpm")
    if speeds:
        turning = np.concatenate([columns[n][columns[n] > 0.0] for n in speeds])
        middle = float(np.median(turning)) if len(turning) else 0.0
        if ROTOR_RAD_S[0] <= middle <= ROTOR_RAD_S[1]:
            notes.append(f"rpm: electrical speed divided by {POLE_PAIRS} pole pairs")
        elif len(turning):
            for name in speeds:
                del columns[name]
                grid.bad.pop(name, None)
            notes.append(f"rpm left out: {middle:.3g} rad/s with {POLE_PAIRS} pole pairs is no speed of these rotors")
    turn = [f"q{a}" for a in "xyzw"]
    if all(q in columns for q in turn):
        length = np.linalg.norm(np.stack([columns[q] for q in turn]), axis=0)
        wrong = np.flatnonzero(np.abs(length - 1.0) > NORM_TOLERANCE)
        for q in turn:
            columns[q][wrong] = np.nan
        if len(wrong):
            time = columns["t"] - columns["t"][0] if "t" in columns else np.zeros(len(length))
            faults.append(text_fault("bad_cell", "attitude_qw", tuple(turn), f"{len(wrong)} quaternions without unit "
                                     f"length, read as missing, the first in row {wrong[0] + 1}",
                                     (float(time[wrong[0]]), float(time[wrong[-1]])), float(len(wrong)), "rows"))
    for pattern in _WANTED.values():
        names = [pattern.format(a) for a in "xyz"]
        if all(n in columns for n in names):
            set_ = np.flatnonzero(np.any([columns[n] != 0.0 for n in names], axis=0))
            for n in (*names, pattern.format("yaw")):
                if n in columns:
                    columns[n][: set_[0] if len(set_) else None] = np.nan
    return notes, faults


def _clock(grid: Grid) -> tuple[str, np.ndarray]:
    """The column that is the time, and the rows that the grid displaces."""
    stamps = grid.columns.get(STAMP)
    if stamps is None or "t" not in grid.columns:
        return "t", np.zeros(0, dtype=int)
    late = stamps - grid.columns["t"]
    apart = np.flatnonzero(np.abs(late - np.nanmedian(late)) > APART_S)
    return (STAMP if len(apart) > MOST_APART * len(late) else "t"), apart


def _map(grid: Grid, clock: str, gravity: float) -> ColumnMap:
    truth = next(pattern for name, pattern in _TRUTH.items() if name in grid.columns) if (
        _TRUTH.keys() & grid.columns.keys()) else "{}_poses"
    wanted = next((pattern for name, pattern in _WANTED.items() if name in grid.columns), "{}_setpoint")
    entries = [Entry("mocap", f"p{a}", truth.format(a), unit="m") for a in "xyz"]
    entries += [Entry("estimator", a, a, unit="m") for a in "xyz"]
    entries += [Entry("estimator", f"v{a}", f"v{a}", unit="m/s") for a in "xyz"]
    entries += [Entry("attitude_qw", f"q{a}", f"q{a}") for a in "xyzw"]
    entries += [Entry("imu", f"gyro_{a}", f"w{a}", unit="rad/s") for a in "xyz"]
    entries += [Entry("estimator_acc", f"a{a}", f"a{a}", unit="m/s^2", offset=-gravity * (a == "z")) for a in "xyz"]
    entries += [Entry("motor", f"m{k}", f"m{k}_thrust") for k in (1, 2, 3, 4)]
    entries += [Entry("rpm", f"m{k}", f"m{k}_erpm", unit="rad/s") for k in (1, 2, 3, 4)]
    entries += [Entry("command", "thrust", "thrust"), Entry("battery", "vbat", "Vbat", unit="V")]
    entries += [Entry("setpoint", a, wanted.format(a), unit="m") for a in "xyz"]
    entries += [Entry("setpoint", "yaw", wanted.format("yaw"), unit="rad")]
    return ColumnMap("the format", Entry("", "time", clock, unit="s"),
                     tuple(e for e in entries if e.column in grid.columns), {}, "")


def _without(flight: Flight, grid: Grid, apart: np.ndarray) -> tuple[Flight, Fault]:
    """The flight without displaced rows, and the finding."""
    time_s = grid.columns["t"] - grid.columns["t"][0]
    displaced = time_s[apart]
    streams = {name: s.rows(~np.isin(s.time_s, displaced)) for name, s in flight.streams.items()}
    span = (float(displaced.min()), float(displaced.max()))
    return replace(flight, streams=streams), text_fault(
        "bad_cell", "", (), f"{len(apart)} rows left out, the first row {apart[0] + 1}: they arrived more than "
        f"{APART_S} s from where the grid puts them", span, float(len(apart)), "rows")


def _first_of_each(flight: Flight) -> Flight:
    """Rows that arrived later than all before; rows of the grid between two arrivals repeat the first."""
    streams = {}
    for name, s in flight.streams.items():
        latest = np.maximum.accumulate(s.time_s)
        streams[name] = s.rows(np.concatenate(([True], s.time_s[1:] > latest[:-1])))
    return replace(flight, streams=streams)
