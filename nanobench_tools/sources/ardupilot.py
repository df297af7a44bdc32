"""ArduPilot logs (DataFlash, ``.bin``): inertial sensor, attitude, estimate, motors, rotor speeds, battery.

ArduPilot's world is NED and its body FRD; both are turned into ours. The parameters in the log give the order of the
motors and the range of their commands. Without them motor outputs are kept apart. Poses from outside (VISP) are
``mocap``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from ..units import factor
from .axes import frame_of, in_our_axes
from .base import not_numbers, text_fault
from .cells import GIGANTIC
from .dataflash_messages import MAGIC, Messages, messages_of
from .sheets import Sheet

TIME = "TimeUS"
INSTANCES = ("I", "C", "Instance", "Inst")
"""Columns with the number of a sensor or of an estimator."""
FARTHEST_S = 1e5
DEG = factor("deg")
MOTOR_FUNCTIONS = (33, 36, 34, 35)
"""SERVOn_FUNCTION of front right, back right, back left, front left: motors 1, 4, 2, 3 of a quadrotor X."""
QUADROTOR, X_TYPES = 1.0, (1.0, 3.0)
"""FRAME_CLASS, and the FRAME_TYPE of X and H."""
CHANNELS = 16
SAME_S = 0.02
"""Speeds of all rotors that were logged within it are one row."""
SAME_SHARE = 0.9
GPS_EPOCH_UNIX_S, LEAP_S = 315964800.0, 18.0
FIX_3D = 3


@dataclass(frozen=True)
class Wanted:
    """Stream and quantities of a message, with the factors of its columns; the first message that is there is read."""

    stream: str
    messages: tuple[str, ...]
    quantities: tuple[str, ...]
    columns: tuple[str, ...]
    scales: tuple[float, ...]


WANTED = (
    Wanted("imu", ("IMU",), ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"),
           ("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ"), (1.0,) * 6),
    Wanted("attitude", ("ATT",), ("roll", "pitch", "yaw"), ("Roll", "Pitch", "Yaw"), (DEG,) * 3),
    Wanted("estimator", ("XKF1", "NKF1"), ("x", "y", "z", "vx", "vy", "vz"), ("PN", "PE", "PD", "VN", "VE", "VD"),
           (1.0,) * 6),
    Wanted("mocap", ("VISP",), ("px", "py", "pz", "roll", "pitch", "yaw"), ("PX", "PY", "PZ", "R", "P", "Y"),
           (1.0, 1.0, 1.0, DEG, DEG, DEG)),
    Wanted("battery", ("BAT", "CURR"), ("vbat", "current"), ("Volt", "Curr"), (1.0, 1.0)),
    Wanted("battery", ("BAT", "CURR"), ("vbat",), ("Volt",), (1.0,)),
)
TURNED = ("imu", "attitude", "estimator", "mocap")


class ArduPilot:
    """Source ``ardupilot``."""

    name = "ardupilot"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(MAGIC)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        log = messages_of(data)
        parameters = _parameters(log)
        notes = ["axes: ArduPilot's NED and FRD turned into x east, y north, z up and x forward, y left, z up"]
        found: dict[str, tuple[np.ndarray, np.ndarray, Wanted]] = {}
        lost = 0
        for wanted in WANTED:
            if wanted.stream not in found and (rows := _rows(log, wanted)) is not None:
                found[wanted.stream], more = rows
                lost += more
        motors, note = _motors(log, parameters)
        notes += [note] if note else []
        speeds = _speeds(log, parameters)
        times = [t for t, _, _ in found.values()] + [part[0] for part in (motors, speeds) if part is not None]
        if not times:
            raise InputError(str(path), "an ArduPilot log without inertial sensor, attitude, estimate, motors or "
                             "battery", "the log was stopped before it began, or cut" if not log.rows else
                             f"of messages it holds {', '.join(sorted(log.rows)[:8])}")
        start = min(float(t[0]) for t in times)
        frame = frame_of("NED/FRD")
        streams: dict[str, Stream] = {}
        for name, (time_s, values, wanted) in found.items():
            stream = _stream(name, time_s - start, values, wanted.quantities, wanted.columns)
            streams[name] = in_our_axes(stream, frame) if name in TURNED else stream
        if "mocap" in streams:
            streams["mocap"] = _with_quaternion(streams["mocap"])
        for name, part in (("motor", motors), ("rpm", speeds)):
            if part is not None:
                streams[name] = _stream(name, part[0] - start, part[1], ("m1", "m2", "m3", "m4"))
        if "mocap" in streams:
            notes.append("mocap is VISP: poses from outside, by motion capture or by a camera on board")
        end = max(s.span.end_s for s in streams.values())
        findings = [*_damage(log, lost, end), *not_numbers(streams)]
        boot = _boot_unix_s(log)
        return Flight(path.name, streams,
                      {"family": None, "speed": None, "reference_speed_m_s": None,
                       "clock": "seconds since boot" if boot is None else "UTC by satellite", "read_as": notes},
                      Provenance(str(path), "", self.name, findings=tuple(findings), notes=tuple(notes)),
                      epoch_s=start + (boot or 0.0))


def _stream(name: str, time_s: np.ndarray, values: np.ndarray, quantities: Sequence[str],
            columns: Sequence[str] | None = None) -> Stream:
    span = float(time_s[-1] - time_s[0])
    return make_stream(name, time_s, values, quantities, columns, samples=len(time_s),
                       rate_hz=(len(time_s) - 1) / span if span > 0.0 else float("nan"))


def _with_quaternion(poses: Stream) -> Stream:
    turn = so3.from_euler_zyx(*poses["roll", "pitch", "yaw"].T)
    return _stream("mocap", poses.time_s, np.hstack([poses["px", "py", "pz"], turn]),
                   ("px", "py", "pz", "qx", "qy", "qz", "qw"))


def _first(log: Messages, name: str) -> np.ndarray:
    """(n,) bool: the rows of the first sensor or estimator of a message."""
    rows = log.rows[name]
    number = next((c for c in INSTANCES if c in (rows.dtype.names or ())), None)
    return np.ones(len(rows), dtype=bool) if number is None else rows[number] == rows[number].min()


def _times(log: Messages, name: str) -> np.ndarray:
    return 1e-6 * log.column(name, TIME)


def _rows(log: Messages, wanted: Wanted) -> tuple[tuple[np.ndarray, np.ndarray, Wanted], int] | None:
    """Seconds since boot, values in SI in the axes of the log, and how many rows had an impossible time."""
    for name in wanted.messages:
        if name not in log.rows or not {TIME, *wanted.columns} <= set(log.rows[name].dtype.names or ()):
            continue
        kept = _first(log, name)
        time_s = _times(log, name)[kept]
        near = np.abs(time_s - np.median(time_s)) < FARTHEST_S
        values = np.stack([s * log.column(name, c)[kept] for c, s in zip(wanted.columns, wanted.scales, strict=True)],
                          axis=1)[near]
        values = np.where(np.abs(values) < GIGANTIC, values, np.nan)
        if near.any():
            return (time_s[near], values, wanted), int((~near).sum())
    return None


def _parameters(log: Messages) -> dict[str, float]:
    if "PARM" not in log.rows or not {"Name", "Value"} <= set(log.rows["PARM"].dtype.names or ()):
        return {}
    rows = log.rows["PARM"]
    return {bytes(n).split(b"\x00")[0].decode("ascii", errors="replace"): float(v)
            for n, v in zip(rows["Name"], rows["Value"], strict=True)}


def _outputs(parameters: Mapping[str, float]) -> list[int] | None:
    """Output channels of our motors 1 to 4; None where the parameters do not show a quadrotor X."""
    if parameters.get("FRAME_CLASS") != QUADROTOR or parameters.get("FRAME_TYPE") not in X_TYPES:
        return None
    by_function = {parameters.get(f"SERVO{k}_FUNCTION"): k for k in range(1, CHANNELS + 1)}
    found = [by_function.get(float(f)) for f in MOTOR_FUNCTIONS]
    return None if None in found else [k for k in found if k is not None]


def _motors(log: Messages, parameters: Mapping[str, float]) -> tuple[tuple[np.ndarray, np.ndarray] | None, str]:
    """Seconds and shares of the range (n, 4) in our order, and a note."""
    outputs = _outputs(parameters)
    low, high = parameters.get("MOT_PWM_MIN", 0.0), parameters.get("MOT_PWM_MAX", 0.0)
    names = set(log.rows["RCOU"].dtype.names or ()) if "RCOU" in log.rows else set()
    if not names:
        return None, ""
    if outputs is None or not {TIME, *(f"C{k}" for k in outputs)} <= names:
        return None, "motors left out: no parameters of a quadrotor X in the log (FRAME_CLASS, SERVOn_FUNCTION)"
    if not 0.0 < low < high:
        return None, "motors left out: no MOT_PWM_MIN and MOT_PWM_MAX in the log"
    time_s = _times(log, "RCOU")
    near = np.abs(time_s - np.median(time_s)) < FARTHEST_S
    pwm = np.stack([log.column("RCOU", f"C{k}")[near] for k in outputs], axis=1)
    return (time_s[near], np.clip((pwm - low) / (high - low), 0.0, 1.0)), (
        f"motors: outputs {', '.join(map(str, outputs))} as a share of {low:.0f} to {high:.0f} us")


def _speeds(log: Messages, parameters: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray] | None:
    """Seconds and rotor speeds (n, 4) rad/s in our order, of messages of all motors that belong together."""
    outputs = _outputs(parameters)
    names = set(log.rows["ESC"].dtype.names or ()) if "ESC" in log.rows else set()
    number = next((c for c in INSTANCES if c in names), None)
    if outputs is None or number is None or not {TIME, "RPM"} <= names:
        return None
    time_s, rpm, which = _times(log, "ESC"), log.column("ESC", "RPM"), log.rows["ESC"][number]
    parts = [(time_s[which == k - 1], rpm[which == k - 1]) for k in outputs]
    if any(len(t) < 2 for t, _ in parts):
        return None
    first = parts[0][0]
    speeds, together = [], np.ones(len(first), dtype=bool)
    for stamps, values in parts:
        order = np.argsort(stamps, kind="stable")
        at = np.clip(np.searchsorted(stamps[order], first), 1, len(stamps) - 1)
        at -= np.abs(first - stamps[order][at - 1]) < np.abs(first - stamps[order][at])
        together &= np.abs(stamps[order][at] - first) < SAME_S
        speeds.append(values[order][at])
    if together.mean() < SAME_SHARE:
        return None
    found = np.stack(speeds, axis=1)[together] * factor("rpm")
    return first[together], np.where(np.abs(found) < GIGANTIC, found, np.nan)


def _boot_unix_s(log: Messages) -> float | None:
    """Unix time of the zero of the log's clock, where a satellite receiver knew it."""
    if "GPS" not in log.rows or not {TIME, "Status", "GMS", "GWk"} <= set(log.rows["GPS"].dtype.names or ()):
        return None
    fixed = (log.rows["GPS"]["Status"] >= FIX_3D) & (log.column("GPS", "GWk") > 0.0)
    if not fixed.any():
        return None
    unix = GPS_EPOCH_UNIX_S - LEAP_S + 604800.0 * log.column("GPS", "GWk") + 1e-3 * log.column("GPS", "GMS")
    return float(np.median((unix - _times(log, "GPS"))[fixed]))


def _damage(log: Messages, lost: int, end: float) -> list[Fault]:
    faults = []
    if log.cut:
        faults.append(text_fault("truncated", "", (), f"the log ends inside a message, {log.cut} bytes after its last "
                                 "whole one", (end, end)))
    if log.skipped or lost:
        where = f"byte {log.first_skipped} begins no message, {log.skipped} bytes left out" if log.skipped else (
            "timestamps far from the others")
        more = f"; {lost} messages with impossible times left out" if lost else ""
        faults.append(text_fault("checksum", "", (), f"{where}; read what could still be parsed{more}", (0.0, end)))
    return faults
