"""Names that other programs give to columns and variables, with meaning and unit: one TOML file an ecosystem.

A file has ``title``, ``origin`` (where the names and units are documented) and entries ``[[names]]``:

``name``     As the ecosystem writes it. ``{x,y,z}`` makes one name of each, with the same place in ``is``.
             Braces in ``is`` alone are one name for several quantities.

``is``       ``stream.quantity`` of the vocabulary, ``time``, or absent where the vocabulary has no place for it.

``what``     A few words on a quantity that the vocabulary lacks. With both ``what`` and ``is``, the column alone does
             not give the quantity: tables omit it. Only a reader of the whole message uses it.

``unit``     As ``units`` knows it: default "1"; "" where the numbers have to show it.

``sign``, ``offset``, ``invalid``    Factor 1 or -1, offset in SI, and the value of an invalid reading.

``topic``    Of PX4 and ROS: the message, or list of messages, of this name. If several messages give one stream,
             the first in the file is the best.

``frame``    Axes of the numbers (``axes``), where they are not ours.

``generic``  True where others write the same name for numbers in other units: the unit is assumed.

``plain``    True where others call columns the same: the name alone does not show the ecosystem.

Several names may give one quantity: the first of them in the file counts.
"""

from __future__ import annotations

import functools
import itertools
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...errors import UsageError
from ...flight import STREAM_QUANTITIES
from ...units import factor

FOLDER = Path(__file__).parent
_BRACES = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True)
class Known:
    """One name: ``value_SI = sign * factor(unit) * value + offset``. ``stream`` is empty for a time and for what the
    vocabulary has no place for; then ``quantity`` is "time" or empty. With a ``what`` the column alone does not give
    the quantity."""

    name: str
    stream: str = ""
    quantity: str = ""
    unit: str = "1"
    sign: float = 1.0
    offset: float = 0.0
    what: str = ""
    topic: str = ""
    frame: str = ""
    plain: bool = False
    generic: bool = False
    invalid: float | None = None

    @property
    def scale(self) -> float:
        return self.sign * factor(self.unit)


@dataclass(frozen=True)
class Ecosystem:
    """``names`` in the order of the file; ``timeless``: its rows are settled points without a time; ``shown_by_own``:
    a name that only it has is needed, and common ones do not show it."""

    key: str
    title: str
    origin: str
    names: tuple[Known, ...]
    timeless: bool = False
    shown_by_own: bool = False

    @functools.cached_property
    def streams(self) -> Mapping[str, Mapping[str, tuple[Known, ...]]]:
        """stream -> quantity, in the order of the vocabulary -> names that can give it, best first."""
        found: dict[str, dict[str, tuple[Known, ...]]] = {}
        for known in self.names:
            if known.stream and not known.what:
                quantities = found.setdefault(known.stream, {})
                quantities[known.quantity] = (*quantities.get(known.quantity, ()), known)
        return {stream: {q: quantities[q] for q in STREAM_QUANTITIES[stream] if q in quantities}
                for stream, quantities in found.items()}

    @functools.cached_property
    def topics(self) -> Mapping[str, tuple[Known, ...]]:
        """Message -> its names that give a quantity, in the order of the file."""
        found: dict[str, tuple[Known, ...]] = {}
        for known in self.names:
            if known.topic and known.stream:
                found[known.topic] = (*found.get(known.topic, ()), known)
        return found

    def assign(self, there: Iterable[str]) -> dict[str, dict[str, Known]]:
        """Which of the names that are there becomes which quantity: stream -> quantity -> Known. Each is used once."""
        left = set(there)
        chosen: dict[str, dict[str, Known]] = {}
        for stream, quantities in self.streams.items():
            for quantity, options in quantities.items():
                found = next((o for o in options if o.name in left), None)
                if found is not None:
                    left.discard(found.name)
                    chosen.setdefault(stream, {})[quantity] = found
        return chosen


@functools.cache
def ecosystem(key: str) -> Ecosystem:
    """The ecosystem of one file, by the file's name. UsageError if it is missing."""
    path = FOLDER / f"{key}.toml"
    if not path.is_file():
        raise UsageError(f"unknown ecosystem {key!r}; known: {', '.join(keys())}")
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    names = tuple(itertools.chain.from_iterable(map(_expanded, content["names"])))
    return Ecosystem(key, content["title"], content["origin"], names, content.get("timeless", False),
                     content.get("shown_by_own", False))


def keys() -> tuple[str, ...]:
    """Names of the ecosystems, sorted."""
    return tuple(sorted(p.stem for p in FOLDER.glob("*.toml")))


def _expanded(entry: Mapping[str, object]) -> Iterable[Known]:
    """One Known for every alternative in braces, and for every message."""
    name, meaning, topic = str(entry["name"]), str(entry.get("is", "")), entry.get("topic", "")
    rest = {k: v for k, v in entry.items() if k not in ("name", "is", "topic")}
    groups = [match.split(",") for match in _BRACES.findall(name)]
    targets = [match.split(",") for match in _BRACES.findall(meaning)]
    groups += targets[len(groups):]
    for message in topic if isinstance(topic, list) else [topic]:
        for places in itertools.product(*(range(len(group)) for group in groups)):
            spelled = _filled(name, groups, places)
            stream, _, quantity = _filled(meaning, targets, places).rpartition(".")
            yield Known(spelled, stream, quantity, topic=str(message), **rest)  # type: ignore[arg-type]


def _filled(text: str, groups: list[list[str]], places: Iterable[int]) -> str:
    """``text`` with one alternative of each of its braces."""
    picked = iter([group[k] for group, k in zip(groups, places, strict=False)])
    return _BRACES.sub(lambda _: next(picked), text)
