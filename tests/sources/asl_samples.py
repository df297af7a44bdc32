"""Data sets in the ASL layout, written from a flight of the practice vehicle to the facts of the format."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from test_draft_axes import G, flown

EPOCH_NS = 1403715524907143168
STEP_NS = 5_000_000
EUROC_BODY = np.array([[0.0, 0, 1], [0, -1.0, 0], [1.0, 0, 0]])
"""Vectors of EuRoC's body (x up, y right, z forward) to forward, left, up."""
GYRO_BIAS, ACC_BIAS = np.array([-0.002, 0.02, 0.076]), np.array([-0.01, 0.1, 0.05])
HEADERS = {
    "imu0": "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
            "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
    "state_groundtruth_estimate0": "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
            "q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], "
            "b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
            "b_a_RS_S_z [m s^-2]",
    "vicon0": "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
    "leica0": "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]",
}
VICON_T_BS = np.block([[Rotation.from_euler("ZYX", (170.0, 4.0, -3.0), degrees=True).as_matrix(),
                        np.array([[0.0758], [-0.0603], [-0.0116]])], [np.zeros((1, 3)), np.ones((1, 1))]])


def sensor_yaml(kind: str, t_bs: np.ndarray) -> bytes:
    cells = ", ".join(f"{v:.9f}" for v in t_bs.ravel())
    return (f"%YAML:1.0\n#Sensor of the body\nsensor_type: {kind}\ncomment: synthetic\n\nT_BS:\n  cols: 4\n  rows: 4\n"
            f"  data: [{cells}]\n\nrate_hz: 200\n").encode()


def _csv(name: str, ns: np.ndarray, values: np.ndarray, digits: int = 6) -> bytes:
    rows = [",".join([str(t), *(f"{v:.{digits}f}" for v in row)]) for t, row in zip(ns.tolist(), values, strict=True)]
    return "\n".join([HEADERS[name], *rows]).encode() + b"\n"


def members(truth: str = "state_groundtruth_estimate0", body: np.ndarray = EUROC_BODY,
            imu_in_body: np.ndarray | None = None) -> dict[str, bytes]:
    """Files of mav0 by name: a flight of 16 s. ``body``: vectors of the body to forward, left, up. ``imu_in_body``:
    rotation of imu0 in T_BS. The IMU begins 1 s before the truth."""
    t, p, v, a, turn, w = flown()
    ns = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    q_body = turn * Rotation.from_matrix(body)  # body of the data set -> world
    gyro, force = w @ body, turn.inv().apply(a + G) @ body  # rows: body.T @ vector
    found = {}
    if truth == "state_groundtruth_estimate0":
        rows = np.hstack([p, np.roll(q_body.as_quat(), 1, axis=1), v, np.tile(np.r_[GYRO_BIAS, ACC_BIAS], (len(t), 1))])
        t_bs = np.eye(4)
    elif truth == "vicon0":
        q_marker = q_body * Rotation.from_matrix(VICON_T_BS[:3, :3])
        rows = np.hstack([p + q_body.apply(VICON_T_BS[:3, 3]), np.roll(q_marker.as_quat(), 1, axis=1)])
        t_bs = VICON_T_BS
    else:
        rows, t_bs = p + q_body.apply([0.07, -0.1, 0.0]), np.eye(4)
        t_bs[:3, 3] = (0.07, -0.1, 0.0)
    late = 100
    found[f"{truth}/data.csv"] = _csv(truth, ns[late:], rows[late:])
    found[f"{truth}/sensor.yaml"] = sensor_yaml("pose", t_bs)
    imu_t_bs = np.eye(4)
    if imu_in_body is not None:
        imu_t_bs[:3, :3] = imu_in_body
        gyro, force = gyro @ imu_in_body, force @ imu_in_body
    found["imu0/data.csv"] = _csv("imu0", ns, np.hstack([gyro + GYRO_BIAS, force + ACC_BIAS]), 9)
    found["imu0/sensor.yaml"] = sensor_yaml("imu", imu_t_bs)
    return found


CAMERA = {
    "cam0/data.csv": b"#timestamp [ns],filename\n1403715524907143168,1403715524907143168.png\n",
    "cam0/sensor.yaml": sensor_yaml("camera", np.array([[0.0, -1, 0, 0], [1.0, 0, 0, 0], [0, 0, 1.0, 0],
                                                         [0, 0, 0, 1.0]])),
    "cam0/data/1403715524907143168.png": b"\x89PNG\r\n\x1a\n" + bytes(64),
    "body.yaml": b"%YAML:1.0\ncomment: VI-Sensor\n",
}


def write_folder(place: Path, files: dict[str, bytes], sequence: str = "V1_09_made") -> Path:
    root = place / sequence
    for name, data in files.items():
        (root / "mav0" / name).parent.mkdir(parents=True, exist_ok=True)
        (root / "mav0" / name).write_bytes(data)
    return root


def archive(files: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in files.items():
            made.writestr(f"mav0/{name}", data)
    return file.getvalue()
