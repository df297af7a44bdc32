"""Real conditions with a label each: the change of a vehicle, folder by folder, opened after the verdicts.

    schema = "nanobench-labels/1"
    [folders.normal]
    cause = "normal"
    [folders.cut_3]
    cause = "propeller"
    motors = [3]
    cut_mm = [[1.0, 1.0]]
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nanobench_tools.errors import InputError

SCHEMA = "nanobench-labels/1"
NORMAL = "normal"
CAUSES = (NORMAL, "propeller", "weight", "slung", "tape", "vehicle", "wind", "battery", "mass")
MOTORS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Label:
    """cause: one of CAUSES; motors: numbers 1..4 of those it is at; cut_mm: per motor what each blade lost; mass_g."""

    cause: str
    motors: tuple[int, ...] = ()
    cut_mm: tuple[tuple[float, ...], ...] = ()
    mass_g: float | None = None


def read_labels(path: Path) -> dict[str, Label]:
    """{folder: label}. InputError naming the file and the key for anything that is no label."""
    try:
        with open(path, "rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror or error})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"is not TOML ({error})") from error
    if content.get("schema") != SCHEMA:
        raise InputError(str(path), f"schema is {content.get('schema')!r}", f"{SCHEMA!r} is needed here")
    folders = content.get("folders")
    if not isinstance(folders, dict) or not folders:
        raise InputError(str(path), "has no [folders.NAME] table")
    labels = {name: _label(f"{path}: [folders.{name}]", entry) for name, entry in folders.items()}
    if not any(label.cause == NORMAL for label in labels.values()):
        raise InputError(str(path), f"no folder has cause {NORMAL!r}", "changes are judged against it")
    return labels


def _label(place: str, entry: Any) -> Label:
    if not isinstance(entry, dict):
        raise InputError(place, "is no table")
    unknown = sorted(set(entry) - {"cause", "motors", "cut_mm", "mass_g"})
    if unknown:
        raise InputError(place, f"unknown key {unknown[0]!r}", "known: cause, motors, cut_mm, mass_g")
    if entry.get("cause") not in CAUSES:
        raise InputError(place, f"cause is {entry.get('cause')!r}", f"known: {', '.join(CAUSES)}")
    motors, cuts, mass = entry.get("motors", []), entry.get("cut_mm", []), entry.get("mass_g")
    if not isinstance(motors, list) or any(m not in MOTORS or isinstance(m, bool) for m in motors):
        raise InputError(place, f"motors is {motors!r}", "a list of numbers 1 to 4 is needed")
    if not isinstance(cuts, list) or any(not isinstance(c, list) or not all(map(_number, c)) for c in cuts):
        raise InputError(place, f"cut_mm is {cuts!r}", "a list with one list of millimetres per motor is needed")
    if mass is not None and not _number(mass):
        raise InputError(place, f"mass_g is {mass!r}", "a number is needed")
    return Label(entry["cause"], tuple(motors), tuple(tuple(map(float, c)) for c in cuts), mass)


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


