"""ROS 1 and ROS 2 bags (.bag, .db3, .mcap), read through rosbags (extra ``rosbag``).

With a column map a quantity is ``/topic.field.path`` (a topic's name has no dot), lists by ``index``. Without one the
common types are read as they are meant: poses and transforms are motion capture, Odometry the vehicle's own estimate,
Imu and BatteryState what they say. ROS has our axes (x forward, y left, z up; specific force +9.81 at rest).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Fault, Flight, Provenance, Stream, make_stream
from .bag_messages import Bag, read_bag, suffix_of
from .base import not_numbers, text_fault
from .cells import GIGANTIC
from .column_map import ColumnMap, Entry, in_units, read_column_map
from .sheets import Sheet


def _paths(quantities: str, prefix: str, fields: str = "x y z w") -> dict[str, str]:
    return {q: f"{prefix}.{f}" for q, f in zip(quantities.split(), fields.split(), strict=False)}


def _pose(position: str, orientation: str) -> dict[str, dict[str, str]]:
    return {"mocap": {**_paths("px py pz", position), **_paths("qx qy qz qw", orientation)}}


MEANT: dict[str, dict[str, dict[str, str]]] = {
    "geometry_msgs/msg/PoseStamped": _pose("pose.position", "pose.orientation"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose("pose.pose.position", "pose.pose.orientation"),
    "geometry_msgs/msg/TransformStamped": _pose("transform.translation", "transform.rotation"),
    "nav_msgs/msg/Odometry": {
        "estimator": {**_paths("x y z", "pose.pose.position"), **_paths("vx vy vz", "twist.twist.linear")},
        "attitude_qw": _paths("qx qy qz qw", "pose.pose.orientation"),
    },
    "sensor_msgs/msg/Imu": {
        "imu": {
            **_paths("acc_x acc_y acc_z", "linear_acceleration"),
            **_paths("gyro_x gyro_y gyro_z", "angular_velocity"),
        }
    },
    "sensor_msgs/msg/BatteryState": {"battery": {"vbat": "voltage"}},
}
"""Message type -> stream -> quantity -> field, without a column map. Odometry's twist is in the body and is turned."""


@dataclass(frozen=True)
class _Plan:
    """One stream: the topic and entries it comes from."""

    stream: str
    topic: str
    entries: tuple[Entry, ...]


class RosBag:
    """Source ``rosbag``. Raises InputError for a bad map."""

    name = "rosbag"

    def __init__(self, columns: str | Path | ColumnMap | None = None) -> None:
        self.map = columns if columns is None or isinstance(columns, ColumnMap) else read_column_map(columns)
        if self.map is not None and not self.map.topics:
            self.map = None  # a map of tables only
        self.version = "1" if self.map is None else f"1-{self.map.digest[:16]}"

    def recognises(self, path: Path, head: bytes) -> bool:
        return suffix_of(head) is not None

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        topics = set() if self.map is None else set(self.map.topics)
        bag = read_bag(data, place, lambda topic, kind: topic in topics if topics else kind in MEANT)
        plans = _meant(bag) if self.map is None else _mapped(self.map)
        made: dict[str, tuple[np.ndarray, Stream]] = {}
        faults: list[Fault] = []
        for plan in plans:
            if (stream := _stream(plan, bag, faults, self.map is None)) is not None:
                made[plan.stream] = stream if self.map is None else (stream[0], self.map.turned(plan.stream, stream[1]))
        if not made:
            known = ", ".join(f"{t} ({k})" for t, k in list(bag.types.items())[:8]) or "no topic"
            advice = "name its topics in a column map"
            raise InputError(place, f"no message for any stream; the bag holds {known}", advice)
        start = min(int(ns.min()) for ns, _ in made.values())
        streams = {n: _placed(ns, s, start) for n, (ns, s) in sorted(made.items())}
        end = max(s.span.end_s for s in streams.values())
        faults = [*faults, *_lost(bag, end), *not_numbers(streams)]
        used = {plan.topic for plan in plans if plan.stream in streams}
        notes = [f"topic {t} ({k}) is not read" for t, k in bag.types.items() if t not in used]
        return Flight(path.name,
                      streams,
                      {
                          "family": None,
                          "speed": None,
                          "reference_speed_m_s": None,
                          "vehicle": {} if self.map is None else dict(self.map.vehicle),
                      },
                      Provenance(place, "", self.name, findings=tuple(faults), notes=tuple(notes),
                                 assumptions=() if self.map is None else self.map.assumptions),
                      epoch_s=start * 1e-9)


def _meant(bag: Bag) -> list[_Plan]:
    """Each stream from the topic with most messages that is meant for it."""
    best: dict[str, str] = {}
    for topic, messages in sorted(bag.messages.items(), key=lambda item: (-len(item[1]), item[0])):
        for stream in MEANT[bag.types[topic]] if messages else ():
            best.setdefault(stream, topic)
    return [
        _Plan(stream, topic,
              tuple(Entry(stream, q, f"{topic}.{p}") for q, p in MEANT[bag.types[topic]][stream].items()))
        for stream, topic in best.items()
    ]


def _mapped(column_map: ColumnMap) -> list[_Plan]:
    plans = []
    for stream in dict.fromkeys(e.stream for e in column_map.entries):
        entries = tuple(e for e in column_map.entries if e.stream == stream)
        topics = {e.topic for e in entries}
        if len(topics) > 1:
            raise InputError(f"{column_map.path}: streams.{stream}",
                             f"comes from {len(topics)} topics ({', '.join(sorted(map(str, topics)))})",
                             "a stream has one clock: give it one topic")
        plans.append(_Plan(stream, entries[0].topic or entries[0].column, entries))
    return plans


def _stream(plan: _Plan, bag: Bag, faults: list[Fault], meant: bool) -> tuple[np.ndarray, Stream] | None:
    """Unix stamps (n,) [ns] and the stream, its times still zero."""
    messages = bag.messages.get(plan.topic, [])
    entries, columns = [], []
    for entry in plan.entries:
        values = _values([m for _, m in messages], entry)
        if values is not None and np.isfinite(values).any():
            entries.append(entry)
            columns.append(entry.to_si(values))
    missing = tuple(e.column if e.index is None else f"{e.column}[{e.index}]" for e in plan.entries if e not in entries)
    if missing:
        faults.append(
            text_fault("missing_column", plan.stream, missing,
                       f"{', '.join(missing)}: not in the bag or without any number", (0.0, 0.0), float(len(missing)),
                       "columns")
        )
    if not entries:
        return None
    block = np.stack(columns, axis=1)
    quantities = tuple(e.quantity for e in entries)
    if meant and plan.stream == "estimator":
        block = _turned(block, quantities, [m for _, m in messages])
    names = [e.column if e.index is None else f"{e.column}[{e.index}]" for e in entries]
    made = make_stream(plan.stream, np.zeros(len(block)), block, quantities, names)
    return _stamps(messages), in_units(made, entries)


def _values(messages: Iterable[Any], entry: Entry) -> np.ndarray | None:
    """(n,) of one field; NaN where a list is too short; None where there is no such field or it holds no number."""
    field = attrgetter(entry.field)
    try:
        found = [field(m) for m in messages]
        if entry.index is not None:
            found = [v[entry.index] if entry.index < len(v) else np.nan for v in found]
        values = np.array([float(v) for v in found])
    except (AttributeError, TypeError, ValueError):
        return None
    return np.where(np.abs(values) < GIGANTIC, values, np.nan)


def _turned(block: np.ndarray, quantities: tuple[str, ...], messages: list[Any]) -> np.ndarray:
    """Odometry's velocity from the body into the world."""
    columns = [quantities.index(q) for q in ("vx", "vy", "vz") if q in quantities]
    turns = [m.pose.pose.orientation for m in messages]
    quaternion = np.array([[q.x, q.y, q.z, q.w] for q in turns], float)
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        quaternion = quaternion / norm
    if len(columns) == 3:
        block[:, columns] = so3.rotate(quaternion, block[:, columns])
    return block


def _stamps(messages: list[tuple[int, Any]]) -> np.ndarray:
    """(n,) ns: the sender's stamps where every message has one, else when it was received."""
    headers = [getattr(getattr(m, "header", None), "stamp", None) for _, m in messages]
    sent = [0 if s is None else int(s.sec) * 10**9 + int(s.nanosec) for s in headers]
    return np.array(sent if all(s > 0 for s in sent) else [ns for ns, _ in messages], dtype=np.int64)


def _placed(stamps: np.ndarray, stream: Stream, start: int) -> Stream:
    time_s = (stamps - start) * 1e-9
    duration = float(time_s[-1] - time_s[0])
    rate = (len(time_s) - 1) / duration if duration > 0.0 else float("nan")
    pairs: Mapping[str, Any] = {"samples": len(time_s), "rate_hz": rate}
    return Stream(time_s, stream.values, stream.columns, stream.quantities, stream.unit, stream.frame, **pairs)


def _lost(bag: Bag, end: float) -> list[Fault]:
    faults = []
    for topic, n in bag.unreadable.items():
        evidence = f"{n} messages of {topic} cannot be decoded, left out"
        faults.append(text_fault("bad_cell", "", (topic,), evidence, (0.0, end), float(n), "rows"))
    return [*faults, text_fault("truncated", "", (), bag.broken, (end, end))] if bag.broken else faults
