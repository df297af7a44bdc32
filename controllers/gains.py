"""Tunable gains and weights: the declaration by a controller, and their TOML file.

A tunable controller has ``tunable`` (name -> ``Gain``) and takes ``gains`` (name -> value) when it is made. Other
gains keep their value. A user's ``module:Class`` may do the same.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nanobench_tools.errors import InputError, UsageError

SCHEMA = "nanobench-gains/1"


@dataclass(frozen=True)
class Gain:
    """value: the present one; low, high: limits of the search, on a scale of ratios."""

    value: float
    low: float
    high: float
    unit: str = "1"


def around(value: float, unit: str, factor: float = 3.0) -> Gain:
    """Searched between value / factor and value * factor."""
    return Gain(value, value / factor, value * factor, unit)


def whole(tunable: Mapping[str, Gain], gains: Mapping[str, float] | None, who: str) -> dict[str, float]:
    """Every gain's value. Raises UsageError for a name that ``who`` does not have and for an invalid value."""
    found = {name: gain.value for name, gain in tunable.items()}
    for name, value in (gains or {}).items():
        if name not in tunable:
            raise UsageError(f"{who} has no gain {name!r}; it has {', '.join(tunable) or 'none'}")
        if not (isinstance(value, (int, float)) and math.isfinite(value) and value > 0.0):
            raise UsageError(f"{who}: gain {name} is {value!r}; give a number above 0")
        found[name] = float(value)
    return found


def read_gains(path: Path) -> tuple[str, dict[str, float]]:
    """(controller, gains) of a file that ``dumps`` made. Raises InputError."""
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(str(path), f"{error}", "give a file that nanobench tune wrote") from error
    name, gains = found.get("controller"), found.get("gains")
    if found.get("schema") != SCHEMA or not isinstance(name, str) or not isinstance(gains, dict):
        raise InputError(str(path), "is no table of gains", f'it needs schema = "{SCHEMA}", controller and [gains]')
    bad = [key for key, value in gains.items() if isinstance(value, bool) or not isinstance(value, (int, float))]
    if bad:
        raise InputError(str(path), f"gain {bad[0]} is {gains[bad[0]]!r}", "give a number")
    return name, {key: float(value) for key, value in gains.items()}


def reports_better(path: Path) -> bool:
    """Whether the file, which ``read_gains`` takes, says that its gains were shown to be better."""
    return bool(tomllib.loads(path.read_text(encoding="utf-8")).get("better", True))


def dumps(controller: str, gains: Mapping[str, float], tunable: Mapping[str, Gain], report: Mapping[str, Any]) -> str:
    """TOML of gains; ``report``: strings, numbers and lists of them on how they were found."""
    head = {"schema": SCHEMA, "controller": controller, **report}
    lines = [*(f"{name} = {_text(value)}" for name, value in head.items()), "", "[gains]"]
    lines += [f"{name} = {value:.6g} # {tunable[name].unit}, before: {tunable[name].value:g}"
              for name, value in gains.items()]
    return "\n".join(lines) + "\n"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_text, value))}]"
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'
