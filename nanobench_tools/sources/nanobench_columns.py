"""The 52 columns of the NanoBench CSV: name in the file -> stream, quantity, unit as found, sign.

Units are those found in the recordings, not those of their README: see the table of facts in ARCHITECTURE.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flight import STREAM_QUANTITIES
from ..units import factor


@dataclass(frozen=True)
class Column:
    """``value_SI = sign * factor(unit) * value``; firmware pitch is nose up, ours nose down, hence sign -1."""

    name: str
    stream: str
    quantity: str
    unit: str
    sign: float = 1.0

    @property
    def scale(self) -> float:
        return self.sign * factor(self.unit)


def _columns() -> tuple[Column, ...]:
    c = Column
    mocap = [*(c(n, "mocap", n, "m") for n in ("px", "py", "pz")),
             *(c(n, "mocap", n, "1") for n in ("qx", "qy", "qz", "qw")),
             *(c(n, "mocap", n, "rad") for n in ("roll", "pitch", "yaw")),
             *(c(n, "mocap", n, "m/s") for n in ("vx", "vy", "vz")),
             *(c(f"{n}_vicon", "mocap", n, "rad/s") for n in ("wx", "wy", "wz"))]
    imu = [*(c(f"imu_acc_{a}", "imu", f"acc_{a}", "g") for a in "xyz"),
           *(c(f"imu_gyro_{a}", "imu", f"gyro_{a}", "rad/s") for a in "xyz")]
    motor = [c(f"motor_motor_m{i}", "motor", f"m{i}", "pwm16") for i in (1, 2, 3, 4)]
    estimator = [*(c(f"est_stateEstimate_{a}", "estimator", a, "m") for a in "xyz"),
                 *(c(f"est_stateEstimate_v{a}", "estimator", f"v{a}", "m/s") for a in "xyz"),
                 *(c(f"est_stateEstimate_a{a}", "estimator_acc", f"a{a}", "g") for a in "xyz")]
    attitude = [c("att_stateEstimate_roll", "attitude", "roll", "deg"),
                c("att_stateEstimate_pitch", "attitude", "pitch", "deg", -1.0),
                c("att_stateEstimate_yaw", "attitude", "yaw", "deg"),
                *(c(f"att_stateEstimate_{q}", "attitude_qw", q, "1") for q in ("qx", "qy", "qz", "qw"))]
    setpoint = [*(c(f"sp_ctrltarget_{a}", "setpoint", a, "m") for a in "xyz"),
                c("sp_ctrltarget_yaw", "setpoint", "yaw", "deg")]
    pid = [c("pid_controller_roll", "pid", "roll", "deg"), c("pid_controller_pitch", "pid", "pitch", "deg", -1.0),
           c("pid_controller_yaw", "pid", "yaw", "deg"), c("pid_controller_cmd_thrust", "pid", "cmd_thrust", "pwm16")]
    return (*mocap, *imu, *motor, *estimator, *attitude, *setpoint, *pid, c("pwr_pm_vbat", "battery", "vbat", "V"))


COLUMNS: tuple[Column, ...] = _columns()
"""All but the time column ``t`` (Unix seconds), in the order of the file."""

COLUMN_NAMES: tuple[str, ...] = ("t", *(c.name for c in COLUMNS))

STREAMS: dict[str, tuple[Column, ...]] = {
    s: tuple(c for c in COLUMNS if c.stream == s) for s in dict.fromkeys(c.stream for c in COLUMNS)
}

MARKS = frozenset(c.name for c in COLUMNS if c.stream not in ("mocap", "imu") or c.name.endswith("_vicon"))
"""Names that no other format has: log groups of the vehicle behind a prefix, and names with ``vicon``. Other files may
use the remaining names in other units and for other sources (``imu_acc_x``)."""

PLAIN_POSE = tuple(c.name for c in COLUMNS if c.stream == "mocap" and c.name not in MARKS)
POSITION = ("px", "py", "pz")

ROW_COUNT_KEYS = {"mocap": "vicon", "pid": "pid_output", "battery": "power"}
"""Streams that ``row_counts`` of the sheet calls by another name."""


def units_of(columns: tuple[Column, ...]) -> tuple[str, ...]:
    """SI units of the columns, as in a Stream."""
    return tuple(STREAM_QUANTITIES[c.stream][c.quantity][0] for c in columns)


def scales_of(columns: tuple[Column, ...]) -> np.ndarray:
    """(k,) factors from the file to SI."""
    return np.array([c.scale for c in columns])
