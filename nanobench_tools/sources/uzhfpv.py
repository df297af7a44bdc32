"""UZH-FPV text: ``imu.txt``, and the ``groundtruth.txt`` in the same folder.

Blanks between the cells, below ``# timestamp ang_vel_x .. lin_acc_z`` or ``# id timestamp ..``: seconds, rad/s, m/s^2.
Some files number their rows without naming this column.
A groundtruth.txt alone is a TUM trajectory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..errors import InputError, NanobenchError
from ..flight import Flight, Stream
from ..units import GRAVITY_M_S2
from .cells import read_grid
from .column_map import ColumnMap, Entry
from .dialect import normalise_text
from .header import header_of
from .members import Gathered
from .payload import head
from .sheets import Sheet
from .table import flight_of
from .timestamps import not_seconds
from .tum import TumTrajectory

TRUTH = "groundtruth.txt"
GYRO, ACC = tuple(f"ang_vel_{a}" for a in "xyz"), tuple(f"lin_acc_{a}" for a in "xyz")
ROWS_SEEN = 20
"""Rows from which a counter is recognised."""
GRAVITY_FACTOR = 1.5
"""The median specific force of a flight is gravity to within this factor; g instead of m/s^2 is 9.8 off."""
FASTEST_RAD_S = 70.0
"""Twice the full scale of gyros of small vehicles: degrees exceed it, radians do not."""


class UzhFpv:
    """Source ``uzhfpv``."""

    name = "uzhfpv"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if b"ang_vel_x" not in head or b"\x00" in head[:512]:
            return False
        names, dialect = header_of(head)
        return dialect.delimiter is None and set(names) <= {"id", "timestamp", *GYRO, *ACC} and (
            {"timestamp", *GYRO, *ACC} <= set(names))

    def wanted(self, names: Sequence[str]) -> list[str]:
        return []

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """An IMU and the truth in its folder, if that is a trajectory. Several IMUs of a folder have no truth."""
        found = []
        for path in paths:
            truth = path.parent / TRUTH
            alone = sum(p.parent == path.parent for p in paths) > 1 or not _is_truth(truth)
            files = {path.name: path} if alone else {path.name: path, TRUTH: truth}
            found.append(Gathered(path if alone else path.parent, path if alone else path.parent, files))
        return found

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        imu = next(name for name in members if name != TRUTH)
        flight = _imu(place / imu if len(members) > 1 else place, members[imu])
        if TRUTH not in members:
            return flight
        truth = TumTrajectory().read(place / TRUTH, with_id(members[TRUTH]))
        zero = min(flight.epoch_s, truth.epoch_s)
        streams = {name: later(stream, part.epoch_s - zero) for part in (truth, flight)
                   for name, stream in part.streams.items()}
        findings = [replace(f, start_s=f.start_s + part.epoch_s - zero, end_s=f.end_s + part.epoch_s - zero)
                    for part in (truth, flight) for f in part.provenance.findings]
        return replace(flight, streams=streams, epoch_s=zero,
                       provenance=replace(flight.provenance, path=str(place), findings=tuple(findings)))


def with_id(data: bytes) -> bytes:
    """The text with a name for a first column that counts the rows, where its line of names does not have one."""
    text = normalise_text(data)
    first, _, rest = text.partition(b"\n")
    names = first.lstrip(b"#").split()
    rows = [line.split() for line in rest.split(b"\n", ROWS_SEEN)[:ROWS_SEEN] if line.strip()]
    if not first.startswith(b"#") or names[:1] != [b"timestamp"] or len(rows) < 3:
        return data
    rows = [row for row in rows[:-1] if len(row) == len(names) + 1 and row[0].isdigit()]
    numbers = [int(row[0]) for row in rows]
    counts = len(rows) >= 2 and all(b - a == 1 for a, b in pairwise(numbers))
    return b"# id " + b" ".join(names) + b"\n" + rest if counts else data


def _is_truth(path: Path) -> bool:
    try:
        return path.is_file() and TumTrajectory().recognises(path, with_id(head(path)))
    except NanobenchError:
        return False


def _imu(path: Path, data: bytes) -> Flight:
    place = str(path)
    grid = read_grid(with_id(data), place, numeric={*GYRO, *ACC}, time="timestamp")
    if (why := not_seconds(grid.columns.get("timestamp", np.zeros(0)))) is not None:
        raise InputError(f"{place}: column timestamp", why, "the format has seconds; read it with a column map")
    check_units(grid.columns, ACC, GYRO, place)
    entries = [Entry("imu", f"gyro_{a}", f"ang_vel_{a}", unit="rad/s") for a in "xyz"]
    entries += [Entry("imu", f"acc_{a}", f"lin_acc_{a}", unit="m/s^2") for a in "xyz"]
    return flight_of(ColumnMap("the format", Entry("", "time", "timestamp", unit="s"), tuple(entries), {}, ""), grid,
                     path, UzhFpv.name)


def check_units(columns: Mapping[str, np.ndarray], acc: Sequence[str], gyro: Sequence[str], place: str) -> None:
    """InputError where columns are no specific force in m/s^2 or no rates in rad/s."""
    size = _norm(columns, acc)
    if not GRAVITY_M_S2 / GRAVITY_FACTOR < size < GRAVITY_M_S2 * GRAVITY_FACTOR:
        raise InputError(f"{place}: column {acc[0]}", f"the median specific force is {size:.3g}, where gravity in "
                         "m/s^2 belongs", "read it with a column map that gives the unit")
    rates = [np.abs(columns[g]) for g in gyro if g in columns]
    fastest = max((float(np.nanquantile(rate, 0.99)) for rate in rates), default=0.0)
    if fastest > FASTEST_RAD_S:
        raise InputError(f"{place}: column {gyro[0]}", f"reaches {fastest:.3g}, too fast for rad/s",
                         "read it with a column map that gives the unit")


def _norm(columns: Mapping[str, np.ndarray], names: Sequence[str]) -> float:
    if any(name not in columns for name in names):
        return float("nan")
    return float(np.nanmedian(np.linalg.norm(np.stack([columns[name] for name in names]), axis=0)))


def later(stream: Stream, by_s: float) -> Stream:
    """``stream`` on a time axis that begins ``by_s`` earlier."""
    return replace(stream, time_s=stream.time_s + by_s) if by_s else stream
