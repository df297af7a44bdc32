"""Poses of KITTI's tools: rows of 12 numbers, [R | p], and the times of the rows in a file next to it.

The times are in ``NAME.times.txt`` or ``times.txt``, seconds, one for each row. KITTI's own poses are those of a camera
(z forward, y down); this reader leaves their axes as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..flight import Flight, Provenance, make_stream
from .base import text_fault
from .dialect import normalise_text
from .members import Gathered
from .sheets import Sheet
from .timestamps import not_seconds

CELLS = 12
ROWS_SEEN = 20
ORTHONORMAL = 1e-3
"""Largest error of a rotation matrix with six digits, in a row that is a pose."""
TIMES = "times.txt"


class KittiPoses:
    """Source ``kitti``."""

    name = "kitti"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if b"\x00" in head[:512]:
            return False
        lines = normalise_text(head).split(b"\n")[:ROWS_SEEN]
        whole = [line for line in (lines[:-1] or lines) if line.strip()]
        rows = [row for line in whole if (row := _numbers(line)) is not None and len(row) == CELLS]
        return 0 < len(whole) == len(rows) and bool(_poses(np.array(rows)).all())

    def wanted(self, names: Sequence[str]) -> list[str]:
        return []

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """The poses, and the file of their times."""
        found = []
        for path in paths:
            near = [path.with_name(f"{path.name.removesuffix(path.suffix)}.{TIMES}"), path.with_name(TIMES)]
            times = next((p for p in near if p.is_file()), None)
            found.append(Gathered(path, path, {path.name: path, **({} if times is None else {times.name: times})}))
        return found

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        poses = next(iter(members))
        if len(members) < 2:
            raise InputError(str(place), "poses of KITTI without the file of their times",
                             f"put the seconds of the rows into {place.name.removesuffix(place.suffix)}.{TIMES}")
        times = next(name for name in members if name != poses)
        lines, stamps = (_lines(members[name]) for name in (poses, times))
        if len(lines) != len(stamps):
            raise InputError(str(place), f"has {len(lines)} rows, {times} has {len(stamps)}",
                             "each row needs one time, so one of the files is not whole")
        rows = [_numbers(line) for line in lines]
        time_s = np.array([_one(line) for line in stamps])
        why = not_seconds(time_s) if np.isfinite(time_s).any() else "holds no times"
        if why is not None:
            raise InputError(str(place.with_name(times)), why, "write one time in seconds a row")
        values = np.array([row if row is not None and len(row) == CELLS else [np.nan] * CELLS for row in rows])
        good = _poses(values) & np.isfinite(time_s)
        if not good.any():
            raise InputError(str(place), "no row is a pose", "a row is [R | p], 12 numbers")
        matrix = values[good].reshape(-1, 3, 4)
        first = float(time_s[good][0])
        at_s = time_s[good] - first
        span = float(at_s[-1])
        mocap = make_stream("mocap", at_s, np.hstack([matrix[:, :, 3], Rotation.from_matrix(
            matrix[:, :, :3]).as_quat()]), ("px", "py", "pz", "qx", "qy", "qz", "qw"), samples=len(at_s),
            rate_hz=(len(at_s) - 1) / span if span > 0.0 else float("nan"))
        lost = np.flatnonzero(~good)
        findings = [text_fault("bad_cell", "", (), f"{len(lost)} rows left out, the first in row {lost[0] + 1}: no "
                               "pose, or no time", (0.0, span), float(len(lost)), "rows")] if len(lost) else []
        notes = ("axes as in the file: KITTI's own poses are those of a camera",)
        return Flight(place.name, {"mocap": mocap}, {"family": None, "speed": None, "reference_speed_m_s": None},
                      Provenance(str(place), "", self.name, findings=tuple(findings), notes=notes), epoch_s=first)


def _lines(data: bytes) -> list[bytes]:
    return [line for line in normalise_text(data).split(b"\n") if line.strip()]


def _numbers(line: bytes) -> list[float] | None:
    try:
        return [float(cell) for cell in line.split()] or None
    except ValueError:
        return None


def _one(line: bytes) -> float:
    found = _numbers(line)
    return found[0] if found is not None and len(found) == 1 else float("nan")


def _poses(values: np.ndarray) -> np.ndarray:
    """(n,) bool of (n, 12): the matrix is a rotation, and the place a number."""
    turn = values.reshape(-1, 3, 4)[:, :, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        return np.asarray((error < ORTHONORMAL) & (np.linalg.det(np.nan_to_num(turn, posinf=0.0, neginf=0.0)) > 0.0)
                          & (np.abs(values) < 1e9).all(axis=1))
