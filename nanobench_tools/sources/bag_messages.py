"""Messages of a ROS 1 or ROS 2 bag through rosbags (extra ``rosbag``), topic by topic.

A ROS 2 bag is a folder; each of its storage files (.db3, .mcap) is a recording here, and needs no metadata.yaml.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import InputError, how_to_install
from .bag_repair import REPAIRS

SUFFIXES = {b"#ROSBAG V": ".bag", b"\x89MCAP0\r\n": ".mcap", b"SQLite format 3\x00": ".db3"}
"""First bytes -> the suffix by which rosbags tells the formats apart."""


@dataclass
class Bag:
    """``types`` of all topics; ``messages`` of the wanted ones as (receiving time [ns, Unix], message);
    ``broken`` says in a sentence that not all could be read; ``unreadable`` counts messages that could not be
    decoded."""

    types: dict[str, str]
    messages: dict[str, list[tuple[int, Any]]]
    broken: str = ""
    unreadable: dict[str, int] = field(default_factory=dict)


def suffix_of(head: bytes) -> str | None:
    """The suffix of a bag's format, by its first bytes; None for anything else."""
    return next((s for magic, s in SUFFIXES.items() if head.startswith(magic)), None)


def read_bag(data: bytes, place: str, wanted: Callable[[str, str], bool]) -> Bag:
    """Messages of the topics for which ``wanted(topic, type)``. Raises InputError at ``place`` when it is no bag.

    rosbags reads from files: the bytes go through a temporary one, so that archives are no special case and nothing is
    ever written beside the recording.
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
            return _read(path, wanted)
        except Exception as error:  # whatever damage makes of a parser
            first = _line(error, folder)
        mended = Path(folder) / f"mended{suffix}"
        try:
            REPAIRS[suffix or ""](data, path, mended)
            bag = _read(mended, wanted, tolerant=True)
        except Exception as error:
            raise InputError(place, f"cannot be read as a ROS bag ({first}; {_line(error, folder)})",
                             "take another copy of the file") from None
        if not any(bag.messages.values()) and not bag.types:
            raise InputError(place, f"cannot be read as a ROS bag ({first})", "take another copy of the file")
        bag.broken = f"the bag is not whole ({first}); read up to the break"
        return bag


def _line(error: Exception, folder: str) -> str:
    return " ".join(f"{type(error).__name__}: {error}".replace(folder, "").split())[:120]


def _read(path: Path, wanted: Callable[[str, str], bool], tolerant: bool = False) -> Bag:
    """``tolerant``: messages before a damaged part are kept."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        types = {c.topic: c.msgtype for c in sorted(reader.connections, key=lambda c: c.topic)}
        chosen = [c for c in reader.connections if wanted(c.topic, c.msgtype)]
        bag = Bag(types, {c.topic: [] for c in chosen})
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
            bag.messages[connection.topic].append((time_ns, message))
    return bag
