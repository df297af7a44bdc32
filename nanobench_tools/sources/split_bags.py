"""Bag files that are parts of one recording: rosbag2 folders of several files, and files that a recorder numbered.

A metadata.yaml of rosbag2 lists the parts. Without one, numbered names alone prove nothing (``flight_0.bag`` and
``flight_1.bag`` may be two flights). The messages of a part must begin where those of the part before end.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

SUFFIXES = (".bag", ".db3", ".mcap")
METADATA = "metadata.yaml"
LONGEST_PAUSE_S = 1.0
"""A recorder opens the next file while messages wait; a person takes longer to start the next recording."""
LONGEST_OVERLAP_S = 1.0
"""Messages of one topic may be written after those of another that were received later."""

_NUMBERED = re.compile(r"(.*?)_?(?:\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d)?_(\d+)")
"""Name before the number; ``rosbag record --split`` also puts the time at which each part began before it."""

SpanOf = Callable[[Path], tuple[float, float] | None]
"""First and last time of receiving in a file [s, Unix]; None where none can be read."""


@dataclass(frozen=True)
class Parts:
    """Files of one recording in the order of time; ``lost`` names those that a metadata.yaml lists and that are not
    there."""

    paths: tuple[Path, ...]
    lost: tuple[str, ...] = ()


def parts_of(bags: Sequence[Path], span_of: SpanOf) -> dict[Path, Parts]:
    """First file -> the parts of its recording; every one of ``bags`` is in one of them."""
    found: dict[Path, Parts] = {}
    left: list[Path] = []
    for folder in dict.fromkeys(path.parent for path in bags):
        there = {path.name: path for path in bags if path.parent == folder}
        listed = _listed(folder / METADATA)
        known = tuple(there.pop(name) for name in listed if name in there)
        if known:
            found[known[0]] = Parts(known, tuple(name for name in listed if not (folder / name).exists()))
        left += there.values()
    for part in _numbered(left, span_of):
        found[part[0]] = Parts(part)
    return found


def _listed(metadata: Path) -> list[str]:
    """Names of the parts in a metadata.yaml of rosbag2; empty without one."""
    try:
        content = yaml.safe_load(metadata.read_bytes())["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(str(name)).name for name in content]
    except (OSError, yaml.YAMLError, UnicodeDecodeError, LookupError, TypeError):
        return []


def _numbered(bags: Sequence[Path], span_of: SpanOf) -> list[tuple[Path, ...]]:
    """Files whose numbers and times follow each other, together; every other file alone."""
    series: dict[tuple[Path, str, str], list[tuple[int, Path]]] = {}
    alone: list[tuple[Path, ...]] = []
    for path in bags:
        match = _NUMBERED.fullmatch(path.stem) if path.suffix in SUFFIXES else None
        if match is None:
            alone.append((path,))
        else:
            series.setdefault((path.parent, match[1], path.suffix), []).append((int(match[2]), path))
    for numbered in series.values():
        numbered.sort()
        spans = {path: span_of(path) for _, path in numbered} if len(numbered) > 1 else {}
        together = [numbered[0][1]]
        for (before, last), (number, path) in itertools.pairwise(numbered):
            ends, begins = spans[last], spans[path]
            if ends and begins and number == before + 1 and (
                    -LONGEST_OVERLAP_S <= begins[0] - ends[1] <= LONGEST_PAUSE_S):
                together.append(path)
            else:
                alone.append(tuple(together))
                together = [path]
        alone.append(tuple(together))
    return alone
