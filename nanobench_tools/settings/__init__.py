"""The one place for numbers that were set by looking at data: ``values/AREA.toml``.

A module asks for its constants by key, once, when it is imported::

    FALL_M_S = number("audit.crashes.fall_m_s")

The key is AREA.MODULE.NAME. An entry has the value, its unit, its meaning and its origin. The origin is an entry of
``recordings.toml``, with kinds and number of the recordings or made-up cases. ``nanobench settings`` prints them.
Functions compiled by Numba get settings as arguments: Numba keeps machine code by the date of the source file, and a
TOML file is none.

Numbers of another origin (firmware, a format, an equation, a limit for safety) stay where they are used.
"""

import functools
import tomllib
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError

FOLDER = Path(__file__).parent
KEYS = {"value", "does", "set_on"}
"""Of an entry; ``unit`` (1 without it) and ``how`` (by hand, likelihood, median ...) are optional."""


@dataclass(frozen=True)
class Setting:
    """``key``: AREA.MODULE.NAME. ``value``: a number, text, or tuples and dictionaries of them, in ``unit``.
    ``set_on``: name in ``recordings.toml``. ``how``: how the value was found there, where that is known."""

    key: str
    value: Any
    unit: str
    does: str
    set_on: str
    how: str = ""

    @property
    def area(self) -> str:
        return self.key.partition(".")[0]


@dataclass(frozen=True)
class Recordings:
    """What a number was set on. ``kind``: ``real``, ``SYNTHETIC``, ``both`` or ``unknown``; ``n``: how many, as text
    with what is counted, empty where nobody wrote it down; ``what``: in a sentence."""

    name: str
    kind: str
    n: str
    what: str


@dataclass(frozen=True)
class Model:
    """A file of related numbers, below the installed packages: its description, and the data it was set on (name in
    ``recordings.toml``)."""

    file: str
    does: str
    set_on: str


def areas() -> tuple[str, ...]:
    """Names of the files in ``values``."""
    return tuple(sorted(path.stem for path in (FOLDER / "values").glob("*.toml")))


@functools.cache
def of_area(area: str) -> dict[str, Setting]:
    """All settings of an area by key; InputError naming key and file for an unknown area or an entry that is not
    whole."""
    path = FOLDER / "values" / f"{area}.toml"
    if not path.is_file():
        raise InputError(f"area {area!r}", "no settings of that name", f"there are {', '.join(areas())}")
    found = {}
    for module, entries in tomllib.loads(path.read_text(encoding="utf-8")).items():
        for name, entry in entries.items():
            key = f"{area}.{module}.{name}"
            if not isinstance(entry, dict) or not KEYS <= set(entry) <= KEYS | {"unit", "how"}:
                raise InputError(f"{path.name}: {key}", f"has to have {', '.join(sorted(KEYS))}")
            found[key] = Setting(key, _frozen(entry["value"]), entry.get("unit", "1"), entry["does"], entry["set_on"],
                                 entry.get("how", ""))
    return found


def everything() -> dict[str, Setting]:
    """All settings of all areas by key."""
    return {key: entry for area in areas() for key, entry in of_area(area).items()}


@functools.cache
def recordings() -> dict[str, Recordings]:
    """What settings were set on, by name."""
    entries = tomllib.loads((FOLDER / "recordings.toml").read_text(encoding="utf-8"))
    return {name: Recordings(name, entry["kind"], entry["n"], entry["what"]) for name, entry in entries.items()}


@functools.cache
def models() -> tuple[Model, ...]:
    """Whole models that are separate files."""
    entries = tomllib.loads((FOLDER / "models.toml").read_text(encoding="utf-8"))
    return tuple(Model(file, entry["does"], entry["set_on"]) for file, entry in entries.items())


def setting(key: str) -> Any:
    """The value of ``key``; lists are tuples, dictionaries are the caller's own. InputError for an unknown key."""
    try:
        return deepcopy(of_area(key.partition(".")[0])[key].value)
    except KeyError:
        raise InputError(f"setting {key!r}", "does not exist", "nanobench settings lists those that do") from None


def number(key: str) -> float:
    """The value of ``key`` as a float; TypeError if it is none."""
    value = setting(key)
    if type(value) is not float:
        raise TypeError(f"setting {key!r} is no float: {value!r}")
    return value


def count(key: str) -> int:
    """The value of ``key`` as an int; TypeError if it is none."""
    value = setting(key)
    if type(value) is not int:
        raise TypeError(f"setting {key!r} is no int: {value!r}")
    return value


def _frozen(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_frozen(item) for item in value)
    if isinstance(value, dict):
        return {key: _frozen(item) for key, item in value.items()}
    return value
