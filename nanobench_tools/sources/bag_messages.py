"""Messages of a ROS 1 or ROS 2 bag through rosbags (extra ``rosbag``), topic by topic.

Each storage file (.bag, .db3, .mcap) is read alone and needs no metadata.yaml; the files of one recording that was
split are put together.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import InputError, how_to_install
from .bag_bodies import POSES, Listing, bodies_in, listing_of
from .bag_definitions import DEFINITIONS
from .bag_repair import REPAIRS, is_shorter_than_its_header
from .bag_topics import Topic

SUFFIXES = {b"#ROSBAG V": ".bag", b"\x89MCAP0\r\n": ".mcap", b"SQLite format 3\x00": ".db3"}
"""First bytes -> the suffix by which rosbags distinguishes the formats."""


@dataclass
class Bag:
    """``topics`` of all kinds, a list of bodies taken apart into one topic per body; ``messages`` of the wanted ones as
    (receiving time [ns, Unix], message); ``broken`` is a sentence where not all could be read; ``unreadable`` counts
    messages that could not be decoded; ``undefined``: topics with an unknown message type that the bag does not
    define; ``assumed``: those that are read by a definition of ours; ``listed``: how a topic lists bodies."""

    topics: dict[str, Topic] = field(default_factory=dict)
    messages: dict[str, list[tuple[int, Any]]] = field(default_factory=dict)
    broken: str = ""
    unreadable: dict[str, int] = field(default_factory=dict)
    undefined: dict[str, str] = field(default_factory=dict)
    assumed: dict[str, str] = field(default_factory=dict)
    listed: dict[str, Listing] = field(default_factory=dict)

    def moved_m(self) -> dict[str, float]:
        """How far each topic of poses moves."""
        found = {}
        for name, messages in self.messages.items():
            places = [p for _, m in messages[:: max(len(messages) // 200, 1)] if (p := place_of(m)) is not None]
            if places:
                found[name] = float(np.linalg.norm(np.nanmax(places, axis=0) - np.nanmin(places, axis=0)))
        return found


def place_of(message: Any) -> tuple[float, float, float] | None:
    """Where a message of poses says that something is [m]; None for any other message."""
    pose = getattr(message, "pose", None)
    pose = getattr(pose, "pose", pose)
    place = getattr(pose, "position", None) or getattr(getattr(message, "transform", None), "translation", None) or (
        getattr(message, "point", None))
    return None if place is None else (float(place.x), float(place.y), float(place.z))


def suffix_of(head: bytes) -> str | None:
    """The suffix of a bag's format, by its first bytes; None for anything else."""
    return next((s for magic, s in SUFFIXES.items() if head.startswith(magic)), None)


Found = TypeVar("Found")
Wanted = Callable[[str, str], bool]
"""Whether messages of a topic of this type are read. A list of bodies is of type ``LIST``."""
LIST = "list of bodies"


def read_bags(parts: Sequence[bytes], place: str, wanted: Wanted) -> Bag:
    """Messages of the files of one recording, in the order of time; see ``read_bag``. A file that cannot be read costs
    the others nothing, and ``broken`` reports it."""
    whole = Bag()
    bags: list[Bag] = []
    refused: list[InputError] = []
    broken: list[str] = []
    for number, data in enumerate(parts, start=1):
        which = f"file {number} of {len(parts)}: " if len(parts) > 1 else ""
        try:
            bag = read_bag(data, place, wanted)
        except InputError as error:
            refused.append(error)
            broken.append(f"{which}{error.found}")
            continue
        bags.append(bag)
        if bag.broken:
            broken.append(f"{which}{bag.broken}")
    if not bags and refused:
        raise refused[0]
    for bag in bags:
        for name, messages in bag.messages.items():
            whole.messages.setdefault(name, []).extend(messages)
        for name, count in bag.unreadable.items():
            whole.unreadable[name] = whole.unreadable.get(name, 0) + count
        whole.topics |= bag.topics
        whole.undefined |= bag.undefined
        whole.assumed |= bag.assumed
        whole.listed |= bag.listed
    whole.broken = "; ".join(broken)
    for messages in whole.messages.values():
        messages.sort(key=lambda received: received[0])
    return whole


def read_bag(data: bytes, place: str, wanted: Wanted) -> Bag:
    """Messages of the topics for which ``wanted(topic, type)``. Raises InputError at ``place`` when it is no bag."""
    bag, bag_broken = _read_or_mended(data, place, lambda path, tolerant: _read(path, wanted, tolerant))
    if bag_broken and not any(bag.messages.values()) and not bag.topics:
        raise InputError(place, f"cannot be read as a ROS bag ({bag_broken})", "take another copy of the file")
    if bag_broken or is_shorter_than_its_header(data):
        bag.broken = f"the bag is not whole ({bag_broken or 'its last page is missing'}); read up to the break"
    return bag


def span_of(data: bytes, place: str) -> tuple[float, float] | None:
    """First and last time of receiving [s, Unix] of all messages; None for a bag without any. Raises InputError at
    ``place`` when it is no bag."""
    start_ns, end_ns = _read_or_mended(data, place, _span_ns)[0]
    return (start_ns * 1e-9, end_ns * 1e-9) if start_ns <= end_ns else None


def _span_ns(path: Path, tolerant: bool) -> tuple[int, int]:
    from rosbags.highlevel import AnyReader

    with AnyReader([path], default_typestore=_types(path.suffix)) as reader:
        return reader.start_time, reader.end_time


def _read_or_mended(data: bytes, place: str, use: Callable[[Path, bool], Found]) -> tuple[Found, str]:
    """``use(path, tolerant)`` of the bag or, where that fails, of its whole part; why it failed, else empty.

    rosbags reads from files, so the bytes go through a temporary one. Archives are thus no special case, and the
    folder of the recording is never written to.
    """
    try:
        import rosbags.highlevel as _  # noqa: F401
    except ImportError:
        raise InputError(place, "a ROS bag is read through rosbags", how_to_install("rosbag")) from None
    suffix = suffix_of(data)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"bag{suffix}"
        path.write_bytes(data)
        try:
            return use(path, False), ""
        except Exception as error:  # damage can make a parser raise anything
            first = _line(error, folder)
        mended = Path(folder) / f"mended{suffix}"
        try:
            REPAIRS[suffix or ""](data, path, mended)
            return use(mended, True), first
        except Exception as error:
            raise InputError(place, f"cannot be read as a ROS bag ({first}; {_line(error, folder)})",
                             "take another copy of the file") from None


def _line(error: Exception, folder: str) -> str:
    return " ".join(f"{type(error).__name__}: {error}".replace(folder, "").split())[:120]


def _read(path: Path, wanted: Wanted, tolerant: bool = False) -> Bag:
    """``tolerant``: messages before a damaged part are kept."""
    from rosbags.highlevel import AnyReader

    bag = Bag()
    with AnyReader([path], default_typestore=_types(path.suffix)) as reader:
        chosen = []
        for c in sorted(reader.connections, key=lambda c: str(c.topic)):
            if not isinstance(c.topic, str) or not isinstance(c.msgtype, str):
                raise ValueError("a topic without a name")
            listing = listing_of(c.msgtype, reader.typestore.fielddefs)
            bag.topics[c.topic] = Topic(c.topic, c.msgtype)
            if c.msgtype in DEFINITIONS and not c.msgdef.data:
                bag.assumed[c.topic] = c.msgtype
            if c.msgtype not in reader.typestore.fielddefs:
                bag.undefined[c.topic] = c.msgtype
            elif wanted(c.topic, LIST if listing else c.msgtype):
                chosen.append(c)
                if listing:
                    bag.listed[c.topic] = listing
                else:
                    bag.messages[c.topic] = []
        if not chosen:
            return bag
        found = iter(reader.messages(chosen))
        while True:
            try:
                connection, time_ns, raw = next(found)
            except StopIteration:
                break
            except Exception:
                if tolerant and any(bag.messages.values()):
                    break
                raise
            try:
                message = reader.deserialize(raw, connection.msgtype)
            except Exception:  # one damaged message must not take the others with it
                bag.unreadable[connection.topic] = bag.unreadable.get(connection.topic, 0) + 1
                continue
            if (listing := bag.listed.get(connection.topic)) is None:
                bag.messages[connection.topic].append((time_ns, message))
                continue
            for frame, body, pose in bodies_in(message, listing):
                bag.messages.setdefault(_topic_of(bag, connection.topic, frame, body, listing), []).append(
                    (time_ns, pose))
    return bag


def _topic_of(bag: Bag, topic: str, frame: str, body: str, listing: Listing) -> str:
    """The topic of one body in one frame, known to the bag from now on."""
    name = f"{topic}:{body}"
    if (known := bag.topics.get(name)) is not None and known.frame != frame:
        name = f"{topic}:{frame}/{body}"  # one body in two worlds: never mixed
    bag.topics.setdefault(name, Topic(name, POSES[listing.pose], body, frame))
    return name


def _types(suffix: str) -> Any:
    """Message types that a bag may hold without defining them."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if suffix == ".bag":
        return get_typestore(Stores.ROS1_NOETIC)
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store
