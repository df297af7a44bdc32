"""Thrust-stand tables: PWM, battery voltage, rotor speed and thrust of settled operating points, one per row.

Headers differ; units stand in brackets behind the name (``vbat[V]``, ``thrust[g]``). What the load cell shows is
carried in newton as found, its zero included: nothing is subtracted. The rows have no time.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Flight, Provenance, Stream, make_stream
from ..units import SI_FACTOR
from .base import cell_faults, text_fault
from .cells import Grid, read_grid
from .header import header_of
from .names import listed, quantity_of
from .sheets import Sheet

_HEADER = re.compile(r"\s*([A-Za-z][\w. ]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")

_BASES = {
    "pwm": ("motor", "m"),
    "rpm": ("rpm", "m"),
    "vbat": ("battery", "vbat"),
    "weight": ("stand", "thrust"),
    "thrust": ("stand", "thrust"),
    "i": ("stand", "current"),
    "current": ("stand", "current"),
}
_DEFAULT_UNIT = {
    "pwm": "pwm16",
    "rpm": "rpm",
    "vbat": "V",
    "weight": "gram_force",
    "thrust": "gram_force",
    "i": "A",
    "current": "A",
}
_SPELLINGS = {
    "g": "gram_force",
    "gram": "gram_force",
    "grams": "gram_force",
    "gf": "gram_force",
    "kg": "kg_force",
    "rpm": "rpm",
    "pwm": "pwm16",
    "": "",
}
_ALLOWED = {
    "motor": ("pwm16", "1"),
    "rpm": ("rpm", "rad/s"),
    "vbat": ("V", "mV"),
    "thrust": ("gram_force", "kg_force", "N"),
    "current": ("A", "mA"),
}
_FACTORS = {**SI_FACTOR, "kg_force": 1e3 * SI_FACTOR["gram_force"], "mA": 1e-3}


@dataclass(frozen=True)
class Heading:
    """One recognised column: base is the name without number and unit, motor 0 means all four."""

    column: str
    base: str
    motor: int
    unit: str


def heading(column: str) -> Heading | None:
    """``rpm3`` -> rpm of motor 3, ``weight[g]`` -> thrust; None for a column of another meaning."""
    match = _HEADER.fullmatch(column)
    if match is None:
        return None
    name, unit = match[1].lower().replace(" ", "_"), (match[2] or "").strip()
    numbered = re.fullmatch(r"(pwm|rpm)_?(?:m|motor)?_?([1-4])", name)
    base, number = numbered.groups() if numbered else (name, "")
    if base not in _BASES or (base == "rpm" and not number):
        return None
    return Heading(column, base, int(number or 0), _SPELLINGS.get(unit.lower(), unit) or _DEFAULT_UNIT[base])


class ThrustStand:
    """Source ``stand``."""

    name = "stand"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        names = header_of(head)[0]
        return _like_a_stand(names) and not _of_a_flight(names)

    def why_not(self, head: bytes) -> str | None:
        names = header_of(head)[0]
        if not _like_a_stand(names) or not (flown := _of_a_flight(names)):
            return None
        return f"a thrust stand's rows are settled points without a time or a pose, and here is {listed(flown)}"

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        known = [h for h in map(heading, dict.fromkeys(header_of(data[: 1 << 16])[0])) if h]
        grid = read_grid(data, str(path), numeric={h.column for h in known})
        n = len(grid.lines)
        row = np.arange(n, dtype=float)
        silent = [h.column
                  for h in known
                  if h.base not in ("pwm", "vbat") and not grid.columns.get(h.column, np.ones(1)).any()]
        for column in silent:  # zero from the first row to the last: the sensor was not connected
            del grid.columns[column]
        streams, taken = _streams(grid, known, row, str(path))
        if "motor" not in streams:
            raise InputError(str(path), "no column of PWM holds a number", "a thrust stand table has one")
        streams |= _extra(grid, taken, row)
        span = (0.0, float(row[-1]))
        where = {c: s for s, stream in streams.items() for c in stream.columns}
        faults = cell_faults(grid, row, np.arange(n), where)
        faults += [
            text_fault("extra_column", "extra", (c,), f"column {c} holds text and was left out", span, 1.0, "columns")
            for c in grid.text
        ]
        faults += [
            text_fault("missing_column", "", (c,), f"column {c} shows 0 in every row and was left out", span, 1.0,
                       "columns")
            for c in silent
        ]
        faults += [text_fault("missing_column", "", (c,), f"column {c} has no value in it", span, 1.0, "columns")
                   for c in grid.empty]
        faults += [
            text_fault("extra_column", "", (c,), f"column {c} stands there more than once; the first was read", span,
                       1.0, "columns")
            for c in grid.repeated
        ]
        if grid.truncated:
            faults.append(text_fault("truncated", "", (), grid.truncated, (span[1], span[1]), 1.0, "rows"))
        notes = (*grid.notes, "rows have no time: their numbers stand in for seconds",
                 "thrust is what the load cell shows, zero offset included")
        return Flight(path.name, streams, {"family": None, "speed": None, "reference_speed_m_s": None, "kind": "stand"},
                      Provenance(str(path), "", self.name, findings=tuple(faults), notes=notes))


def _like_a_stand(names: list[str]) -> bool:
    bases = {h.base for h in map(heading, names) if h}
    return "pwm" in bases and bool(bases & {"rpm", "weight", "thrust"})


def _of_a_flight(names: list[str]) -> list[str]:
    """Columns of time and pose: a log of a flight may well hold PWM and rotor speed."""
    return [n for n in names if (match := _HEADER.fullmatch(n)) and quantity_of(match[1])[0] is not None]


def _streams(grid: Grid, known: list[Heading], row: np.ndarray, place: str) -> tuple[dict[str, Stream], set[str]]:
    """Streams motor, rpm, battery, stand, and the columns that went into them."""
    chosen: dict[str, dict[str, Heading]] = {}
    for head in known:
        if head.column not in grid.columns:
            continue
        stream, quantity = _BASES[head.base]
        allowed = _ALLOWED.get(stream) or _ALLOWED[quantity]
        if head.unit not in allowed:
            raise InputError(f"{place}: column {head.column}", f"unit {head.unit!r}",
                             f"known here: {', '.join(allowed)}")
        motors = (1, 2, 3, 4) if quantity == "m" and not head.motor else (head.motor,)
        for motor in motors:  # one PWM column drives all four motors
            chosen.setdefault(stream, {}).setdefault(f"m{motor}" if quantity == "m" else quantity, head)
    streams = {}
    for stream, heads in chosen.items():
        values = np.stack([grid.columns[h.column] * _FACTORS[h.unit] for h in heads.values()], axis=1)
        streams[stream] = make_stream(stream, row, values, tuple(heads), [h.column for h in heads.values()],
                                      samples=len(row))
    return streams, {h.column for heads in chosen.values() for h in heads.values()}


def _extra(grid: Grid, taken: set[str], row: np.ndarray) -> dict[str, Stream]:
    rest = [c for c in grid.columns if c not in taken]
    if not rest:
        return {}
    values = np.stack([grid.columns[c] for c in rest], axis=1)
    return {"extra": Stream(row, values, tuple(rest), tuple(rest), ("1",) * len(rest), samples=len(row))}
