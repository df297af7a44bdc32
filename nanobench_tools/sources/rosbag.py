"""ROS 1 and ROS 2 bags (.bag, .db3, .mcap), read through rosbags (extra ``rosbag``).

Without a column map the common types are read by the purpose of their topics (``bag_choice``). The pose of a tracker
is motion capture, a pose or Odometry of the vehicle its own estimate, a set-point never either. Several vehicles are
several flights. With a map a quantity is ``/topic.field.path`` (a topic's name has no dot), and lists are read by
``index``. One body of a list of poses is ``/topic:body.field.path``. A stream may also be a topic: ``[streams] mocap =
"/topic"``. ROS has our axes (x forward, y left, z up; specific force +9.81 at rest).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..flight import STREAM_QUANTITIES, Fault, Flight, Provenance, Stream, make_stream
from .bag_choice import KNOWN, ODOMETRY, POSES, ROS, Choice, Vehicle, choose, vehicles_in
from .bag_clocks import clocks_of
from .bag_messages import LIST, Bag, read_bags, suffix_of
from .bag_topics import Topic
from .bag_twist import twist_in_world
from .base import not_numbers, text_fault
from .cells import GIGANTIC
from .column_map import ColumnMap, Entry, in_units, read_column_map
from .sheets import Sheet


@dataclass(frozen=True)
class _Plan:
    """One stream: the topic and entries it comes from; ``turned``: its velocity is in the body."""

    stream: str
    topic: str
    entries: tuple[Entry, ...]
    turned: bool = False


class RosBag:
    """Source ``rosbag``; ``vehicle``: the one of several whose flight is read. Raises InputError for a bad map."""

    name = "rosbag"

    def __init__(self, columns: str | Path | ColumnMap | None = None, vehicle: str = "") -> None:
        self.map = columns if columns is None or isinstance(columns, ColumnMap) else read_column_map(columns)
        if self.map is not None and not self.map.topics and not self.map.chosen:
            self.map = None  # a map of tables only
        self.vehicle = vehicle
        digest = "" if self.map is None else f"-{self.map.digest[:16]}"
        self.version = f"2{digest}" + (f"-{vehicle}" if vehicle else "")

    def recognises(self, path: Path, head: bytes) -> bool:
        return suffix_of(head) is not None

    def vehicles(self, path: Path, parts: Sequence[bytes]) -> tuple[str, ...]:
        """Labels of the vehicles in the files of one recording; one empty label where there is one vehicle."""
        bag = self._bag(path, parts)
        return tuple(v.label for v in _vehicles(bag, self.map))

    def of(self, vehicle: str) -> RosBag:
        """The source of one vehicle's flight."""
        return RosBag(self.map, vehicle)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        return self.read_parts(path, [data])

    def read_parts(self, path: Path, parts: Sequence[bytes]) -> Flight:
        """The flight in the files of one recording, in the order of time."""
        place = str(path)
        bag = self._bag(path, parts)
        vehicles = _vehicles(bag, self.map)
        vehicle = next((v for v in vehicles if v.label == self.vehicle), vehicles[0])
        plans, choice = _plans(bag, vehicle, self.map, place)
        times, moved = clocks_of({plan.topic: bag.messages.get(plan.topic, []) for plan in plans})
        made: dict[str, tuple[np.ndarray, Stream]] = {}
        faults: list[Fault] = []
        for plan in plans:
            if (stream := _stream(plan, bag, times[plan.topic], faults, moved)) is not None:
                made[plan.stream] = times[plan.topic], stream if self.map is None else self.map.turned(
                    plan.stream, stream)
        if not made:
            raise InputError(place, *_nothing(bag))
        start = min(int(ns.min()) for ns, _ in made.values())
        streams = {n: _placed(ns, s, start) for n, (ns, s) in sorted(made.items())}
        end = max(s.span.end_s for s in streams.values())
        topics = {plan.stream: plan.topic for plan in plans if plan.stream in streams}
        return Flight(path.name,
                      streams,
                      {
                          "family": None,
                          "speed": None,
                          "reference_speed_m_s": None,
                          "vehicle": {} if self.map is None else dict(self.map.vehicle),
                          "topics": topics,
                      },
                      Provenance(place, "", self.name, findings=(*faults, *_lost(bag, end), *not_numbers(streams)),
                                 notes=(*moved, *choice.left, *_undefined(bag), *(
                                     [f"one recording in {len(parts)} files"] if len(parts) > 1 else [])),
                                 assumptions=() if self.map is None else self.map.assumptions),
                      epoch_s=start * 1e-9)

    def _bag(self, path: Path, parts: Sequence[bytes]) -> Bag:
        mapped = set() if self.map is None else {t.partition(":")[0] for t in self.map.topics}

        def wanted(topic: str, kind: str) -> bool:
            known = kind in KNOWN or (kind == LIST and not topic.endswith("tf_static"))
            return topic in mapped or (known and (not mapped or bool(self.map and self.map.chosen)))

        return read_bags(parts, str(path), wanted)


def _vehicles(bag: Bag, column_map: ColumnMap | None) -> list[Vehicle]:
    """The vehicles of a bag; those of a column map that names no body are the bodies of its lists."""
    if column_map is not None and column_map.topics:
        lists = [t for t in column_map.topics if t in bag.listed]
        bodies = sorted({t.body for t in bag.topics.values() if t.body and t.name.partition(":")[0] in lists})
        return [Vehicle(body if len(bodies) > 1 else "", frozenset({body, ""})) for body in bodies] or [
            Vehicle("", frozenset({""}))]
    if column_map is not None and column_map.chosen:
        return [Vehicle("", frozenset({"", *(t.vehicle for t in bag.topics.values())}))]
    topics = [t for t in bag.topics.values() if t.name not in bag.listed]
    return vehicles_in(topics, bag.moved_m())


def _plans(bag: Bag, vehicle: Vehicle, column_map: ColumnMap | None, place: str) -> tuple[list[_Plan], Choice]:
    if column_map is not None and column_map.topics:
        return _mapped(column_map, bag, vehicle), Choice(left=tuple(
            f"topic {t.name} ({t.kind}) is not read" for t in bag.topics.values()
            if t.name not in column_map.topics and not t.body))
    topics = [t for t in bag.topics.values() if t.name not in bag.listed and t.name not in bag.undefined]
    choice = choose(topics, vehicle, {} if column_map is None else column_map.chosen, place,
                    bag.moved_m())
    plans: dict[str, _Plan] = {}
    for stream, topic in choice.streams.items():
        meant = _meant(stream, topic)
        if stream not in meant:
            raise InputError(place, f"the {stream} topic {topic.name} holds {topic.kind}, which gives no {stream}",
                             f"leave it out, or name fields of a topic: {stream} = {{...}}")
        for name, entries in meant.items():
            plans.setdefault(name, _Plan(name, topic.name, tuple(entries), topic.kind == ODOMETRY))
    return list(plans.values()), choice


def _meant(stream: str, topic: Topic) -> dict[str, list[Entry]]:
    """What one topic gives: by the table of ROS messages, its poses as the stream that the topic is for."""
    found: dict[str, list[Entry]] = {}
    for known in ROS[topic.kind]:
        name, quantity = known.stream, known.quantity
        if topic.kind in POSES:
            kind, axis = quantity[:-1] or "p", quantity[-1]
            name = "attitude_qw" if kind == "q" and stream == "estimator" else stream
            quantity = axis if kind == "p" and stream != "mocap" else f"{kind}{axis}"
        if quantity in STREAM_QUANTITIES.get(name, ()):
            found.setdefault(name, []).append(Entry(name, quantity, f"{topic.name}.{known.name}", unit=known.unit))
    return found


def _mapped(column_map: ColumnMap, bag: Bag, vehicle: Vehicle) -> list[_Plan]:
    plans = []
    for stream in dict.fromkeys(e.stream for e in column_map.entries):
        entries = tuple(e for e in column_map.entries if e.stream == stream)
        topics = {e.topic for e in entries}
        if len(topics) > 1:
            raise InputError(f"{column_map.path}: streams.{stream}",
                             f"comes from {len(topics)} topics ({', '.join(sorted(map(str, topics)))})",
                             "a stream has one clock: give it one topic")
        topic = entries[0].topic or entries[0].column
        if (listing := bag.listed.get(topic)) is not None:  # the body of this flight; fields of the list's element
            body = next((t.name for t in bag.topics.values() if t.body and t.name.partition(":")[0] == topic
                         and t.body in vehicle.names), topic)
            entries = tuple(replace(e, column=f"{body}.{e.field.removeprefix(f'{listing.field}.')}") for e in entries)
            topic = body
        elif topic in bag.topics and bag.topics[topic].vehicle not in {*vehicle.names, ""} and vehicle.label:
            continue  # of another vehicle
        plans.append(_Plan(stream, topic, entries))
    return plans


def _nothing(bag: Bag) -> tuple[str, str]:
    """What a bag holds of which no stream could be made, and what to do."""
    known = ", ".join(f"{t.name} ({t.kind})" for t in list(bag.topics.values())[:8]) or "no topic"
    if bag.undefined:
        kinds = ", ".join(dict.fromkeys(bag.undefined.values()))
        return (f"the bag holds no definition of {kinds}, the message type of {', '.join(bag.undefined)} (ROS 2 wrote "
                f"none before Iron); it holds {known}",
                "convert it to MCAP, which holds definitions, where the package of that type is installed: ros2 bag "
                "convert")
    return f"no message for any stream; the bag holds {known}", "name its topics in a column map"


def _undefined(bag: Bag) -> list[str]:
    unread = [f"topic {topic} is not read: the bag has no definition of {kind}. Convert it to MCAP where the package "
              "of that type is installed (ros2 bag convert)" for topic, kind in bag.undefined.items()]
    return unread + [f"topic {topic}: the bag has no definition of {kind}. That of the released package is assumed; "
                     "an MCAP file would contain it" for topic, kind in bag.assumed.items()]


def _stream(plan: _Plan, bag: Bag, time_ns: np.ndarray, faults: list[Fault], notes: list[str]) -> Stream | None:
    """The stream of a plan, its times still zero. ``time_ns`` (n,): those of its messages."""
    messages = [m for _, m in bag.messages.get(plan.topic, [])]
    entries, columns = [], []
    for entry in plan.entries:
        values = _values(messages, entry)
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
    if plan.turned and (velocity := [quantities.index(q) for q in ("vx", "vy", "vz") if q in quantities]):
        block[:, velocity], note = twist_in_world(block[:, velocity], messages, time_ns)
        notes += [f"{plan.topic}: {note}"] if note else []
    names = [e.column if e.index is None else f"{e.column}[{e.index}]" for e in entries]
    return in_units(make_stream(plan.stream, np.zeros(len(block)), block, quantities, names), entries)


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
