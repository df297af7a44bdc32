"""Data sets of an HDF5 file as arrays, and a flight of arrays that share one time. Needs the extra ``hdf5``."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, how_to_install
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from .base import not_numbers, text_fault
from .cells import GIGANTIC
from .interpolation import count_changes
from .payload import check_size
from .timestamps import not_seconds

MAGIC = b"\x89HDF\r\n\x1a\n"
FARTHEST_S = 1e5
"""A timestamp farther from the median than a day is none of this recording."""


def holds(path: Path, head: bytes, names: Collection[str]) -> bool:
    """Whether an HDF5 file has all of these data sets at its root."""
    if not head.startswith(MAGIC):
        return False
    try:
        import h5py

        with h5py.File(path, "r") as file:
            return set(names) <= set(file)
    except Exception:  # not installed, or a damaged file, which can make the library raise anything
        return False


def why_strange(head: bytes) -> str | None:
    """Why an HDF5 file is no recording; None for another file."""
    if not head.startswith(MAGIC):
        return None
    if importlib.util.find_spec("h5py") is None:
        return f"an HDF5 file is read through h5py: {how_to_install('hdf5')}"
    return "an HDF5 file without the data sets of DIDO (ts, gt_q, meas_rpm) or Blackbird (traj_target, gyro_raw)"


def arrays_of(data: bytes, place: str, names: Collection[str]) -> dict[str, np.ndarray]:
    """{name: (n,) or (n, k) float} of those data sets that are there. InputError for a damaged file, and where its
    values are in another file."""
    try:
        import h5py
    except ImportError:
        raise InputError(place, "an HDF5 file is read through h5py", how_to_install("hdf5")) from None
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            found = {}
            for name in names:
                if name not in file or isinstance(file.get(name, getlink=True), h5py.ExternalLink):
                    continue
                table = file[name]
                if not isinstance(table, h5py.Dataset) or table.dtype.kind not in "fiu" or table.ndim not in (1, 2):
                    continue
                if table.is_virtual or table.external:
                    raise InputError(f"{place}: {name}", "its values are in another file", "copy them into this one")
                check_size(f"{place}: {name}", int(table.size), data)
                values = table[()].astype(float)
                found[name] = np.where(np.abs(values) < GIGANTIC, values, np.nan)
            return found
    except InputError:
        raise
    except Exception as error:  # damage can make the library raise anything
        told = " ".join(str(error).split())[:80]
        raise InputError(place, f"cannot be read as HDF5 ({told})", "take another copy of the file") from None


def flight_of(path: Path, source: str, stamps: np.ndarray, values: Mapping[str, tuple[Sequence[str], np.ndarray]],
              notes: Sequence[str], held: Collection[str] = ()) -> Flight:
    """stamps (n,) s; values: stream -> (quantities, (n, k) SI). ``held``: streams in which rows repeat the last
    sample. Rows without a time are left out with a finding. InputError where the stamps are no seconds."""
    place = str(path)
    if stamps.ndim != 1 or (why := not_seconds(stamps)) is not None or not np.isfinite(stamps).any():
        raise InputError(f"{place}: time", why if stamps.ndim == 1 and why else "is no column of seconds",
                         "the format has seconds")
    near = np.abs(stamps - np.nanmedian(stamps)) < FARTHEST_S
    time_s = stamps[near] - stamps[near][0]
    findings: list[Fault] = []
    if lost := int((~near).sum()):
        findings.append(text_fault("bad_cell", "", (), f"{lost} rows left out: no time of this recording",
                                   (0.0, float(time_s[-1])), float(lost), "rows"))
    streams: dict[str, Stream] = {}
    for name, (quantities, rows) in values.items():
        kept = rows[near]
        count = count_changes(kept) if name in held else len(kept)
        span = float(time_s[-1] - time_s[0])
        rate = (count or len(kept)) / span if span > 0.0 else float("nan")
        streams[name] = Stream(time_s, kept, tuple(quantities), tuple(quantities), ("1",) * len(quantities),
                               rate_hz=rate, samples=count) if name.startswith("extra") else make_stream(
            name, time_s, kept, quantities, samples=count, rate_hz=rate)
    return Flight(path.name, streams,
                  {"family": None, "speed": None, "reference_speed_m_s": None, "read_as": list(notes)},
                  Provenance(place, "", source, findings=(*findings, *not_numbers(streams)), notes=tuple(notes)),
                  epoch_s=float(stamps[near][0]))


def columns(found: Mapping[str, np.ndarray], name: str, width: int, rows: int, place: str) -> np.ndarray:
    """(n, width) of a data set that has to be there. InputError for another shape."""
    values = found.get(name)
    if values is None or values.ndim != 2 or values.shape != (rows, width):
        shape = "is not there" if values is None else f"has the shape {values.shape}, not {(rows, width)}"
        raise InputError(f"{place}: {name}", shape, "take another copy of the file")
    return values


def unit_quaternions(quaternion: np.ndarray, place: str, tolerance: float = 0.05) -> np.ndarray:
    """(n, 4), NaN where the length is not 1. InputError where that is usual."""
    length = np.linalg.norm(quaternion, axis=1)
    wrong = ~(np.abs(length - 1.0) < tolerance)
    if 2 * wrong.sum() > len(wrong):
        raise InputError(place, "its quaternions have no unit length", "take another copy of the file")
    return np.where(wrong[:, None], np.nan, quaternion)
