"""Small files of every format, written here by other means than the package's own writers, and ways to break them."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

NAMES = [
    "t",
    "px",
    "py",
    "pz",
    "qx",
    "qy",
    "qz",
    "qw",
    "roll",
    "pitch",
    "yaw",
    "vx",
    "vy",
    "vz",
    "wx_vicon",
    "wy_vicon",
    "wz_vicon",
    "imu_acc_x",
    "imu_acc_y",
    "imu_acc_z",
    "imu_gyro_x",
    "imu_gyro_y",
    "imu_gyro_z",
    "motor_motor_m1",
    "motor_motor_m2",
    "motor_motor_m3",
    "motor_motor_m4",
    "est_stateEstimate_x",
    "est_stateEstimate_y",
    "est_stateEstimate_z",
    "est_stateEstimate_vx",
    "est_stateEstimate_vy",
    "est_stateEstimate_vz",
    "est_stateEstimate_ax",
    "est_stateEstimate_ay",
    "est_stateEstimate_az",
    "att_stateEstimate_roll",
    "att_stateEstimate_pitch",
    "att_stateEstimate_yaw",
    "att_stateEstimate_qx",
    "att_stateEstimate_qy",
    "att_stateEstimate_qz",
    "att_stateEstimate_qw",
    "sp_ctrltarget_x",
    "sp_ctrltarget_y",
    "sp_ctrltarget_z",
    "sp_ctrltarget_yaw",
    "pid_controller_roll",
    "pid_controller_pitch",
    "pid_controller_yaw",
    "pid_controller_cmd_thrust",
    "pwr_pm_vbat",
]
"""The 52 columns, typed off a recording."""

TO_SI = {
    "imu_acc_x": 9.81,
    "imu_acc_y": 9.81,
    "imu_acc_z": 9.81,
    "est_stateEstimate_ax": 9.81,
    "est_stateEstimate_ay": 9.81,
    "est_stateEstimate_az": 9.81,
    "sp_ctrltarget_yaw": math.pi / 180,
    **{f"motor_motor_m{i}": 1 / 65535 for i in (1, 2, 3, 4)},
    "pid_controller_cmd_thrust": 1 / 65535,
    **{
        f"{a}_{b}": (-1 if b == "pitch" else 1) * math.pi / 180
        for a in ("att_stateEstimate", "pid_controller")
        for b in ("roll", "pitch", "yaw")
    },
}
"""By hand: g, degrees, PWM counts, and the pitch that is nose up in the firmware."""

EPOCH = 1772689631.595269680


def table(rows: int = 60, seed: int = 0) -> np.ndarray:
    """(rows, 52) numbers as they stand in the file, all different, none that rounding to 9 decimals would change."""
    rng = np.random.default_rng(seed)
    values = np.round(rng.uniform(-1.0, 1.0, (rows, 52)), 9)
    values[:, 23:27] = np.round(rng.uniform(20000.0, 60000.0, (rows, 4)), 9)
    values[:, 50] = np.round(rng.uniform(20000.0, 60000.0, rows), 9)
    values[:, 51] = np.round(rng.uniform(3.0, 4.2, rows), 9)
    values[:, 0] = EPOCH + 0.01 * np.arange(rows)
    return values


def csv_text(values: np.ndarray, names: list[str] = NAMES, delimiter: str = ",", end: str = "\n") -> str:
    lines = [delimiter.join(names), *(delimiter.join(f"{v:.9f}" for v in row) for row in values)]
    return end.join(lines) + end


SHEET = """battery_voltage_end: 3.17
category: tracking
crazyflie_id: CF_01
params:
  duration_s: 30.0
  speed_mps: 1.0
recording_end_utc: 20260305T054712Z
recording_start_utc: 20260305T054711Z
repetition: 1
row_counts:
  attitude: 51
  attitude_qw: 52
  estimator: 53
  estimator_acc: 54
  imu: 55
  motor: 56
  pid_output: 57
  power: 6
  setpoint: 49
  vicon: 60
trajectory_id: B9_trefoil_fast
trajectory_type: trefoil
"""


@dataclass(frozen=True)
class Broken:
    """Bytes of a mutated file; rows of the original (indices) and columns that the mutation may have touched; kinds of
    finding of which one must be reported when the file is still read (empty: the change cannot be seen by a reader)."""

    data: bytes
    rows: frozenset[int]
    columns: frozenset[str]
    kinds: frozenset[str] = frozenset()


def _cells(values: np.ndarray) -> list[list[str]]:
    return [[f"{v:.9f}" for v in row] for row in values]


def _join(cells: list[list[str]], names: list[str] = NAMES, delimiter: str = ",") -> bytes:
    return ("\n".join([delimiter.join(names), *map(delimiter.join, cells)]) + "\n").encode()


def _put_text(values, rng) -> Broken:
    """Text, or what other programs write for a missing number, in a few cells of one row or column."""
    cells = _cells(values)
    row, column = int(rng.integers(len(cells))), int(rng.integers(52))
    word = rng.choice(
        [
            "abc",
            "",
            "nan",
            "NaN",
            "inf",
            "-inf",
            "1.2.3",
            "--1",
            "0x10",
            "1_000",
            "1e999",
            "#N/A",
            "٣",
            "1 2",
            "True",
            "-",
        ]
    )
    deep = int(rng.integers(1, 4))
    hit = range(row, min(row + deep, len(cells)))
    for i in hit:
        cells[i][column] = str(word)
    return Broken(_join(cells), frozenset(hit), frozenset([NAMES[column]]), frozenset(["bad_cell"]))


def _gigantic(values, rng) -> Broken:
    cells = _cells(values)
    row, column = int(rng.integers(len(cells))), int(rng.integers(52))
    cells[row][column] = f"{rng.choice(['', '-'])}{rng.integers(1, 9)}{'0' * int(rng.integers(13, 300))}"
    return Broken(_join(cells), frozenset([row]), frozenset([NAMES[column]]), frozenset(["bad_cell"]))


def _nan_block(values, rng) -> Broken:
    cells = _cells(values)
    first, left = int(rng.integers(1, len(cells) - 5)), int(rng.integers(1, 48))
    rows = range(first, int(rng.integers(first + 1, len(cells))))
    columns = range(left, int(rng.integers(left + 1, 53)))
    for i in rows:
        for k in columns:
            cells[i][k] = str(rng.choice(["nan", "", "NaN"]))
    return Broken(_join(cells), frozenset(rows), frozenset(NAMES[k] for k in columns), frozenset(["bad_cell"]))


def _truncated(values, rng) -> Broken:
    whole = _join(_cells(values))
    data = whole[: int(rng.integers(1, len(whole) - 1))]
    complete = data.count(b"\n") - 1  # rows that still have their line end
    return Broken(data, frozenset(range(max(complete, 0), len(values))), frozenset(), frozenset())


def _noise(values, rng) -> Broken:
    """Bytes that no number has, written over a stretch of the rows."""
    data = bytearray(_join(_cells(values)))
    start = int(rng.integers(len(",".join(NAMES)) + 1, len(data) - 1))
    length = int(rng.integers(1, 400))
    palette = [b for b in range(256) if b not in b"0123456789.eE+-\n\r"]
    rows = frozenset(range(data[:start].count(b"\n") - 1, bytes(data[: start + length]).count(b"\n")))
    for i in range(start, min(start + length, len(data))):
        data[i] = int(rng.choice(palette))
    return Broken(bytes(data), rows, frozenset(NAMES), frozenset(["bad_cell", "truncated", "missing_column"]))


def _any_bytes(values, rng) -> Broken:
    """Any bytes anywhere in the rows: a digit may become another digit, which nobody can see."""
    data = bytearray(_join(_cells(values)))
    start = int(rng.integers(len(",".join(NAMES)) + 1, len(data) - 1))
    length = int(rng.integers(1, 60))
    rows = frozenset(range(data[:start].count(b"\n") - 1, bytes(data[: start + length]).count(b"\n") + 1))
    data[start : start + length] = rng.integers(0, 256, length, dtype=np.uint8).tobytes()
    return Broken(bytes(data), rows, frozenset(NAMES))


def _header_bytes(values, rng) -> Broken:
    """Noise in the header: names are lost, numbers must not move to other names."""
    data = bytearray(_join(_cells(values)))
    start = int(rng.integers(0, len(",".join(NAMES))))
    data[start] = int(rng.integers(0, 256))
    hit = bytes(data[: data.index(b"\n")])[:start].count(b",") if b"\n" in data else 0
    around = frozenset(NAMES[max(hit - 1, 0) : hit + 2])
    return Broken(bytes(data), frozenset(range(len(values))), around)


def _reordered(values, rng) -> Broken:
    order = rng.permutation(52)
    return Broken(
        _join([[row[k] for k in order] for row in _cells(values)], [NAMES[k] for k in order]), frozenset(), frozenset()
    )


def _renamed(values, rng) -> Broken:
    names = list(NAMES)
    hit = rng.choice(np.arange(1, 52), int(rng.integers(1, 8)), replace=False)
    for k in hit:
        names[k] = f"other_{k}"
    touched = frozenset(NAMES[k] for k in hit)
    return Broken(_join(_cells(values), names), frozenset(range(len(values))), touched, frozenset(["missing_column"]))


def _dropped(values, rng) -> Broken:
    hit = set(rng.choice(np.arange(1, 52), int(rng.integers(1, 30)), replace=False).tolist())
    keep = [k for k in range(52) if k not in hit]
    data = _join([[row[k] for k in keep] for row in _cells(values)], [NAMES[k] for k in keep])
    return Broken(data, frozenset(range(len(values))), frozenset(NAMES[k] for k in hit), frozenset(["missing_column"]))


def _twice(values, rng) -> Broken:
    """A column name that stands there twice: the first is read, the second reported."""
    k, names = int(rng.integers(1, 51)), list(NAMES)
    names[k + 1] = names[k]
    return Broken(
        _join(_cells(values), names),
        frozenset(range(len(values))),
        frozenset([NAMES[k + 1]]),
        frozenset(["extra_column"]),
    )


def _times(values, rng) -> Broken:
    """Stamps that stand still or go back are kept as they are; the audit reports them."""
    cells = _cells(values)
    row = int(rng.integers(1, len(cells)))
    step = float(rng.choice([0.0, 0.005, 1.0, 1e4]))
    cells[row][0] = f"{values[row - 1, 0] - step:.9f}"
    return Broken(_join(cells), frozenset([row]), frozenset(["t"]))


def _delimiter(values, rng) -> Broken:
    mark, decimal = [(";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), (" ", ".")][int(rng.integers(6))]
    keep = int(rng.integers(5, len(values) + 1))
    cells = [[c.replace(".", decimal) for c in row] for row in _cells(values[:keep])]
    return Broken(_join(cells, delimiter=mark), frozenset(range(keep, len(values))), frozenset())


def _ragged(values, rng) -> Broken:
    cells = _cells(values)
    rows = frozenset(rng.choice(len(cells), int(rng.integers(1, 6)), replace=False).tolist())
    for i in rows:
        if rng.random() < 0.5:
            del cells[i][int(rng.integers(52))]
        else:
            cells[i].insert(int(rng.integers(52)), "0.123456789")
    return Broken(_join(cells), rows, frozenset(NAMES), frozenset(["bad_cell"]))


def _line_ends(values, rng) -> Broken:
    keep = int(rng.integers(2, len(values) + 1))
    end = str(rng.choice(["\r\n", "\r", "\n"]))
    mark = [b"", b"\xef\xbb\xbf"][int(rng.integers(2))]
    text = csv_text(values[:keep], end=end) + end * int(rng.integers(3))
    data = text.encode("utf-16") if rng.random() < 0.2 else mark + text.encode()
    return Broken(data, frozenset(range(keep, len(values))), frozenset())


MUTATIONS: dict[str, Callable[[np.ndarray, np.random.Generator], Broken]] = {
    "text": _put_text,
    "gigantic": _gigantic,
    "nan_block": _nan_block,
    "truncated": _truncated,
    "noise": _noise,
    "any_bytes": _any_bytes,
    "header_bytes": _header_bytes,
    "reordered": _reordered,
    "renamed": _renamed,
    "dropped": _dropped,
    "twice": _twice,
    "times": _times,
    "delimiter": _delimiter,
    "ragged": _ragged,
    "line_ends": _line_ends,
}


USD_FIXED = [
    ("stateEstimate.x", "f"),
    ("gyro.y", "f"),
    ("acc.z", "f"),
    ("motor.m1", "H"),
    ("motor.m2", "H"),
    ("motor.m3", "H"),
    ("motor.m4", "H"),
    ("pm.vbatMV", "H"),
    ("stateEstimate.pitch", "f"),
    ("someone.else", "b"),
    ("half.float", "e"),
]
USD_POSE = [
    ("locSrv.x", "f"),
    ("locSrv.y", "f"),
    ("locSrv.z", "f"),
    ("locSrv.qx", "f"),
    ("locSrv.qy", "f"),
    ("locSrv.qz", "f"),
    ("locSrv.qw", "f"),
]


@dataclass(frozen=True)
class UsdSample:
    """A log and what is in it: fixed and poses are lists of (stamp, values), ends the offsets behind each record."""

    data: bytes
    fixed: list[tuple[int, tuple]]
    poses: list[tuple[int, tuple]]
    ends: list[int]
    body: int


def usd_log(version: int = 2, records: int = 40, seed: int = 0) -> UsdSample:
    """A uSD log as the firmware writes it: header, records in order of time, CRC-32 of everything before it."""
    rng = np.random.default_rng(seed)
    out = bytearray([0xBC])
    out += struct.pack("<HH", version, 3)
    for key, name, variables in (
        (0xFFFF, b"fixedFrequency", USD_FIXED),
        (9, b"estPose", USD_POSE),
        (4, b"estTDOA", []),
    ):
        out += struct.pack("<H", key) + name + b"\0" + struct.pack("<H", len(variables))
        for variable, kind in variables:
            out += f"{variable}({kind})".encode() + b"\0"
    body, ends, fixed, poses = len(out), [], [], []
    stamp = 5_000_000 if version == 2 else 5_000
    for k in range(records):
        step = 10_000 if version == 2 else 10
        values = (
            float(np.float32(rng.normal())),
            float(np.float32(rng.normal() * 50)),
            1.0,
            *rng.integers(0, 65536, 4).tolist(),
            3700 + k,
            float(np.float32(rng.normal())),
            int(rng.integers(-128, 128)),
            0.5,
        )
        out += struct.pack("<HQ" if version == 2 else "<HI", 0xFFFF, stamp)
        out += struct.pack("<" + "".join(t for _, t in USD_FIXED), *values)
        fixed.append((stamp, values))
        ends.append(len(out))
        if k % 3 == 0:
            pose = tuple(float(np.float32(v)) for v in (*rng.normal(size=3), 0.0, 0.0, 0.0, 1.0))
            out += struct.pack("<HQ" if version == 2 else "<HI", 9, stamp + step // 2) + struct.pack("<7f", *pose)
            poses.append((stamp + step // 2, pose))
            ends.append(len(out))
        stamp += step
    out += struct.pack("<I", zlib.crc32(bytes(out)))
    return UsdSample(bytes(out), fixed, poses, ends, body)
