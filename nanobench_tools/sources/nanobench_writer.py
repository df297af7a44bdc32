"""Back to the NanoBench format: CSV with 9 decimals and a ``_metadata.yaml`` in the same folder."""

from __future__ import annotations

import gzip
import lzma
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import InputError
from ..flight import Flight, Stream
from .nanobench_columns import ROW_COUNT_KEYS, STREAMS, scales_of
from .sheets import utc_text

OWN_KEYS = frozenset(
    {"family", "speed", "reference_speed_m_s", "duration_s", "start_unix_s", "end_unix_s", "rows_in_file"}
)
"""Keys of Flight.metadata that the reader makes; the sheet says the same in its own words."""

SUFFIXES = (".xz", ".gz", ".csv")


def write_atomically(path: Path, data: bytes) -> None:
    """The file is either whole or not there. Raises InputError naming the path."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:80]}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror or error})",
                         "check folder and permissions") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def sheet_path(path: Path) -> Path:
    """The sheet of a CSV: ``x.csv.xz`` -> ``x_metadata.yaml``."""
    stem = path.name
    for suffix in SUFFIXES:
        stem = stem.removesuffix(suffix)
    return path.with_name(f"{stem}_metadata.yaml")


def write_nanobench(flight: Flight, path: str | Path) -> Path:
    """Write CSV (``.xz`` and ``.gz`` are packed) and sheet; returns the path of the CSV.

    Rows are the timestamps of the motion capture (else of the stream with the most rows). Streams with other timestamps
    are interpolated linearly onto them, as the format does, and left empty outside their span. Quaternions keep the
    sign of the sample before and unit length. All 52 columns are named, by which the file is known again; those of
    which the flight has nothing are empty. Reading the file again gives the same numbers to print rounding.
    """
    path = Path(path)
    if not flight.streams or not any(len(s) for s in flight.streams.values()):
        raise InputError(flight.provenance.path or flight.name, "has no rows", "nothing to write")
    stamps = _stamps(flight)
    names, blocks = ["t"], [(flight.epoch_s + stamps)[:, None]]
    for stream_name, columns in STREAMS.items():
        stream = flight.streams.get(stream_name)
        there = [k for k, c in enumerate(columns) if stream is not None and c.quantity in stream]
        values = np.full((len(stamps), len(columns)), np.nan)
        if stream is not None and there:
            here = tuple(columns[k] for k in there)
            values[:, there] = _on_stamps(stream, tuple(c.quantity for c in here), stamps) / scales_of(here)
        names += [c.name for c in columns]
        blocks.append(values)
    if "extra" in flight:
        extra = flight["extra"]
        names += list(extra.columns)
        blocks.append(_on_stamps(extra, extra.quantities, stamps))
    write_atomically(path, _pack(path, _text(names, np.concatenate(blocks, axis=1))))
    write_atomically(sheet_path(path), yaml.safe_dump(_sheet(flight, stamps), allow_unicode=True).encode())
    return path


def _stamps(flight: Flight) -> np.ndarray:
    mocap = flight.streams.get("mocap")
    return mocap.time_s if mocap is not None and len(mocap) else max(flight.streams.values(), key=len).time_s


def _on_stamps(stream: Stream, quantities: tuple[str, ...], stamps: np.ndarray) -> np.ndarray:
    """(m, k) SI values at the stamps; NaN outside the stream's span."""
    values = stream[list(quantities)]
    if len(stream.time_s) == len(stamps) and np.array_equal(stream.time_s, stamps):
        return values
    turn = [i for i, q in enumerate(quantities) if q in ("qx", "qy", "qz", "qw")]
    values = values.copy()
    if len(turn) == 4 and len(values):
        q = values[:, turn]
        flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
        values[1:, turn] *= flips[:, None]
    at = np.stack([np.interp(stamps, stream.time_s, v, left=np.nan, right=np.nan) for v in values.T], axis=1)
    if len(turn) == 4:
        at[:, turn] /= np.linalg.norm(at[:, turn], axis=1, keepdims=True)
    return at


def _text(names: list[str], table: np.ndarray) -> bytes:
    row = ",".join(["%.9f"] * len(names))
    lines = [row % tuple(r) for r in table.tolist()]
    text = ",".join(names) + "\n" + "\n".join(lines) + "\n"
    return text.replace("nan", "").encode() if np.isnan(table).any() else text.encode()


def _pack(path: Path, data: bytes) -> bytes:
    if path.suffix == ".xz":
        return lzma.compress(data, preset=2)
    return gzip.compress(data, compresslevel=6, mtime=0) if path.suffix == ".gz" else data


def _sheet(flight: Flight, stamps: np.ndarray) -> dict[str, Any]:
    """The sheet's own keys as they came, and the entries that every flight has."""
    meta = flight.metadata
    counts = {
        ROW_COUNT_KEYS.get(n, n): int(s.samples if s.samples is not None else len(s))
        for n, s in flight.streams.items()
        if n in STREAMS
    }
    counts["vicon"] = len(stamps)
    sheet: dict[str, Any] = {k: _plain(v) for k, v in meta.items() if k not in OWN_KEYS}
    params = dict(sheet.get("params") or {})
    if "speed_mps" not in params and meta.get("reference_speed_m_s") is not None:
        params["speed_mps"] = float(meta["reference_speed_m_s"])
    if "duration_s" not in params and meta.get("duration_s") is not None:
        params["duration_s"] = float(meta["duration_s"])
    family, speed = meta.get("family"), meta.get("speed")
    sheet |= {
        "row_counts": counts,
        "recording_start_utc": utc_text(flight.epoch_s + float(stamps[0])),
        "recording_end_utc": utc_text(flight.epoch_s + float(stamps[-1])),
    }
    if params:
        sheet["params"] = params
    if family and "trajectory_type" not in sheet:
        sheet["trajectory_type"] = str(family)
    if family and "trajectory_id" not in sheet:
        sheet["trajectory_id"] = "_".join(filter(None, (str(family), speed)))
    if flight.provenance.synthetic:
        sheet["synthetic"] = True
    return sheet


def _plain(value: Any) -> Any:
    """Plain YAML types."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)
