"""One sensor of an ASL data set: the columns and rows of its data.csv, and its pose in the body of sensor.yaml."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import yaml

from ..errors import InputError
from ..flight import Fault
from ..units import SI_FACTOR, factor
from .base import cell_faults, text_fault
from .cells import Grid, LostRow, read_grid
from .dialect import clean_name, normalise_text
from .payload import HEAD_BYTES, read_file, unpack
from .tum_layout import NORM_TOLERANCE, POSE, look, text_of
from .units_as_written import unit_as_written

AXES = "xyz"
VECTORS: dict[str, tuple[tuple[str, ...], str]] = {
    "position": (tuple(f"p_RS_R_{a}" for a in AXES), "m"),
    "quaternion": (tuple(f"q_RS_{a}" for a in "xyzw"), "1"),
    "velocity": (tuple(f"v_RS_R_{a}" for a in AXES), "m/s"),
    "gyro": (tuple(f"w_RS_S_{a}" for a in AXES), "rad/s"),
    "acc": (tuple(f"a_RS_S_{a}" for a in AXES), "m/s^2"),
    "gyro_bias": (tuple(f"b_w_RS_S_{a}" for a in AXES), "rad/s"),
    "acc_bias": (tuple(f"b_a_RS_S_{a}" for a in AXES), "m/s^2"),
}
"""Vector -> its columns in our order, and their SI unit. R is the world, S the sensor."""
SHORT = {"position": ("px", "py", "pz"), "quaternion": ("qx", "qy", "qz", "qw"), "velocity": ("vx", "vy", "vz"),
         "gyro_bias": ("bwx", "bwy", "bwz"), "acc_bias": ("bax", "bay", "baz")}
"""The names of the same columns in a table of open_vins; ``bwx`` .. ``baz`` distinguish it from any other table."""
SENSORS = ("imu", "state_groundtruth_estimate", "vicon", "leica", "mocap", "pose", "position", "gps")
"""Names of the folders of sensors, before their number."""
TIME_NAMES = ("timestamp", "time")
FASTEST_STEP_NS, SLOWEST_STEP_NS = 400_000, 2_000_000_000
"""Median step of a sensor: 2.5 kHz to 2 s. Timestamps in another unit lie outside."""
FARTHEST_NS = 10**14
"""A timestamp farther from the median than a day and four hours is none of this recording."""
MOST_YAML_BYTES = 100_000
_NAME = re.compile(r"\s*(.*?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*")
_DIRECTIVE = re.compile(r"^%.*$|!!opencv-matrix", re.MULTILINE)
ORTHONORMAL = 1e-2
"""Largest error of a rotation matrix that was printed with a few digits."""


@dataclass(frozen=True)
class AslColumns:
    """Column name as in the table and SI factor of each vector's components; ``time`` and its unit in ns. ``lacking``:
    columns of vectors that are not complete."""

    time: str
    unit_ns: int
    vectors: dict[str, tuple[tuple[str, float], ...]]
    lacking: tuple[str, ...] = ()


@dataclass
class AslRows:
    """``stamps_ns`` (n,) int; vectors (n, 3), quaternions (n, 4) x, y, z, w. ``faults_of(time_s)`` are the findings."""

    stamps_ns: np.ndarray
    vectors: dict[str, np.ndarray]
    columns: AslColumns
    grid: Grid
    kept: np.ndarray
    wrong_norm: list[int] = field(default_factory=list)

    def faults_of(self, time_s: np.ndarray, stream: str) -> list[Fault]:
        """Cells and rows without a number, in time."""
        end = float(time_s[-1])
        used = {name: stream for parts in self.columns.vectors.values() for name, _ in parts}
        faults = cell_faults(self.grid, time_s, self.kept, used)
        if self.grid.truncated:
            faults.append(text_fault("truncated", "", (), self.grid.truncated, (end, end), 1.0, "rows"))
        if self.columns.lacking:
            faults.append(text_fault("missing_column", stream, self.columns.lacking,
                                     f"{', '.join(self.columns.lacking)}: not in the file", (float(time_s[0]), end),
                                     float(len(self.columns.lacking)), "columns"))
        if self.wrong_norm:
            at = time_s[self.wrong_norm]
            faults.append(text_fault("bad_cell", stream, VECTORS["quaternion"][0],
                                     f"{len(at)} quaternions without unit length, read as missing, the first in row "
                                     f"{int(self.kept[self.wrong_norm[0]]) + 1}", (float(at[0]), float(at[-1])),
                                     float(len(at)), "rows"))
        return faults


def header_line(text: bytes) -> str:
    """The first line that is not blank."""
    lines = normalise_text(text[:HEAD_BYTES]).decode("utf-8", errors="replace").split("\n")
    return next((line for line in lines if line.strip()), "")


def columns_of(line: str) -> AslColumns | None:
    """What the line of names of an ASL sensor says; None for any other line, also that of a camera."""
    parts = [_NAME.fullmatch(cell) for cell in line.split(",")]
    names = [(match[1].lstrip("#").strip(), match[2] or "") for match in parts if match]
    if len(names) != len(parts) or names[0][0] not in TIME_NAMES:
        return None
    raw = [clean_name(cell) for cell in line.split(",")]
    at = {name: k for k, (name, _) in reversed(list(enumerate(names)))}
    short = all(c in at for parts in SHORT.values() for c in parts)
    vectors: dict[str, tuple[tuple[str, float], ...]] = {}
    lacking: list[str] = []
    for vector, (long, si) in VECTORS.items():
        wanted = SHORT.get(vector, ()) if short else long
        here = [c for c in wanted if c in at]
        if len(here) == len(wanted) and here:
            vectors[vector] = tuple((raw[at[c]], _factor(names[at[c]][1], si)) for c in wanted)
        elif here:
            lacking += [c for c in wanted if c not in at]
    if not vectors:
        return None
    unit = names[0][1] or "ns"
    scale = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}.get(unit_as_written(unit) or "", 0)
    return AslColumns(raw[0], scale, vectors, tuple(lacking))


def as_table(data: bytes) -> bytes:
    """A TUM trajectory in s and m, of eight cells a row, as a table of a sensor; any other text as it is."""
    if b"\x00" in data[:512] or columns_of(header_line(data)) is not None:
        return data
    lines = text_of(data).split("\n")
    seen = look(lines)
    rows = [cells for line in lines if (cells := line.split("#", 1)[0].split())]
    if (seen.layout is None or not seen.poses or seen.layout.length != 1.0 or seen.layout.time_unit not in ("", "s")
            or any(len(row) != len(POSE) + 1 for row in rows)):
        return data
    names = ["#timestamp [s]", *(f"{name} [{unit}]" for vector in ("position", "quaternion")
                                 for names, unit in [VECTORS[vector]] for name in names)]
    return "\n".join(",".join(row) for row in (names, *([row[k] for k in seen.layout.order] for row in rows))).encode()


def span_of(path: Path) -> tuple[AslColumns, int, int] | None:
    """Columns of a table and its first and last timestamp, ns; None for any other file, and one without them."""
    data = as_table(unpack(read_file(path), str(path)).data)
    columns = columns_of(header_line(data))
    lines = [line for line in data.split(b"\n") if line.strip()]
    if columns is None or len(lines) < 2:
        return None
    first, last = _stamps([lines[k].split(b",", 1)[0].strip() for k in (1, -1)], columns.unit_ns)
    return None if NO_TIME in (first, last) else (columns, int(first), int(last))


def _factor(written: str, si: str) -> float:
    """SI value of a unit in brackets; nan for one that does not fit."""
    unit = unit_as_written(written) if written else si
    same = {"m": ("m", "cm", "mm"), "m/s": ("m/s", "mm/s", "cm/s"), "m/s^2": ("m/s^2", "mm/s^2", "g", "mg"),
            "rad/s": ("rad/s", "deg/s", "mrad/s"), "1": ("1",)}[si]
    return factor(unit) if unit in same and unit in SI_FACTOR else float("nan")


def read_rows(data: bytes, place: str) -> AslRows:
    """Rows of a data.csv. InputError where its time, a unit or its quaternions cannot be what the format says."""
    columns = columns_of(header_line(data))
    if columns is None:
        raise InputError(place, "no line of names of an ASL sensor",
                         "restore it: #timestamp [ns],w_RS_S_x [rad s^-1] ...")
    if not columns.unit_ns:
        raise InputError(f"{place}: column {columns.time}", "its unit is unknown (known: s, ms, us, ns)", "mend it")
    for vector, parts in columns.vectors.items():
        if strange := [name for name, scale in parts if not np.isfinite(scale)]:
            raise InputError(f"{place}: column {strange[0]}", f"not a unit of the {vector}", "convert it to "
                             f"{VECTORS[vector][1]}")
    used = {name for parts in columns.vectors.values() for name, _ in parts}
    grid = read_grid(data, place, numeric=used, time=columns.time)
    stamps = _whole_stamps(data, grid) if columns.unit_ns == 1 else None
    if stamps is None:
        lines = normalise_text(data).split(b"\n")
        stamps = _stamps([lines[k - 1].split(b",", 1)[0].strip() for k in grid.lines], columns.unit_ns)
    placed = np.flatnonzero(stamps != NO_TIME)
    if not len(placed):
        raise InputError(f"{place}: column {columns.time}", "holds no time", "check it and its unit")
    near = np.abs(stamps[placed] - int(np.median(stamps[placed]))) < FARTHEST_NS
    kept = placed[near]
    out = np.ones(len(stamps), dtype=bool)
    out[kept] = False
    grid.lost += [LostRow(int(grid.lines[r]), int(r) - 1, f"no time of this recording in column {columns.time}")
                  for r in np.flatnonzero(out)]
    grid.lost.sort(key=lambda row: row.line)
    stamps = stamps[kept]
    steps = np.diff(stamps)
    if len(steps := steps[steps > 0]) and not FASTEST_STEP_NS <= (step := float(np.median(steps))) <= SLOWEST_STEP_NS:
        raise InputError(f"{place}: column {columns.time}", f"timestamps {step * 1e-9:.3g} s apart are those of no "
                         "sensor: they are not in the unit that the format or the header gives", "write it, as in "
                         "#timestamp [us]")
    vectors = {}
    for vector, parts in columns.vectors.items():
        if lost := [name for name, _ in parts if name not in grid.columns]:
            raise InputError(f"{place}: column {lost[0]}", "holds no number", "take another copy")
        vectors[vector] = np.stack([grid.columns[name][kept] * scale for name, scale in parts], axis=1)
    rows = AslRows(stamps, vectors, columns, grid, kept)
    if "quaternion" in vectors:
        _check_norm(rows, place)
    return rows


NO_TIME = np.iinfo(np.int64).min


def _whole_stamps(data: bytes, grid: Grid) -> np.ndarray | None:
    """(n,) int64 ns of a table without damage; None for any other, which is read cell by cell."""
    if grid.lost or grid.truncated or not np.array_equal(grid.lines, np.arange(2, len(grid.lines) + 2)):
        return None
    try:
        table = pacsv.read_csv(
            pa.BufferReader(data), pacsv.ReadOptions(use_threads=False, skip_rows=1, autogenerate_column_names=True),
            pacsv.ParseOptions(quote_char=False),
            pacsv.ConvertOptions(include_columns=["f0"], column_types={"f0": pa.int64()}, null_values=[]))
    except (pa.ArrowException, KeyError):
        return None
    stamps = table.column("f0")
    return stamps.to_numpy() if table.num_rows == len(grid.lines) and not stamps.null_count else None


def _stamps(cells: list[bytes], unit_ns: int) -> np.ndarray:
    """(n,) int64 ns; NO_TIME for a cell without one. Integers, since ns since 1970 have more digits than a float."""
    if unit_ns == 1 and all((cell.isdigit() and len(cell) < 19) or (cell[:1] == b"1" and len(cell) == 19 and
                            cell.isdigit()) for cell in cells):
        return np.array(cells).astype(np.int64)
    found = np.full(len(cells), NO_TIME)
    for k, cell in enumerate(cells):
        try:
            stamp = int(Decimal(cell.decode("ascii")) * unit_ns)
        except (InvalidOperation, ValueError, OverflowError):
            continue
        if abs(stamp) < 4 * 10**18:
            found[k] = stamp
    return found


def _check_norm(rows: AslRows, place: str) -> None:
    """Rows without a unit quaternion lose it; InputError where that is usual."""
    q = rows.vectors["quaternion"]
    length = np.linalg.norm(q, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1.0) > NORM_TOLERANCE)
    if 2 * len(wrong) > np.isfinite(length).sum():
        raise InputError(place, f"its quaternions have a median length of {np.nanmedian(length):.4g}, where 1 belongs",
                         "take another copy, or read it with a column map")
    q[wrong] = np.nan
    rows.wrong_norm = [int(r) for r in wrong]


def sensor_to_body(data: bytes, place: str) -> np.ndarray | None:
    """T_BS (4, 4) of a sensor.yaml: x_body = T_BS x_sensor; None where the file has none. InputError for a damaged
    one."""
    text = _DIRECTIVE.sub("", data[:MOST_YAML_BYTES].decode("utf-8", errors="replace"))
    try:
        content = yaml.safe_load(text)
        if not isinstance(content, dict) or "T_BS" not in content:
            return None
        given = content["T_BS"]
        cells = given["data"] if isinstance(given, dict) else given
        found = np.array(cells, dtype=float).reshape(4, 4)
    except (yaml.YAMLError, ValueError, TypeError, KeyError, RecursionError):
        raise InputError(place, "T_BS is no matrix of 4 rows and 4 columns", "mend it") from None
    turn = found[:3, :3]
    if not np.isfinite(found).all() or np.abs(turn @ turn.T - np.eye(3)).max() > ORTHONORMAL or (
            np.linalg.det(turn) < 0.0) or np.abs(found[3] - [0.0, 0.0, 0.0, 1.0]).max() > ORTHONORMAL:
        raise InputError(place, "T_BS is no rigid motion", "mend it")
    u, _, v = np.linalg.svd(turn)
    found[:3, :3] = u @ v
    return found
