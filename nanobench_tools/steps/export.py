"""Recordings into formats of other tools. (Back to the NanoBench format: ``sources.nanobench_writer``.)"""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight
from ..results.result import to_json
from ..results.result_files import write_bytes

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
ASL_HEADER = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
RPG_HEADER = "# time x y z qx qy qz qw\n"
RPG_TRUTH, RPG_ESTIMATE, RPG_CONFIG = "stamped_groundtruth.txt", "stamped_traj_estimate.txt", "eval_cfg.yaml"
TIMES_SUFFIX = ".times.txt"


def tum_text(time_s: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray) -> str:
    """A trajectory as TUM lines ``t x y z qx qy qz qw``.

    time_s (n,) Unix s, position_m (n, 3), quaternion (n, 4)."""
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


def poses_of(flight: Flight, format_name: str) -> tuple[np.ndarray, np.ndarray]:
    """(n,) s from the first row and (n, 7) poses of the motion capture, rows without a whole pose left out. InputError
    without one."""
    missing = [name for name in POSE if name not in flight["mocap"]]
    if missing:
        raise InputError(flight.provenance.path, f"mocap has no {', '.join(missing)}", f"{format_name} needs them")
    mocap = flight["mocap"]
    pose = mocap[POSE]
    kept = np.isfinite(pose).all(axis=1)
    if not kept.any():
        raise InputError(flight.provenance.path, "mocap has no row with a whole pose", f"{format_name} needs them")
    return mocap.time_s[kept], pose[kept]


def write_euroc(flight: Flight, path: Path) -> Path:
    """A table of truth in the ASL layout: nanoseconds, w first."""
    time_s, pose = poses_of(flight, "EuRoC")
    whole_s, rest = divmod(flight.epoch_s, 1.0)
    stamps = int(whole_s) * 10**9 + np.round((rest + time_s) * 1e9).astype(np.int64)
    lines = [",".join([str(t), *(f"{v:.9f}" for v in row)])
             for t, row in zip(stamps.tolist(), pose[:, [0, 1, 2, 6, 3, 4, 5]], strict=True)]
    write_bytes(path, (ASL_HEADER + "\n".join(lines) + "\n").encode())
    return path


def write_kitti(flight: Flight, path: Path) -> Path:
    """Rows of 12 numbers, [R | p] of body to world, and next to it the seconds since the first in NAME.times.txt."""
    time_s, pose = poses_of(flight, "KITTI")
    matrix = np.concatenate([so3.matrix(pose[:, 3:]), pose[:, :3, None]], axis=2).reshape(-1, 12)
    write_bytes(path, "".join(" ".join(f"{v:.9e}" for v in row) + "\n" for row in matrix).encode())
    times = path.with_name(path.name.removesuffix(path.suffix) + TIMES_SUFFIX)
    write_bytes(times, "".join(f"{t - time_s[0]:.9f}\n" for t in time_s).encode())
    return path


def write_rpg(flight: Flight, path: Path) -> Path:
    """The folder of rpg_trajectory_evaluation: truth, the onboard estimate if it was logged, and the alignment."""
    time_s, pose = poses_of(flight, "rpg_trajectory_evaluation")
    write_bytes(path / RPG_TRUTH, _stamped(flight.epoch_s + time_s, pose))
    if "estimator" in flight and "attitude_qw" in flight and all(n in flight["estimator"] for n in "xyz"):
        estimate, attitude = flight["estimator"], flight["attitude_qw"]
        whole = np.isfinite(estimate["x", "y", "z"]).all(axis=1)
        turn = attitude["qx", "qy", "qz", "qw"]
        known = np.isfinite(turn).all(axis=1) & (np.diff(attitude.time_s, prepend=-np.inf) > 0.0)
        if whole.any() and known.any():
            inside = (estimate.time_s >= attitude.time_s[known][0]) & (estimate.time_s <= attitude.time_s[known][-1])
            rows = whole & inside
            at_s = estimate.time_s[rows]
            turned = so3.interpolate(attitude.time_s[known], turn[known], at_s)
            write_bytes(path / RPG_ESTIMATE, _stamped(flight.epoch_s + at_s, np.hstack([
                estimate["x", "y", "z"][rows], turned])))
    write_bytes(path / RPG_CONFIG, b"align_type: posyaw\nalign_num_frames: -1\n")
    return path


def _stamped(time_s: np.ndarray, pose: np.ndarray) -> bytes:
    return (RPG_HEADER + "".join(" ".join([f"{t:.9f}", *(f"{v:.9f}" for v in row)]) + "\n"
                                 for t, row in zip(time_s, pose, strict=True))).encode()


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


FORMATS: dict[str, tuple[Callable[[Flight, Path], Path], str]] = {
    "nanobench": (write_csv, ".csv"), "parquet": (write_parquet, ""), "tum": (write_tum, ".tum"),
    "euroc": (write_euroc, ".euroc.csv"), "kitti": (write_kitti, ".kitti"), "rpg": (write_rpg, ""),
    "rrd": (write_viewer, ".rrd")}
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
