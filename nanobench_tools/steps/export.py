"""Recordings into formats of other tools. (Back to the NanoBench format: ``sources.nanobench_writer``.)"""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Flight
from ..results.result import to_json
from ..results.result_files import write_bytes

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def tum_text(time_s: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray) -> str:
    """A trajectory as TUM lines ``t x y z qx qy qz qw``: time_s (n,) Unix s, position_m (n, 3), quaternion (n, 4)."""
    text = io.StringIO()
    np.savetxt(text, np.column_stack([time_s, position_m, quaternion]), fmt="%.9f")
    return text.getvalue()


def write_tum(flight: Flight, path: Path) -> Path:
    """The motion-capture trajectory of a flight in absolute time. InputError when it has none."""
    missing = [name for name in POSE if name not in flight["mocap"]]
    if missing:
        raise InputError(flight.provenance.path, f"mocap has no {', '.join(missing)}", "TUM needs them")
    mocap = flight["mocap"]
    pose = mocap[POSE]
    write_bytes(path, tum_text(flight.epoch_s + mocap.time_s, pose[:, :3], pose[:, 3:]).encode())
    return path


def write_parquet(flight: Flight, path: Path) -> Path:
    """One Parquet file per stream in the folder ``path``, because streams keep their own clocks.

    Columns: ``time_s`` (s from the first row) and the quantities in SI. The schema's metadata hold name, epoch_s,
    unit and frame of each column, samples and the recording's sheet as JSON.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    for name, stream in flight.streams.items():
        fields = [pa.field("time_s", pa.float64(), metadata={"unit": "s"})]
        fields += [pa.field(quantity, pa.float64(), metadata={"unit": unit, "frame": stream.frame, "column": column})
                   for quantity, unit, column in zip(stream.quantities, stream.unit, stream.columns, strict=True)]
        about = {"flight": flight.name, "stream": name, "epoch_s": flight.epoch_s, "samples": stream.samples,
                 "synthetic": flight.provenance.synthetic, "sha256": flight.provenance.sha256,
                 "metadata": to_json(flight.metadata)}
        schema = pa.schema(fields, metadata={"nanobench": json.dumps(about)})
        buffer = pa.BufferOutputStream()
        columns = [pa.array(stream.time_s), *map(pa.array, stream.values.T)]
        pq.write_table(pa.Table.from_arrays(columns, schema=schema), buffer)
        write_bytes(path / f"{name}.parquet", buffer.getvalue().to_pybytes())
    return path


def write_csv(flight: Flight, path: Path) -> Path:
    """NanoBench CSV with its sheet."""
    from ..sources.nanobench_writer import write_nanobench

    return write_nanobench(flight, path)


def write_viewer(flight: Flight, path: Path) -> Path:
    """A recording of the Rerun viewer, with the audit's marks. MissingExtraError without the extra ``viewer``."""
    from .rerun_recording import write_rrd

    return write_rrd(flight, path)


def write_for_others(kind: str) -> Callable[[Flight, Path], Path]:
    """Writer of ``trajectory_files``, loaded when it is used."""

    def write(flight: Flight, path: Path) -> Path:
        from . import trajectory_files

        made: Path = getattr(trajectory_files, f"write_{kind}")(flight, path)
        return made

    return write


FORMATS: dict[str, tuple[Callable[[Flight, Path], Path], str]] = {
    "nanobench": (write_csv, ".csv"), "parquet": (write_parquet, ""), "tum": (write_tum, ".tum"),
    "euroc": (write_for_others("euroc"), ".euroc.csv"), "kitti": (write_for_others("kitti"), ".kitti"),
    "rpg": (write_for_others("rpg"), ""), "rrd": (write_viewer, ".rrd")}
"""Name of a format -> (writer, suffix)."""


def export(flight: Flight, out_dir: Path, to: str) -> Path:
    """Writes a flight into ``out_dir`` under its name; returns the file (a folder for ``parquet``).

    InputError when that is the file it was read from.
    """
    write, suffix = FORMATS[to]
    path = Path(out_dir) / f"{flight.name}{suffix}"
    if path.exists() and Path(flight.provenance.path).exists() and path.samefile(flight.provenance.path):
        raise InputError(str(path), "is the recording itself", "choose another --out")
    return write(flight, path)
