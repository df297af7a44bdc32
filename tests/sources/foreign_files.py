"""Small files of other people's formats, made from what public files look like; no byte is copied from any of them.

One path flown around a circle is written down in every format, so that what is read can be compared with it.
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ROWS = 40
EPOCH_NS = 1403715524907143168
STEP_NS = 5_000_000


@dataclass(frozen=True)
class Foreign:
    """data of the file; source that reads it, None where it has to be refused; seen: names a refusal has to show."""

    data: bytes
    source: str | None
    seen: tuple[str, ...] = ()


def path() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """since (n,) s, position (n, 3) m, quaternion (n, 4) x, y, z, w that is never symmetric."""
    since = np.arange(ROWS) * STEP_NS * 1e-9
    angle = 4.0 * since
    position = np.stack([np.cos(angle), 2.0 * np.sin(angle), 1.0 + 0.1 * since], axis=1)
    turn = np.stack([0.02 * np.cos(angle), 0.03 * np.sin(angle), np.sin(0.5 * angle), np.cos(0.5 * angle)], axis=1)
    return since, position, turn / np.linalg.norm(turn, axis=1, keepdims=True)


def lines(header: str, rows: list[str]) -> bytes:
    return "\n".join([header, *rows] if header else rows).encode() + b"\n"


def _table(names: list[str], columns: dict[str, np.ndarray], seed: int) -> bytes:
    """A CSV of these names: given columns, and numbers of the size of 1 for the others."""
    rng = np.random.default_rng(seed)
    values = np.stack([columns.get(n, rng.uniform(-1.0, 1.0, ROWS)) for n in names], axis=1)
    return lines(",".join(names), [",".join(f"{v:.9g}" for v in row) for row in values])


def _cycle(stem: str, axes: str) -> list[str]:
    return [stem.format(a) for a in axes]


IDSIA = [
    "", "t", "ros_timestamp", "ros_timestamp_motors", *_cycle("{}_poses", "xyz"),
    *(f"q{a}_poses" for a in "xyzw"), "yaw_poses", "pitch_poses", "roll_poses", *"xyz", *_cycle("v{}", "xyz"),
    *_cycle("q{}", "xyzw"), "yaw", "pitch", "roll", *_cycle("w{}", "xyz"), *_cycle("a{}", "xyz"),
    *(f"m{i}_thrust" for i in (1, 2, 3, 4)), *(f"m{i}_erpm" for i in (1, 2, 3, 4)), "thrust", "torque_roll",
    "torque_pitch", "torch_yaw", *_cycle("{}_setpoint", "xyz"), "Vbat", "is_flying",
]  # fmt: skip


def idsia() -> bytes:
    since, position, turn = path()
    columns = {"t": since, "": np.arange(ROWS, dtype=float), "ros_timestamp": 1.7e9 + since, "Vbat": np.full(ROWS, 3.9)}
    columns |= {f"{a}_poses": position[:, k] for k, a in enumerate("xyz")}
    columns |= {f"q{a}": turn[:, k] for k, a in enumerate("xyzw")}
    columns |= {"x": position[:, 0] + 0.1, "y": position[:, 1] + 0.1, "z": position[:, 2] + 0.1}
    return _table(IDSIA, columns, 1)


def parquet() -> bytes:
    since, position, _ = path()
    file = io.BytesIO()
    pq.write_table(pa.table({"t": since, "x_mocap": position[:, 0], "qx": position[:, 1], "m1_erpm": since}), file)
    return file.getvalue()


EUROC = ("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
         "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], "
         "b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]")  # fmt: skip


def euroc(header: str, more: int) -> bytes:
    """ASL: nanoseconds, w first, ``more`` columns behind the pose."""
    _, position, turn = path()
    rows = [",".join([str(EPOCH_NS + k * STEP_NS), *(f"{v:.6f}" for v in (*p, q[3], *q[:3])), *["0.01"] * more])
            for k, (p, q) in enumerate(zip(position, turn, strict=True))]
    return lines(header, rows)


def imu_asl() -> bytes:
    header = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2]"
    return lines(header, [f"{EPOCH_NS + k * STEP_NS},0.1,0.2,0.3,9.8" for k in range(ROWS)])


def tum(header: str, *, unit: float = 1.0, integer: bool = False, order: str = "xyzw", before: str = "",
        behind: str = "", style: str = "{:.9f}", length: float = 1.0, start: float = 1000.0) -> bytes:
    """Blanks between: time in ``unit`` of a second, position in ``length`` of a metre, cells before and behind."""
    since, position, turn = path()
    rows = []
    for k, (p, q) in enumerate(zip(position, turn, strict=True)):
        time = str(EPOCH_NS + k * STEP_NS) if integer else style.format((start + since[k]) / unit)
        pose = [style.format(v) for v in (*(p / length), *(q["xyzw".index(a)] for a in order))]
        rows.append(" ".join(filter(None, [before, time, *pose, behind])))
    return lines(header, rows)


def old_usd() -> bytes:
    """A log of the firmware before events: names with commas, blocks with their own checksums."""
    head = b"\x03" + b"tick(I),stateEstimateZ.x(h),pm.vbatMV(H),"
    block = b"\x02" + struct.pack("<IhH", 9617, -23, 3848) + struct.pack("<IhH", 19709, -23, 3842)
    return b"".join(part + struct.pack("<I", zlib.crc32(part) ^ 0xFFFFFFFF) for part in (head, block))


NEURAL_SWARM = ("# time[ms],x[m],y[m],z[m],vx[m/s],vy[m/s],vz[m/s],ax[m/s^2],ay[m/s^2],az[m/s^2],qx,qy,qz,qw,"
                "u1[N],u2[N],u3[N],u4[N],u1[PWM],u2[PWM],u3[PWM],u4[PWM],Vbat[V],thrust_des[g],torquex[Nm],"
                "wx[rad/s]")  # fmt: skip


def _plain(names: str, **columns: np.ndarray) -> bytes:
    return _table(names.split(","), {"t": path()[0], **columns}, 3)


COVARIANCE = "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33"

FOREIGN: dict[str, Foreign] = {
    "IDSIA raw CSV": Foreign(idsia(), "idsia"),
    "IDSIA Parquet": Foreign(parquet(), None, ("t", "x_mocap", "qx", "m1_erpm")),
    "EuRoC truth": Foreign(euroc(EUROC, 9), "euroc"),
    "TUM-VI truth": Foreign(
        euroc("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
              0), "euroc"),
    "EuRoC imu": Foreign(imu_asl(), "euroc"),
    "open_vins truth": Foreign(
        euroc("#time(ns),px,py,pz,qw,qx,qy,qz,vx,vy,vz,bwx,bwy,bwz,bax,bay,baz", 9), "euroc"),
    "TUM without names": Foreign(tum(""), "tum"),
    "TUM, prose above": Foreign(tum("# made by a program, 40 poses"), "tum"),
    "TUM of open_vins": Foreign(tum("# timestamp(s) tx ty tz qx qy qz qw"), "tum"),
    "TUM of rpg": Foreign(tum("# time x y z qx qy qz qw", style="{:.18e}"), "tum"),
    "TUM in nanoseconds": Foreign(tum("#timestamp [ns] tx ty tz qx qy qz qw", integer=True), "tum"),
    "TUM in microseconds": Foreign(tum("# timestamp_us tx ty tz qx qy qz qw", unit=1e-6), "tum"),
    "TUM in mm": Foreign(tum("# timestamp[s] tx[mm] ty[mm] tz[mm] qx qy qz qw", length=1e-3), "tum"),
    "TUM, w first": Foreign(tum("# timestamp tx ty tz qw qx qy qz", order="wxyz"), "tum"),
    "TUM, names no comment": Foreign(tum("t px py pz qw qx qy qz", order="wxyz"), "tum"),
    "UZH-FPV truth, 8 cells": Foreign(tum(COVARIANCE), "tum"),
    "UZH-FPV truth, 20 cells": Foreign(tum(COVARIANCE, behind=" ".join(["0.1"] * 12)), "tum"),
    "UZH-FPV truth with id": Foreign(tum("# id timestamp tx ty tz qx qy qz qw", before="7"), "tum"),
    "Blackbird text truth": Foreign(
        tum("# ts x y z qx qy qz qw", behind="0.1 0.2 0.3"), None, ("ts", "qw", "11 cells")),
    "Blackbird poses": Foreign(
        lines("", [f"{1526000000000000 + 2778 * k},1.{k},2,3,0.6,0,0.8,0" for k in range(ROWS)]), None,
        ("without a line of names",)),
    "TUM, an unknown unit": Foreign(
        tum("# timestamp[min] tx ty tz qx qy qz qw"), None, ("min", "known: s, ms, us, ns")),
    "TUM, half a quaternion": Foreign(tum("# timestamp tx ty tz qx qy i j"), None, ("lacks qz, qw",)),
    "own table with blanks": Foreign(
        tum("t x y z qx qy qz qw gx gy gz", behind="0.1 0.2 0.3"), None, ("t", "gx", "no comment")),
    "neural-swarm CSV": Foreign(
        lines(NEURAL_SWARM, [",".join([f"{9927 + 9874 * k:.18e}", *["1.0e+00"] * 25]) for k in range(ROWS)]), None,
        ("time[ms]", "x[m]")),
    "neural-swarm log": Foreign(old_usd(), "usd_blocks"),
    "DIDO HDF5": Foreign(b"\x89HDF\r\n\x1a\n" + bytes(400), None),
    "Bitcraze npy": Foreign(b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }\n"
                            + np.ones((2, 4)).tobytes(), None),
    "own pose table": Foreign(_plain("t,px,py,pz,qx,qy,qz,qw,vx,vy,vz"), None, ("t", "px", "vz", "NanoBench")),
    "own table of the estimate": Foreign(
        _plain("t,x,y,z,qx,qy,qz,qw,vx,vy,vz,roll,pitch,yaw"), None, ("t", "x", "yaw")),
    "own IMU table": Foreign(_plain("t,imu_acc_x,imu_acc_y,imu_acc_z,imu_gyro_x,imu_gyro_y,imu_gyro_z"), None,
                             ("imu_acc_x",)),
    "own flight with PWM and rotor speed": Foreign(
        _plain("t,px,py,pz,qx,qy,qz,qw,pwm1,pwm2,pwm3,pwm4,rpm1,rpm2,rpm3,rpm4,vbat"), None, ("t", "pwm1", "settled")),
    "own table of other names": Foreign(_plain("stamp,height,speed"), None, ("stamp", "height", "speed")),
    "a stand": Foreign(_plain("pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]", **{
        "pwm": np.linspace(3e3, 6e4, len(path()[0])),
        **{f"rpm{k}": np.linspace(5e3, 2e4, len(path()[0])) for k in range(1, 5)},
        "thrust[g]": np.linspace(1.0, 30.0, len(path()[0]))}), "stand"),
}  # fmt: skip
