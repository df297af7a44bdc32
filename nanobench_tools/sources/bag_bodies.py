"""Messages that hold many poses, one per body (``/tf``, Crazyswarm2's ``/poses``, rigid bodies of mocap4r2, models of
Gazebo). They are split into one topic per body: ``/poses:cf1``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .bag_topics import WORLDS, words_of

INSIDE = {"pose": "geometry_msgs/msg/Pose", "transform": "geometry_msgs/msg/Transform"}
"""Type of that field."""
NAMES = ("child_frame_id", "rigid_body_name", "name", "subject_name", "object_name", "model_name")
POSES = {"pose": "geometry_msgs/msg/PoseStamped", "transform": "geometry_msgs/msg/TransformStamped"}
"""Field with the pose of an element -> type that a single message with it has."""


@dataclass(frozen=True)
class Listing:
    """Where a type holds its bodies: the field of the list, the name and the pose in an element; ``apart``: names and
    poses are two lists of the message."""

    field: str
    name: str
    pose: str
    apart: bool = False


@dataclass(frozen=True)
class Posed:
    """One body's pose as if it had been a separate message."""

    header: Any
    pose: Any = None
    transform: Any = None


Definitions = Mapping[str, tuple[Any, Sequence[tuple[str, tuple[int, Any]]]]]
"""rosbags' definitions: type -> (constants, [(field, (kind of node, ...))])."""


def listing_of(kind: str, definitions: Definitions) -> Listing | None:
    """How a message type lists bodies; None for any other type."""
    own = _fields(kind, definitions)
    for name, node in own.items():
        inner = _fields(_element(node), definitions)
        named = next((n for n in NAMES if n in inner), "")
        posed = next((p for p in POSES if inner.get(p, (0, ""))[1] == INSIDE[p]), "")
        if named and posed:
            return Listing(name, named, posed)
    if _element(own.get("name")) == "string" and _element(own.get("pose")) == "geometry_msgs/msg/Pose":
        return Listing("pose", "name", "pose", apart=True)
    return None


def _fields(kind: str, definitions: Definitions) -> dict[str, tuple[int, Any]]:
    return dict(definitions[kind][1]) if kind in definitions else {}


def _element(node: tuple[int, Any] | None) -> str:
    """The type of a list's elements, empty for what is no list."""
    if node is None or node[0] not in (3, 4):  # array, sequence
        return ""
    what, name = node[1][0]
    return str(name if what == 2 else name[0])


def bodies_in(message: Any, how: Listing) -> Iterator[tuple[str, str, Any]]:
    """(frame, name of the body, its pose as a separate message), of bodies in a frame of the world only."""
    header = getattr(message, "header", None)
    if how.apart:
        for name, pose in zip(message.name, message.pose, strict=False):
            yield "", str(name), Posed(header, pose=pose)
        return
    for element in getattr(message, how.field):
        of = getattr(element, "header", None) or header
        frame = str(getattr(of, "frame_id", "")).strip("/")
        name = str(getattr(element, how.name)).strip("/")
        if how.pose == "transform" and ((frame and not set(words_of(frame)) & WORLDS) or name.lower() in WORLDS):
            continue  # a part of a vehicle, or the world of another program
        yield frame, name, Posed(of, **{how.pose: getattr(element, how.pose)})
