"""Tables of a plan in TOML (campaign, fleet): each mistake is one line with file, key and advice."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError, did_you_mean
from ..practice.references import PathSpec
from .fly.flight_plan import chosen_path

PATH_KEYS = ("trajectory", "speed", "size", "seconds")


def read_plan(path: Path, known: Collection[str]) -> TomlTable:
    """The whole file. Raises InputError if it cannot be read, is no TOML or has an unknown key."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(str(path), f"is not TOML: {error}", "see the example in docs/flying.md") from None
    return TomlTable(str(path), content, known)


class TomlTable:
    """One table; ``place`` names it in messages. A key without a default is required."""

    def __init__(self, place: str, content: Mapping[str, Any], known: Collection[str]) -> None:
        self.place, self._content = place, content
        for key in content:
            if key not in known:
                raise InputError(place, f"unknown key {key!r}",
                                 f"{did_you_mean(key, known)}known: {', '.join(known)}")

    def __contains__(self, key: str) -> bool:
        return key in self._content

    def text(self, key: str, default: str | None = None) -> str:
        """A string."""
        found = self._content.get(key, default)
        if not isinstance(found, str) or not found:
            raise self._wrong(key, f"give {key} as a text in quotes")
        return found

    def optional_text(self, key: str) -> str | None:
        """A string; None without the key."""
        return self.text(key) if key in self else None

    def number(self, key: str, default: float | None = None, least: float = -math.inf, most: float = math.inf) -> float:
        """A number from ``least`` to ``most``."""
        found = self._content.get(key, default)
        if not _is_number(found) or not least <= found <= most:
            raise self._wrong(key, f"give a number from {least:g} to {most:g}")
        return float(found)

    def optional_number(self, key: str, least: float, most: float) -> float | None:
        """A number from ``least`` to ``most``; None without the key."""
        return self.number(key, None, least, most) if key in self else None

    def _wrong(self, key: str, advice: str) -> InputError:
        found = f"{key} = {self._content[key]!r}" if key in self else f"{key} is missing"
        return InputError(self.place, found, advice)

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """So many numbers."""
        found = self._content.get(key, default)
        if not isinstance(found, list | tuple) or len(found) != count or not all(map(_is_number, found)):
            raise self._wrong(key, f"give {count} numbers, such as {key} = [{', '.join(['0.0'] * count)}]")
        return tuple(float(value) for value in found)

    def file(self, key: str) -> Path | None:
        """A file that must exist, relative to the working directory; None without the key."""
        found = self.optional_text(key)
        if found is None:
            return None
        if not Path(found).is_file():
            raise InputError(self.place, f"{key} = {found!r}: there is no such file", "check the path")
        return Path(found)

    def tables(self, key: str, known: Collection[str]) -> list[TomlTable]:
        """The tables [[key]]; their places have numbers from 1."""
        found = self._content.get(key, [])
        if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
            raise InputError(self.place, f"{key} is no list of tables", f"write [[{key}]] above each")
        return [TomlTable(f"{self.place}: {key} {i}", entry, known) for i, entry in enumerate(found, 1)]

    def table(self, key: str, known: Collection[str]) -> TomlTable:
        """The table [key]; empty if it is missing."""
        found = self._content.get(key, {})
        if not isinstance(found, dict):
            raise InputError(self.place, f"{key} is no table", f"write [{key}] above its keys")
        return TomlTable(f"{self.place}: {key}", found, known)

    def path(self) -> PathSpec:
        """The path that PATH_KEYS describe, with the bounds of the command line."""
        name = self.text("trajectory", "figure_eight")
        speed = self.optional_number("speed", 0.05, 5.0)
        size = self.optional_number("size", 0.05, 20.0)
        seconds = self.optional_number("seconds", 4.0, 600.0)
        try:
            return chosen_path(name, speed, size, seconds)
        except UsageError as error:
            raise InputError(self.place, str(error)) from None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
