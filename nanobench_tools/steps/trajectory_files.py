"""The trajectories of a recording for evo, rpg_trajectory_evaluation and KITTI's tools.

Rows without a whole pose are left out.
"""

from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight
from ..results.result_files import write_bytes

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
ASL_HEADER = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
RPG_HEADER = "# time x y z qx qy qz qw\n"
RPG_TRUTH, RPG_ESTIMATE, RPG_CONFIG = "stamped_groundtruth.txt", "stamped_traj_estimate.txt", "eval_cfg.yaml"
TIMES_SUFFIX = ".times.txt"


def poses_of(flight: Flight, format_name: str) -> tuple[np.ndarray, np.ndarray]:
    """(n,) s from the first row and (n, 7) poses of the motion capture. InputError without one."""
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
