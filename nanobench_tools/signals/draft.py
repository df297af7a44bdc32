"""Draft of a column map: columns with their units and evidence, notes and questions, and the map as TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..sources.column_map import SCHEMA, TABLE
from ..units import to_si

QUATERNION = ("qx", "qy", "qz", "qw")
Key = tuple[str, str]
TIME: Key = ("", "time")
PITCH_ASSUMED = ": taken as positive nose down"
"""Words of the note on a pitch whose sign nothing shows."""


@dataclass(frozen=True)
class Drafted:
    """One column of the map. ``status``: known, shown or assumed; ``why``: the evidence in words; ``invalid``: the cell
    that means no reading; ``add``: column and unit of what is added to a time."""

    column: str
    unit: str
    status: str = "assumed"
    why: str = ""
    sign: int = 1
    offset: float = 0.0
    invalid: float | None = None
    add: tuple[str, str] | None = None


@dataclass
class Draft:
    """State of a draft: columns by (stream, quantity), frames by stream, columns left out, and questions.

    ``likely``: frames of an ecosystem that is only guessed."""

    mapped: dict[Key, Drafted] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)
    likely: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)

    def columns(self, stream: str, names: Sequence[str]) -> list[Key]:
        return [(stream, q) for q in names if (stream, q) in self.mapped]

    def ask(self, keys: Sequence[Key], question: str) -> None:
        """Leaves columns out, and asks about them."""
        columns = [self.mapped.pop(key).column for key in keys if key in self.mapped]
        text = f"{', '.join(columns)}: {question}"
        self.questions.append(text)
        self.unknown.update(dict.fromkeys(columns, question))

    def si(self, keys: Sequence[Key], values: Mapping[str, np.ndarray]) -> np.ndarray:
        """(n, k) of drafted columns in SI."""
        drafted = [self.mapped[key] for key in keys]
        return np.stack([d.sign * to_si(values[d.column], d.unit) + d.offset for d in drafted], axis=1)

    def set_unit(self, keys: Sequence[Key], unit: str, why: str, status: str = "shown") -> None:
        """Their unit, and what shows it."""
        for key in keys:
            self.mapped[key] = replace(self.mapped[key], unit=unit, status=status, why=why)
        if status == "shown" and keys:
            self.notes.append(f"{', '.join(self.mapped[k].column for k in keys)}: {unit}, since {why}")

    def open(self, keys: Sequence[Key]) -> list[Key]:
        """Those whose unit is assumed."""
        return [key for key in keys if self.mapped[key].status == "assumed"]

    def open_or_shown(self, keys: Sequence[Key]) -> list[Key]:
        """Those whose unit neither the header nor an ecosystem states."""
        return [key for key in keys if self.mapped[key].status != "known"]

    def confirm(self, keys: Sequence[Key], why: str) -> None:
        """Keeps assumed units, with what speaks for them."""
        for key in self.open(keys):
            self.mapped[key] = replace(self.mapped[key], why=why)


@dataclass(frozen=True)
class ColumnDraft:
    """``text``: the map as TOML; ``mapped``: {(stream, quantity): (column, unit)}, time as ("", "time"); ``unknown``:
    {column: why nothing was guessed}; ``notes``: findings from the numbers, and points to check; ``questions``: what
    only the user knows; ``status``: {column: known, shown or assumed}."""

    text: str
    mapped: Mapping[Key, tuple[str, str]]
    unknown: Mapping[str, str]
    notes: tuple[str, ...]
    questions: tuple[str, ...] = ()
    status: Mapping[str, str] = field(default_factory=dict)


def as_toml(path: Path, draft: Draft) -> str:
    """The column map, with the evidence of each line as a comment."""
    def quoted(text: str) -> str:
        return json.dumps(text, ensure_ascii=not text.isprintable())

    def comment(text: str) -> str:
        return "# " + "".join(c if c.isprintable() else "?" for c in text)

    def entry(d: Drafted) -> str:
        parts = [f"column = {quoted(d.column)}", f"unit = {quoted(d.unit)}"]
        parts += ["sign = -1"] * (d.sign < 0) + [f"offset = {d.offset}"] * bool(d.offset)
        parts += [] if d.invalid is None else [f"invalid = {d.invalid:g}"]
        parts += [] if d.add is None else [f"add = {{column = {quoted(d.add[0])}, unit = {quoted(d.add[1])}}}"]
        parts += ["assumed = true"] * (d.status == "assumed")
        return f"{{{', '.join(parts)}}}"

    lines = [comment(f"Drafted from {path.name}: check every line."), *(comment(note) for note in draft.notes),
             *(comment(f"Question: {q}") for q in draft.questions),
             f'schema = "{SCHEMA}"', f"time = {entry(draft.mapped[TIME])}"]
    for stream in dict.fromkeys(stream for stream, _ in draft.mapped if stream):
        lines += ["", f"[streams.{stream}]"]
        if stream in draft.frames:
            lines.append(f"frame = {quoted(draft.frames[stream])}")
        for (s, quantity), d in draft.mapped.items():
            if s == stream:
                told = f"{d.status}: {d.why}" if d.why else d.status
                lines.append(f"{quantity} = {entry(d)}  {comment(told)}")
    if draft.unknown:
        lines += ["", "# Not guessed:", *(comment(f"{column}: {why}") for column, why in draft.unknown.items())]
    return "\n".join(lines) + "\n"


def joined_toml(texts: Mapping[str, str]) -> str:
    """One map of several tables, from the maps of each by name of the file; what all names begin and end with is *."""
    lines = [f'schema = "{SCHEMA}"']
    for name, pattern in zip(texts, _patterns(list(texts)), strict=True):
        own = [line for line in texts[name].splitlines() if not line.startswith("schema = ")]
        lines += ["", f"[[{TABLE}]]", f"file = {json.dumps(pattern)}",
                  *(re.sub(r"^\[streams\.", f"[{TABLE}.streams.", line) for line in own)]
    return "\n".join(lines) + "\n"


def _patterns(names: list[str]) -> list[str]:
    """``flight1_imu.csv`` and ``flight1_mocap.csv`` -> ``*_imu.csv`` and ``*_mocap.csv``."""
    parts = [re.split(r"([_\- ])", name.partition(".")[0]) for name in names]
    if min(map(len, parts)) > 2 and len({p[0] for p in parts}) == 1:
        return ["*" + name[len(p[0]):] for name, p in zip(names, parts, strict=True)]
    if min(map(len, parts)) > 2 and len({p[-1] for p in parts}) == 1:
        return ["".join(p[:-1]) + "*" + name[len("".join(p)):] for name, p in zip(names, parts, strict=True)]
    return names
