"""Tables that ``ulog2csv`` writes of a PX4 log: one a topic, ``LOG_TOPIC_INSTANCE.csv``.

The topic is in the name of the file alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import InputError
from . import ulog_motors
from .cells import read_grid
from .header import header_of
from .members import Gathered
from .payload import head
from .ulog_topics import PX4, Topic, topic_of, topics_of

TIME = "timestamp"
_NAMED = re.compile(rf"(?:(.*)_)?({'|'.join((*topics_of(), *ulog_motors.TOPICS))})_(\d+)")
_ANY = re.compile(r".*_\d+")


def _stem(path: Path) -> str:
    return path.name.partition(".")[0]


def is_a_topic(path: Path, start: bytes) -> bool:
    """Whether a file is the table of a topic that is read, by its name and its names of columns."""
    match = _NAMED.fullmatch(_stem(path))
    if match is None or not start.startswith(TIME.encode()):
        return False
    names = header_of(start)[0]
    return any(known.name in names for known in PX4.topics[match[2]])


def gathered(paths: Sequence[Path]) -> list[Gathered]:
    """The tables of each log in one folder. Those of topics that are not read are left out in silence."""
    logs: dict[tuple[Path, str], dict[str, Path]] = {}
    for path in paths:
        if match := _NAMED.fullmatch(_stem(path)):
            logs.setdefault((path.parent, match[1] or ""), {})[path.name] = path
    found = []
    for (folder, log), files in logs.items():
        first = next(iter(files.values()))
        others = {p.name: p for p in sorted(folder.glob("*.csv*")) if p.is_file() and _ANY.fullmatch(_stem(p))
                  and _NAMED.fullmatch(_stem(p)) is None and p.name.startswith(log)
                  and head(p).startswith(f"{TIME},".encode())}
        found.append(Gathered(first, folder / log if log and len(files) > 1 else first, {**files, **others}))
    return found


def topics_in(place: Path, members: Mapping[str, bytes]) -> dict[str, list[Topic]]:
    """Instances of every topic by name, in the order of their numbers."""
    found: dict[str, list[Topic]] = {}
    for name in sorted(members):
        if match := _NAMED.fullmatch(_stem(Path(name))):
            grid = read_grid(members[name], str(place.with_name(name)), time=TIME)
            if (topic := topic_of(match[2], grid.columns)) is not None:
                found.setdefault(match[2], []).append(topic)
    if not found:
        raise InputError(str(place), "no table of a topic in it", "write them again: ulog2csv LOG.ulg")
    return found
