"""INSANE (CSV, folders or zip archives of its sensors): several inertial sensors, RTK, motion capture indoors.

``px4_imu.csv`` is the vehicle's inertial sensor (forward, left, up) and becomes ``imu``. ``mocap_vehicle_data.csv``, or
outdoors ``ground_truth/ground_truth_8hz.csv`` from two RTK receivers, becomes ``mocap``. All others become
``extra_NAME``: the other inertial sensors have different axes, and ``px4_rpm.csv`` is normalised.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Fault, Flight, Stream
from .base import cell_faults, text_fault
from .cells import Grid, read_grid
from .column_map import ColumnMap, Entry
from .members import Gathered, names_in
from .neurobem import unit_length
from .payload import ZIP_MAGIC
from .sheets import Sheet
from .table import flight_of
from .timestamps import not_seconds
from .uzhfpv import check_units, later

HEADER = b"t, a_x, a_y, a_z, w_x, w_y, w_z"
"""The line of names of every inertial sensor, as the data set's export writes it."""
ACC, GYRO = tuple(f"a_{a}" for a in "xyz"), tuple(f"w_{a}" for a in "xyz")
POSITION, ROTATION = tuple(f"p_{a}" for a in "xyz"), ["q_x", "q_y", "q_z", "q_w"]
IMUS = ("px4_imu", "lsm_imu", "rs_imu")
"""The vehicle's first."""
TRUTHS = ("mocap_vehicle_data", "ground_truth_8hz", "ground_truth_80hz")
"""The first that is there. At 80 Hz the truth is interpolated between its samples."""
OTHERS = ("rtk_gps1", "rtk_gps2", "px4_gps", "px4_gps_vel_data", "px4_rpm", "px4_mag", "px4_baro", "lsm_mag",
          "lrf_range", "uwb_range", "rs_odom", "mocap_tag_board")
UNITS = {**{f"p_{a}": "m" for a in "xyz"}, **{f"v_{a}": "m/s" for a in "xyz"}, **dict.fromkeys(ACC, "m/s^2"),
         **dict.fromkeys(GYRO, "rad/s"), "lat": "deg", "long": "deg", "alt": "m", "p": "Pa"}
"""Column that is kept apart -> its unit in the files."""
_KNOWN = re.compile(rf"(?:.*/)?({'|'.join((*IMUS, *TRUTHS, *OTHERS))})\.csv")


class Insane:
    """Source ``insane``."""

    name = "insane"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if head.startswith(ZIP_MAGIC):
            return any(Path(name).stem in IMUS for name in self.wanted(names_in(path)))
        return head.split(b"\n", 1)[0].strip() == HEADER

    def wanted(self, names: Sequence[str]) -> list[str]:
        """The tables of sensors in an archive."""
        return [name for name in names if _KNOWN.fullmatch(name) and not name.startswith("__MACOSX")]

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """The tables of a folder are one recording; one of another name, and an archive, is one alone."""
        found: list[Gathered] = []
        for folder in dict.fromkeys(path.parent for path in paths):
            here = [path for path in paths if path.parent == folder]
            imus = [path for path in here if path.stem in IMUS and path.suffix == ".csv"]
            found += [Gathered(path, path, {path.name: path}) for path in here if path not in imus]
            if imus:
                files = {path.name: path for path in imus}
                for place in (folder, folder / "ground_truth"):
                    files |= {path.name: path for stem in (*TRUTHS, *OTHERS)
                              if (path := place / f"{stem}.csv").is_file()}
                alone = len(files) == 1
                found.append(Gathered(imus[0] if alone else folder, imus[0] if alone else folder, files))
        return found

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        tables: dict[str, bytes] = {}
        for name, data in members.items():
            stem = Path(name).stem
            if stem in tables:
                raise InputError(str(place), f"holds two tables {stem}.csv, so it is no single recording",
                                 "unpack it and give the folder")
            tables[stem] = data
        first = next((s for s in IMUS if s in tables), next(iter(tables)))
        truth = next((s for s in TRUTHS if s in tables), None)
        where = {s: str(place) if len(tables) == 1 else f"{place}/{s}.csv" for s in tables}
        flight = _imu(Path(where[first]), tables[first])
        notes = [f"imu is {first}" + ("" if first == IMUS[0] else ", in the axes of that sensor")]
        parts = [flight]
        if truth is not None:
            parts.insert(0, _truth(Path(where[truth]), tables[truth]))
            notes.append(f"mocap is {truth}" + ("" if truth == TRUTHS[0] else
                                                ": two RTK receivers and a magnetometer, no motion capture"))
        kept = [_apart(stem, data, where[stem]) for stem, data in tables.items()
                if stem not in (first, truth) and stem not in TRUTHS]
        zero = min([p.epoch_s for p in parts] + [epoch for _, epoch, _, _ in kept])
        streams: dict[str, Stream] = {}
        findings: list[Fault] = []
        for part in parts:
            streams |= {name: later(stream, part.epoch_s - zero) for name, stream in part.streams.items()}
            findings += [replace(f, start_s=f.start_s + part.epoch_s - zero, end_s=f.end_s + part.epoch_s - zero)
                         for f in part.provenance.findings]
        for stem, epoch, stream, more in kept:
            streams[f"extra_{stem}"] = later(stream, epoch - zero)
            findings += [replace(f, start_s=f.start_s + epoch - zero, end_s=f.end_s + epoch - zero) for f in more]
        notes.append("clocks are those of the files; the audit measures how far they are apart")
        provenance = replace(flight.provenance, path=str(place), findings=tuple(findings),
                             notes=(*(n for p in parts for n in p.provenance.notes), *notes))
        return replace(flight, name=place.name, streams=streams, epoch_s=zero, provenance=provenance,
                       metadata={**flight.metadata, "read_as": notes})


def _table(data: bytes, place: str, numeric: Sequence[str]) -> Grid:
    grid = read_grid(data, place, numeric={"t", *numeric}, time="t")
    stamps = grid.columns.get("t", np.zeros(0))
    if not np.isfinite(stamps).any():
        raise InputError(f"{place}: column t", "is not there or holds no number", "take another copy of the file")
    if (why := not_seconds(stamps, declared=True)) is not None:
        raise InputError(f"{place}: column t", why, "the format has seconds")
    return grid


def _imu(path: Path, data: bytes) -> Flight:
    grid = _table(data, str(path), (*ACC, *GYRO))
    check_units(grid.columns, ACC, GYRO, str(path))
    entries = [Entry("imu", f"acc_{a}", f"a_{a}", unit="m/s^2") for a in "xyz"]
    entries += [Entry("imu", f"gyro_{a}", f"w_{a}", unit="rad/s") for a in "xyz"]
    return flight_of(_map(entries), grid, path, Insane.name)


def _truth(path: Path, data: bytes) -> Flight:
    grid = _table(data, str(path), (*POSITION, *ROTATION))
    if missing := [name for name in (*POSITION, *ROTATION) if name not in grid.columns]:
        raise InputError(f"{path}: column {missing[0]}", "is not there or holds no number",
                         "a truth has t, p_x to p_z and q_w to q_z")
    faults = unit_length(grid, ROTATION)
    entries = [Entry("mocap", f"p{a}", f"p_{a}", unit="m") for a in "xyz"]
    entries += [Entry("mocap", f"q{a}", f"q_{a}") for a in "xyzw"]
    flight = flight_of(_map(entries), grid, path, Insane.name)
    return replace(flight, provenance=replace(flight.provenance, findings=(*flight.provenance.findings, *faults)))


def _map(entries: list[Entry]) -> ColumnMap:
    return ColumnMap("the format", Entry("", "time", "t", unit="s"), tuple(entries), {}, "")


def _apart(stem: str, data: bytes, place: str) -> tuple[str, float, Stream, list[Fault]]:
    """A table outside the vocabulary: its name, Unix time of its first row, numbers as found, and findings."""
    grid = _table(data, place, ())
    kept = np.flatnonzero(np.isfinite(grid.columns["t"]))
    names = [n for n in grid.columns if n != "t"]
    if not names:
        raise InputError(place, "has no column of numbers", "take another copy of the file")
    stamps = grid.columns["t"][kept]
    time_s = stamps - stamps[0]
    units = tuple(UNITS.get(n, "1") for n in names)
    stream = Stream(time_s, np.stack([grid.columns[n][kept] for n in names], axis=1), tuple(names), tuple(names), units)
    name = f"extra_{stem}"
    faults = cell_faults(grid, time_s, kept, dict.fromkeys(names, name))
    if grid.truncated:
        faults.append(text_fault("truncated", name, (), grid.truncated, (float(time_s[-1]),) * 2, 1.0, "rows"))
    return stem, float(stamps[0]), stream, faults
