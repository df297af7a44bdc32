"""Which topics of a bag make the streams of which vehicle. Roles and types decide; doubtful topics are left to the
user."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from ..errors import InputError
from .bag_topics import AUTOPILOT, OTHER_SENSOR, RAW, Role, Topic
from .known import ecosystem

ROS = ecosystem("ros").topics
POSES = tuple(kind for kind, names in ROS.items() if names[0].stream in ("mocap", "estimator"))
"""Types that say where a vehicle is, the plainest first: of several from one node the first is taken."""
IMU, BATTERY = (next(kind for kind, names in ROS.items() if names[0].stream == stream)
                for stream in ("imu", "battery"))
ODOMETRY = "nav_msgs/msg/Odometry"
KNOWN = frozenset(ROS)
MOVES_M = 0.1
"""A body that moves by less in the whole bag is furniture: a gate, a charger."""


LOGGED = ("LogDataGeneric", "GenericLogData")
"""Types of a Crazyflie's own variables, which bear no names."""


@dataclass(frozen=True)
class Vehicle:
    """``label`` of its flight, empty for the only one of a bag; ``names`` that its topics bear, "" for topics that bear
    none."""

    label: str
    names: frozenset[str]


@dataclass(frozen=True)
class Choice:
    """streams: stream -> topic; left: sentences about what was not taken, and what was taken for something."""

    streams: dict[str, Topic] = field(default_factory=dict)
    left: tuple[str, ...] = ()


def vehicles_in(topics: Sequence[Topic], moved_m: Mapping[str, float]) -> list[Vehicle]:
    """The vehicles of a bag.

    moved_m: how far each topic of poses moves. A tracked body that stands still while another moves, and that has no
    topic on board, is no vehicle. A tracker and a vehicle may call the same vehicle by different names.
    """
    poses = [t for t in topics if t.kind in POSES and t.role in (Role.TRACKER, Role.UNKNOWN) and t.vehicle]
    tracked = {t.vehicle for t in poses if t.role is Role.TRACKER or t.body}
    aboard = {t.vehicle for t in topics if t.vehicle and not t.body and (t.kind in KNOWN or t.kind.endswith(LOGGED))
              and not (t.kind in POSES and t.role in (Role.TRACKER, Role.NONE))}
    moving = {t.vehicle for t in poses if moved_m.get(t.name, 0.0) > MOVES_M}
    if tracked & moving:
        tracked = {name for name in tracked if name in moving | aboard}
    others = aboard - tracked
    if len(tracked) <= 1 and len(others) <= 1 and not any(_siblings(a, b) for a in tracked for b in others):
        return [Vehicle("", frozenset({*tracked, *others, ""}))]
    return [Vehicle(name, frozenset({name})) for name in sorted(tracked | aboard)]


def _siblings(one: str, other: str) -> bool:
    """Whether two names differ by their numbers: uav1 and uav2."""
    return re.sub(r"\d+", "", one.lower()) == re.sub(r"\d+", "", other.lower())


def choose(topics: Sequence[Topic], vehicle: Vehicle, chosen: Mapping[str, str], place: str,
           moved_m: Mapping[str, float] = MappingProxyType({})) -> Choice:
    """The topics of one vehicle.

    ``chosen``: stream -> topic, of a column map. ``moved_m``: how far each topic of poses moves. A pose of unknown role
    that stands still while another moves is a place: a landing pad, a point of take-off.
    InputError lists the topics where several may be meant.
    """
    own = [t for t in topics if t.vehicle in vehicle.names and t.kind in KNOWN]
    streams = {stream: _named(name, topics, stream, place) for stream, name in chosen.items()}
    left: list[str] = []
    moves = any(moved_m.get(t.name, 0.0) > MOVES_M for t in own if t.kind in POSES)
    poses = [t for t in own if t.kind in POSES and not (
        moves and t.role is Role.UNKNOWN and moved_m.get(t.name, math.inf) < MOVES_M)]
    onboard = [t for t in poses if t.role is Role.ESTIMATE and not set(t.words) & AUTOPILOT]
    for role in (Role.TRACKER, Role.FORWARDED, Role.UNKNOWN):
        if "mocap" in streams or (found := _one([t for t in poses if t.role is role], "mocap", place)) is None:
            continue
        seen = role is Role.FORWARDED and "vision" in found.words
        if seen and onboard:
            left.append(f"{found.name} is not read as motion capture: {onboard[0].name} may have made it on board; "
                        f"{_how('mocap', [found])}")
            continue
        streams["mocap"] = found
        if seen or role is Role.UNKNOWN:
            left.append(f"{found.name} is taken for motion capture: its name does not say "
                        + ("whether a tracker or a camera on board made it" if seen else "what it is"))
    known = "mocap" in streams and streams["mocap"].role is not Role.UNKNOWN
    estimates = [t for t in poses if t.role is Role.ESTIMATE or (known and t.role is Role.UNKNOWN and not t.body)]
    for stream, candidates in (("estimator", estimates), ("imu", [t for t in own if t.kind == IMU])):
        if stream not in streams and (found := _one(_foremost(candidates), stream, place)) is not None:
            streams[stream] = found
            if stream == "estimator" and found.role is Role.UNKNOWN:
                left.append(f"{found.name} is taken for the vehicle's estimate: its name does not show its role")
    for stream, candidates in (("setpoint", [t for t in poses if t.role is Role.SETPOINT and t.kind == POSES[0]]),
                               ("battery", _foremost([t for t in own if t.kind == BATTERY]))):
        if stream in streams or not candidates:
            continue
        if len(candidates) == 1:
            streams[stream] = candidates[0]
        else:
            names = ", ".join(t.name for t in candidates)
            left.append(f"{stream}: one of {names}, not read; {_how(stream, candidates)}")
    used = {t.name for t in streams.values()}
    left += [_not_read(t) for t in topics if t.name not in used
             and (not vehicle.label or t.vehicle in {*vehicle.names, ""})]
    return Choice(streams, tuple(left))


def _not_read(topic: Topic) -> str:
    why = ""
    if topic.kind.endswith(LOGGED):
        why = f': its values bear no names; give them in a column map, as {{column = "{topic.name}.values", index = 0}}'
    elif topic.kind in POSES and topic.role is Role.SETPOINT:
        why = ": a set-point, never the truth"
    return f"topic {topic.name} ({topic.kind}) is not read{why}"


def _foremost(topics: Sequence[Topic]) -> list[Topic]:
    """Those of the flight controller, else those of no other device; unfiltered ones only where there are no others."""
    def rank(topic: Topic) -> tuple[bool, bool, bool, bool]:
        words = set(topic.words)
        estimate = topic.kind in POSES
        return (bool(words & OTHER_SENSOR), not words & AUTOPILOT, estimate and "global" in words,
                bool(words & RAW) or (estimate and "local" not in words))

    first = min(map(rank, topics), default=None)
    return [t for t in topics if rank(t) == first]


def _one(topics: Sequence[Topic], stream: str, place: str) -> Topic | None:
    """The one topic of several about one thing: the plainest type of one node. InputError where nodes differ."""
    if not topics:
        return None
    order = (ODOMETRY, *POSES) if stream == "estimator" else (*POSES, IMU)
    by_type = sorted(topics, key=lambda t: (order.index(t.kind), t.name))
    first = by_type[0]
    others = [t for t in by_type[1:] if not (t.kind != first.kind and _same_node(t, first))]
    if others:
        names = ", ".join(f"{t.name} ({t.kind.rpartition('/')[2]})" for t in sorted(topics, key=lambda t: t.name))
        raise InputError(place, f"{len(topics)} topics may be the {stream}: {names}", _how(stream, by_type))
    return first


def _same_node(one: Topic, other: Topic) -> bool:
    """Whether one program says the same in two types: of one stem, or of one body in a list and in the tree of
    frames."""
    if one.body or other.body:
        return one.body == other.body
    a, b = sorted((one.stem, other.stem), key=len)
    return b == a or (b.startswith(f"{a}/") and b in (one.name, other.name))


def _how(stream: str, topics: Sequence[Topic]) -> str:
    return f'choose one in a column map (--columns MAP.toml): [streams] {stream} = "{topics[0].name}"'


def _named(name: str, topics: Sequence[Topic], stream: str, place: str) -> Topic:
    found = next((t for t in topics if t.name == name), None)
    if found is None or found.kind not in KNOWN:
        known = ", ".join(sorted(t.name for t in topics if t.kind in KNOWN)) or "none"
        what = "is not in the bag" if found is None else f"holds {found.kind}, of which no stream is known"
        raise InputError(place, f"the {stream} topic {name} {what}", f"topics that can be chosen: {known}")
    return found
