"""Reads the firmware's numbers: one array a column, and the controllers' inputs as records."""

import io
import lzma

import numpy as np
import pyarrow.csv

from nanobench_tools.firmware.records import ESTIMATE, SETPOINT


def read(folder, name):
    """{column: (rows,)} of a table of the reference vectors."""
    data = (folder / "firmware_reference" / name).read_bytes()
    table = pyarrow.csv.read_csv(io.BytesIO(lzma.decompress(data) if name.endswith(".xz") else data))
    return {column: table[column].to_numpy() for column in table.column_names}


def columns(table, *names):
    """(rows, len(names))."""
    return np.stack([table[name] for name in names], axis=1)


def inputs(table):
    """Setpoints and estimates (rows, 1) of a controller's table."""
    n = len(table["step"])
    setpoint, estimate = np.zeros(n, SETPOINT), np.zeros(n, ESTIMATE)
    for name in SETPOINT.names[:8]:
        setpoint[name] = table[name]
    setpoint["thrust"] = table["sp_thrust"]
    for field, names in (("attitude_deg", ("roll_deg", "pitch_deg", "yaw_deg")),
                         ("quaternion", ("qx", "qy", "qz", "qw")),
                         ("rate_deg_s", ("rollrate_dps", "pitchrate_dps", "yawrate_dps")), ("position_m", "xyz"),
                         ("velocity_m_s", ("vx", "vy", "vz")), ("acceleration_m_s2", ("ax", "ay", "az")),
                         ("jerk_m_s3", ("jx", "jy", "jz"))):
        setpoint[field] = columns(table, *(f"sp_{name}" for name in names))
    for field, names in (("position_m", "xyz"), ("velocity_m_s", ("vx", "vy", "vz")),
                         ("attitude_deg", ("roll_deg", "pitch_legacy_deg", "yaw_deg")),
                         ("quaternion", ("qx", "qy", "qz", "qw")),
                         ("gyro_deg_s", ("gyro_x_dps", "gyro_y_dps", "gyro_z_dps"))):
        estimate[field] = columns(table, *names)
    return setpoint[:, None], estimate[:, None]


def replay(controller, table, scenario, output):
    """Outputs and states (rows,) of a controller's module fed with a scenario row by row from power-up."""
    rows = table["scenario"] == scenario
    setpoint, estimate = (x[rows] for x in inputs(table))
    out, trace = np.zeros(setpoint.shape, output), np.zeros(setpoint.shape, controller.STATE)
    controller.run_steps(table["step"][rows], controller.defaults(), np.zeros(1, controller.STATE), setpoint, estimate,
                         out, trace)
    return {name: values[rows] for name, values in table.items()}, out[:, 0], trace[:, 0]
