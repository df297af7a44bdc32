"""EuRoC MAV and other data sets in its ASL layout (TUM-VI): folders, zip archives and single data.csv files.

``mav0/imu0`` becomes the stream ``imu``. ``mocap`` is ``state_groundtruth_estimate0``. Without it, ``vicon0`` or
``mocap0`` (poses) are taken, or else ``leica0`` (positions). Biases of the truth become ``extra_imu_bias``. Further
sensors become ``extra_NAME``. ``sensor.yaml`` has the axes of each sensor in the body. The body of EuRoC has x up and z
forward. The reader turns it into forward, left, up from the data, and notes the rotation.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError, NanobenchError
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from .asl_sensor import SENSORS, AslRows, as_table, columns_of, header_line, read_rows, sensor_to_body, span_of
from .axes import Frame, in_our_axes, name_of
from .members import Gathered, names_in
from .payload import ZIP_MAGIC, head
from .sheets import Sheet
from .tum import TumTrajectory

DATA, SHEET, ROOT = "data.csv", "sensor.yaml", "mav0"
_FOLDER = re.compile(rf"({'|'.join(SENSORS)})\d+")
_CAMERA = re.compile(r"cam\d+")
_MEMBER = re.compile(rf"(.*/)?(?:({'|'.join(SENSORS)})\d+/(?:data\.csv|sensor\.yaml)|cam\d+/sensor\.yaml)")
UP_SHARE = 0.85
"""Cosine up to which the mean direction of up belongs to an axis of the body; EuRoC's is 0.93."""
STEADY = 0.7
"""Length of the mean direction of up from which on the body has one."""
APART_DEG = 30.0
"""Up by the attitude and by the accelerometer are nearer in one body; flights tilt evenly to all sides."""
FORWARD_SHARE = 0.7
"""Cosine up to which a camera looks along an axis of the body."""
EUROC_UP = 0
"""The axis that is up in the body of EuRoC; z is forward there."""
ROTATIONS = tuple(turn for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
                  for turn in [np.eye(3)[list(order)] * np.array(signs)[:, None]] if np.linalg.det(turn) > 0.0)
POSITION, ROTATION, VELOCITY = ("px", "py", "pz"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "vz")
GYRO, ACC = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z")
LEVER_M = 0.005
"""A sensor nearer to the origin of the body measures its motion."""


@dataclass(frozen=True)
class Sensor:
    """One data.csv: ``name`` of its folder, rows, and T_BS (4, 4), None without a sensor.yaml that gives it."""

    name: str
    place: str
    rows: AslRows
    body: np.ndarray | None


class EurocAsl:
    """Source ``euroc``: a data set in the ASL layout, or one of its tables."""

    name = "euroc"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if head.startswith(ZIP_MAGIC):
            return any(name.endswith(DATA) for name in self.wanted(names_in(path)))
        return b"\x00" not in head[:512] and columns_of(header_line(head)) is not None

    def why_not(self, head: bytes) -> str | None:
        return ("a zip archive without a data set in the ASL layout (mav0/imu0/data.csv): unpack it"
                if head.startswith(ZIP_MAGIC) else None)

    def wanted(self, names: Sequence[str]) -> list[str]:
        """The tables and sheets of sensors in an archive."""
        return [name for name in names if _MEMBER.fullmatch(name) and not name.startswith("__MACOSX")]

    def gather(self, paths: Sequence[Path]) -> list[Gathered]:
        """Tables of one mav0 are one recording; any other table, and an archive, is one alone. So are a sensor and its
        truth alone in a folder."""
        found: dict[Path, dict[str, Path]] = {}
        lone: list[Gathered] = []
        for path in paths:
            if path.name.removesuffix(".gz").removesuffix(".xz") == DATA and _FOLDER.fullmatch(path.parent.name):
                found.setdefault(path.parent.parent, {})[f"{path.parent.name}/{DATA}"] = path
            else:
                lone.append(Gathered(path, path, {path.name: path}))
        lone = _pairs(lone)
        for root, files in found.items():
            folders = {name.split("/")[0] for name in files}
            if len(files) > 1:
                folders |= {p.name for p in sorted(root.iterdir()) if _CAMERA.fullmatch(p.name)}
            sheets = {f"{folder}/{SHEET}": root / folder / SHEET for folder in sorted(folders)
                      if (root / folder / SHEET).is_file()}
            label = root.parent if root.name == ROOT else root
            one = len(files) == 1
            lone.append(Gathered(next(iter(files.values())) if one else root,
                                 label / next(iter(folders)) if one else label, {**files, **sheets}))
        return lone

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_members(path, {path.name: data})

    def read_members(self, place: Path, members: Mapping[str, bytes]) -> Flight:
        roots = {(match[1] or "") for name in members if (match := _MEMBER.fullmatch(name))}
        if len(roots) > 1:
            raise InputError(str(place), f"holds {len(roots)} recordings ({', '.join(sorted(roots)[:4])})",
                             "unpack it and give the folder")
        sheets = {name.split("/")[-2]: sensor_to_body(data, f"{place}: {name}") for name, data in members.items()
                  if name.endswith(f"/{SHEET}")}
        sensors = []
        for name, data in members.items():
            if name.endswith(f"/{SHEET}"):
                continue
            folder = name.split("/")[-2] if "/" in name else ""
            where = str(place) if len(members) == 1 or not place.is_dir() else f"{place}/{name}"
            sensors.append(Sensor(folder, where, read_rows(as_table(data), where), sheets.get(folder)))
        if not sensors:
            raise InputError(str(place), "no table of a sensor in it", "take another copy")
        return _flight(place, sensors, {k: t for k, t in sheets.items() if _CAMERA.fullmatch(k) and t is not None})


def _pairs(lone: list[Gathered]) -> list[Gathered]:
    """One recording in place of an inertial sensor and a truth that are alone in a folder, whose times overlap. The
    truth may be a TUM trajectory."""
    found = []
    for folder in dict.fromkeys(group.place.parent for group in lone):
        here = [group for group in lone if group.place.parent == folder]
        if len(here) == 1:
            here += _trajectory_in(folder)
        spans = [span for group in here if (span := span_of(group.place)) is not None] if len(here) == 2 else []
        roles = {"position" in columns.vectors for columns, *_ in spans}
        if len(spans) == 2 and roles == {True, False} and max(s[1] for s in spans) < min(s[2] for s in spans):
            here = [Gathered(folder, folder, {name: path for group in here for name, path in group.files.items()})]
        found += [group for group in here if len(here) == 1 or group in lone]
    return found


def _trajectory_in(folder: Path) -> list[Gathered]:
    """The only TUM trajectory of a folder."""
    found = []
    for path in sorted(folder.iterdir()):
        try:
            if path.is_file() and TumTrajectory().recognises(path, head(path)):
                found.append(Gathered(path, path, {path.name: path}))
        except NanobenchError:
            continue  # listed where it is read
    return found if len(found) == 1 else []


def _flight(place: Path, sensors: list[Sensor], cameras: Mapping[str, np.ndarray]) -> Flight:
    zero = min(int(s.rows.stamps_ns[0]) for s in sensors)
    streams: dict[str, Stream] = {}
    findings: list[Fault] = []
    notes: list[str] = []
    truth = _truth_of(sensors)
    for sensor in sorted(sensors, key=lambda s: (s is not truth, s.name)):
        has = sensor.rows.vectors
        if sensor is truth:
            stream = "mocap"
            notes.append(f"mocap is {sensor.name or 'the truth'}" + _beside(sensors, truth))
        elif "gyro" in has or "acc" in has:
            stream = "imu" if "imu" not in streams else f"extra_{sensor.name}"
        else:
            stream = f"extra_{sensor.name or 'pose'}"
        time_s = (sensor.rows.stamps_ns - zero) * 1e-9
        made, more = _in_body(sensor, stream, time_s)
        streams.update(made)
        notes += more
        findings += sensor.rows.faults_of(time_s, stream)
    streams, turned = _forward_left_up(streams, cameras)
    order = [name for name in ("mocap", "imu") if name in streams]
    streams = {name: streams[name] for name in (*order, *(n for n in streams if n not in order))}
    notes += turned
    return Flight(place.name, streams,
                  {"family": None, "speed": None, "reference_speed_m_s": None, "read_as": notes},
                  Provenance(str(place), "", EurocAsl.name, findings=tuple(findings), notes=tuple(notes)),
                  epoch_s=zero * 1e-9)


def _truth_of(sensors: list[Sensor]) -> Sensor | None:
    """The state estimate with velocity, else a pose, else a position; by name among equals."""
    ranked = sorted((("velocity" not in s.rows.vectors, "quaternion" not in s.rows.vectors, s.name), k)
                    for k, s in enumerate(sensors) if "position" in s.rows.vectors)
    return sensors[ranked[0][1]] if ranked else None


def _beside(sensors: list[Sensor], truth: Sensor) -> str:
    others = [s.name for s in sensors if s is not truth and "position" in s.rows.vectors]
    return f"; {', '.join(others)} kept apart" if others else ""


def _in_body(sensor: Sensor, name: str, time_s: np.ndarray) -> tuple[dict[str, Stream], list[str]]:
    """Streams of a sensor in the axes of the body, and notes. A pose becomes that of the body; a position stays that
    of the sensor."""
    has, notes = dict(sensor.rows.vectors), []
    turn, lever = np.eye(3), np.zeros(3)
    if sensor.body is not None:
        turn, lever = sensor.body[:3, :3], sensor.body[:3, 3]
        if not np.allclose(sensor.body, np.eye(4), atol=1e-9):
            notes.append(f"{sensor.name}: brought into the body by T_BS of its {SHEET}")
    elif sensor.name:
        notes.append(f"{sensor.name}: no T_BS in a {SHEET}, so its axes and origin are taken as those of the body")
    away = f"{1e3 * float(np.linalg.norm(lever)):.0f} mm"
    far = float(np.linalg.norm(lever)) > LEVER_M
    for vector in ("gyro", "acc", "gyro_bias", "acc_bias"):
        if vector in has:
            has[vector] = has[vector] @ turn.T
    if "quaternion" in has:
        has["quaternion"] = so3.multiply(has["quaternion"], _quaternion(turn.T))
    if far and "acc" in has:
        notes.append(f"{sensor.name}: the accelerometer is {away} from the origin of the body; not corrected")
    if far and "position" in has:
        if "quaternion" in has:
            there = np.isfinite(has["quaternion"]).all(axis=1)
            has["position"] = has["position"] - np.where(
                there[:, None], so3.rotate(np.where(there[:, None], has["quaternion"], [0.0, 0.0, 0.0, 1.0]), lever),
                np.nan)
            if has.pop("velocity", None) is not None:
                notes.append(f"{sensor.name}: velocity left out, because it is that of a point {away} off the body")
        else:
            notes.append(f"{sensor.name}: positions are those of the prism, {away} from the origin of the body")
    streams = {}
    bias = [v for v in ("gyro_bias", "acc_bias") if v in has]
    if bias:
        key = "extra_imu_bias" if name == "mocap" else f"{name}_bias"
        columns = [f"{v}_{a}" for v in bias for a in "xyz"]
        units = [u for v in bias for u in [{"gyro_bias": "rad/s", "acc_bias": "m/s^2"}[v]] * 3]
        streams[key] = Stream(time_s, np.hstack([has[v] for v in bias]), tuple(columns), tuple(columns), tuple(units),
                              "body", _rate(time_s), len(time_s))
    parts = [(v, q) for v, q in (("position", POSITION), ("quaternion", ROTATION), ("velocity", VELOCITY),
                                 ("gyro", GYRO), ("acc", ACC)) if v in has]
    if not parts:
        return streams, notes
    kind = "imu" if {"gyro", "acc"} & has.keys() else "mocap"
    keep = [(v, q) for v, q in parts if (v in ("gyro", "acc")) == (kind == "imu")]
    names = [n for v, _ in keep for n, _ in sensor.rows.columns.vectors[v]]
    made = make_stream(kind, time_s, np.hstack([has[v] for v, _ in keep]), [q for _, qs in keep for q in qs], names,
                       samples=len(time_s), rate_hz=_rate(time_s))
    return {name: made, **streams}, notes


def _rate(time_s: np.ndarray) -> float:
    duration = float(time_s[-1] - time_s[0])
    return (len(time_s) - 1) / duration if duration > 0.0 else float("nan")


def _quaternion(turn: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(turn).as_quat())


def _forward_left_up(streams: dict[str, Stream],
                     cameras: Mapping[str, np.ndarray]) -> tuple[dict[str, Stream], list[str]]:
    """The streams in a body with x forward, y left, z up, and a note on what showed its axes."""
    by_pose, by_force = _up_by_pose(streams.get("mocap")), _up_by_force(streams.get("imu"))
    up = by_force if by_pose is None else by_pose
    if up is None:
        return streams, []
    if by_pose is not None and by_force is not None and (apart := _apart_deg(by_pose, by_force)) > APART_DEG:
        return streams, [f"axes are not changed: attitude and accelerometer disagree by {apart:.0f} deg on which "
                         f"body axis is up, so one {SHEET} is missing or wrong"]
    axis = int(np.argmax(np.abs(up)))
    if abs(up[axis]) < UP_SHARE * float(np.linalg.norm(up)):
        return streams, [f"no axis of the body points up (mean direction {up[0]:.2f}, {up[1]:.2f}, {up[2]:.2f}): its "
                         "axes are left as they are"]
    fitting = [turn for turn in ROTATIONS if turn[2, axis] * up[axis] > 0.5]
    look = next((t[:3, 2] for _, t in sorted(cameras.items())
                 if max(float(turn[0] @ t[:3, 2]) for turn in fitting) > FORWARD_SHARE), None)
    if look is not None:
        turn, why = max(fitting, key=lambda t: float(t[0] @ look)), "forward is where the camera looks"
    elif axis == EUROC_UP and up[axis] > 0.0:
        turn, why = np.array([[0.0, 0, 1], [0, -1.0, 0], [1.0, 0, 0]]), "z is taken as forward, as in EuRoC"
    else:
        turn = max(fitting, key=np.trace)
        why = "no camera shows which axis is forward"
    if np.array_equal(turn, np.eye(3)):
        return streams, []
    frame = Frame("body", np.eye(3), turn)
    seen = f"{'-' * bool(up[axis] < 0.0)}{'xyz'[axis]} of the body is up on average ({abs(up[axis]):.2f})"
    found = {name: _turned(stream, frame, turn) for name, stream in streams.items()}
    return found, [f"body axes {name_of(turn, False)} turned into forward, left, up: {seen}; {why}"]


def _turned(stream: Stream, frame: Frame, turn: np.ndarray) -> Stream:
    if stream.quantities[0].endswith(("_bias_x",)):
        parts = [stream.values[:, k:k + 3] @ turn.T for k in range(0, stream.values.shape[1], 3)]
        return replace(stream, values=np.hstack(parts))
    return in_our_axes(stream, frame)


def _up_by_pose(mocap: Stream | None) -> np.ndarray | None:
    """(3,) mean direction of up in the body; None without an attitude, or where the body has none."""
    if mocap is None or "qw" not in mocap:
        return None
    q = mocap[ROTATION]
    q = q[np.isfinite(q).all(axis=1)]
    mean = so3.rotate_inverse(q, np.array([0.0, 0.0, 1.0])).mean(axis=0) if len(q) else np.zeros(3)
    return mean if float(np.linalg.norm(mean)) > STEADY else None


def _up_by_force(imu: Stream | None) -> np.ndarray | None:
    """The same by the accelerometer."""
    if imu is None or "acc_x" not in imu:
        return None
    acc = imu[ACC]
    acc = acc[np.isfinite(acc).all(axis=1)]
    size = float(np.median(np.linalg.norm(acc, axis=1))) if len(acc) else 0.0
    mean = acc.mean(axis=0) / size if size > 0.0 else np.zeros(3)
    return np.asarray(mean) if float(np.linalg.norm(mean)) > STEADY else None


def _apart_deg(a: np.ndarray, b: np.ndarray) -> float:
    cosine = float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
