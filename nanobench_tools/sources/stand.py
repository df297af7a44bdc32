"""Thrust-stand tables: PWM, battery voltage, rotor speed and thrust of settled operating points, one per row.

Headers differ; units are in brackets behind the name (``vbat[V]``, ``thrust[g]``). What the load cell shows is carried
in newton as found, its zero included: nothing is subtracted. The rows have no time.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..flight import Flight, Provenance, Stream, make_stream
from ..units import PWM_FULL_SCALE, to_si
from .base import cell_faults, text_fault
from .cells import Grid, read_grid
from .header import header_of
from .known import Known, ecosystem
from .names import listed, quantity_of
from .sheets import Sheet
from .units_as_written import unit_as_written

_HEADER = re.compile(r"\s*([A-Za-z][\w. ]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_UNIT_BEHIND = re.compile(r"(.+)_(percent|pct|us|g|gf|grams|kgf|kg|n|lbf|v|mv|a|ma)")

_ONE_OF_TWO = re.compile(r"(?i)powertrain 1\s*-?\s*")
"""Before the names of a motor, where a thrust stand can hold two."""
_PER_CENT = re.compile(rb"(?<=\d) ?%(?=\"?\s*[,;\t\r\n])")
_NUMBERED = re.compile(r"([a-z]+)_?(?:m|motor)?_?(\d)")
_PULSED = ("us", "%")
_FORCES = {"g": "gram_force", "kg": "kgf"}
_ALLOWED = {
    "motor": ("pwm16", "1", "%", "pulse_us"),
    "rpm": ("rpm", "rad/s"),
    "vbat": ("V", "mV"),
    "thrust": ("gram_force", "kgf", "N", "mN", "lbf"),
    "current": ("A", "mA"),
}
FULL_SHARE, FULL_PERCENT = 1.0, 100.0
PULSES = (900.0, 2100.0)
"""What may be the length of a pulse in us (1000 to 2000, and trims)."""
LEAST_FULL_US = 1200.0
"""A series of pulses reaches at least this length."""
LARGEST_COMMAND = {"pulse_us": PULSES, "%": (5.0, 105.0), "1": (0.05, 1.05),
                   "pwm16": (0.05 * PWM_FULL_SCALE, 1.05 * PWM_FULL_SCALE)}
"""Unit of a command -> what the largest one of a series may be: less turns no motor, more than full there is not."""
THRUST_PER_WATT = (0.002, 0.6)
"""N per W of electrical power, between a brushed toy at full command and a large slow propeller (some 0.02 and 0.2)."""
PROPELLERS = (5e-4, 20.0)
"""T^5 n^2 / (rho P^4) of one propeller: thrust in N, speed in 1/s, electrical power in W. It is C_T^5 / C_P^4 for
propellers of all sizes, or f^4 / (0.41 C_T). C_T is 0.04 to 0.25. The figure of merit times the efficiency of motor and
controller, f, is 0.1 to 0.75. A brushed Crazyflie has 0.017, a 10 inch propeller some 0.5."""
POLE_PAIRS = (3, 21)
"""Of brushless motors that turn propellers: the electrical speed is so many times the speed."""
TIP_M_S = (30.0, 300.0)
"""Speed of the tips of propellers at strong thrust: toys have 40 to 70, others up to 0.8 of the speed of sound."""
THRUST_COEFFICIENT = (0.04, 0.25)
"""C_T = T / (rho n^2 D^4) of propellers."""
AIR_KG_M3 = 1.2
MOST_V = 120.0
"""Batteries of the largest drones have 60 V."""
SLOW_RPM = 3000.0
"""Propellers up to 30 cm turn faster at full command. Motors with 6 or 7 pairs of poles have 700 to 3000 eRPM/100."""
STRONG = 0.5
"""Share of the largest thrust from which a row is used to compare thrust with power."""


@dataclass(frozen=True)
class Heading:
    """One recognised column: the stream and quantities it gives (one PWM may drive all four motors); unit empty where
    the numbers have to show it; ``stated``: the file says the unit."""

    column: str
    stream: str
    quantities: tuple[str, ...]
    unit: str
    stated: bool = False


@functools.cache
def _names() -> dict[str, tuple[Known, ...]]:
    """Name in a thrust-stand table -> stream and quantities."""
    found: dict[str, tuple[Known, ...]] = {}
    for known in ecosystem("stand").names:
        found[known.name] = (*found.get(known.name, ()), known)
    return found


def heading(column: str) -> Heading | None:
    """``rpm3`` -> speed of motor 3, ``weight[g]`` -> thrust, ``ESC signal (us)`` -> the command of one motor; None for
    a column of another meaning."""
    match = _HEADER.fullmatch(_ONE_OF_TWO.sub("", column))
    if match is None:
        return None
    name, unit = match[1].lower().replace(" ", "_"), (match[2] or "").strip()
    if numbered := _NUMBERED.fullmatch(name):
        name = "".join(numbered.groups())
    if name not in _names() and not unit and (behind := _UNIT_BEHIND.fullmatch(name)):
        name, unit = behind.groups()
    known = _names().get(name)
    if known is None:
        return None
    stream, quantities = known[0].stream, tuple(k.quantity for k in known)
    written = unit_as_written(unit) or unit
    if quantities == ("thrust",) and unit.lower() in _FORCES:
        written = _FORCES[unit.lower()]
    if stream == "motor" and written in _PULSED:
        written, quantities = {"us": "pulse_us"}.get(written, written), quantities[:1]
    if unit.lower() == "pwm":
        written = "pwm16"
    return Heading(column, stream, quantities, written or known[0].unit, bool(unit))


def _in_unit(head: Heading, unit: str) -> Heading:
    """The heading in the unit of a row of units, where its name states none."""
    found = heading(f"{head.column} [{unit}]") if unit and not head.stated else None
    return head if found is None else replace(found, column=head.column)


class ThrustStand:
    """Source ``stand``."""

    name = "stand"
    version = 5

    def recognises(self, path: Path, head: bytes) -> bool:
        names = header_of(head)[0]
        return is_a_stand(names) and not _of_a_flight(names)

    def why_not(self, head: bytes) -> str | None:
        names = header_of(head)[0]
        if not is_a_stand(names) or not (flown := _of_a_flight(names)):
            return None
        return f"rows of thrust-stand tables are settled points without a time or a pose, and here is {listed(flown)}"

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        data = _PER_CENT.sub(b"", data)  # 40% in a cell
        known = [h for h in map(heading, dict.fromkeys(header_of(data[: 1 << 16])[0])) if h]
        grid = read_grid(data, str(path), numeric={h.column for h in known})
        known = [_in_unit(h, grid.units.get(h.column, "")) for h in known]
        n = len(grid.lines)
        row, timed = _times(grid, n)
        silent = [h.column
                  for h in known
                  if h.stream not in ("motor", "battery") and not grid.columns.get(h.column, np.ones(1)).any()]
        for column in silent:  # zero from the first row to the last: the sensor was not connected
            del grid.columns[column]
        streams, taken = _streams(grid, known, row, str(path))
        if "motor" not in streams:
            raise InputError(str(path), "no column of PWM holds a number", "a thrust stand table has one")
        streams |= _extra(grid, taken, row)
        _check_propeller(streams, str(path))
        _check_tips(streams, str(path))
        _check_slow(known, streams, str(path))
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
            text_fault("extra_column", "", (c,), f"column {c} appears more than once; the first was read", span,
                       1.0, "columns")
            for c in grid.repeated
        ]
        if grid.truncated:
            faults.append(text_fault("truncated", "", (), grid.truncated, (span[1], span[1]), 1.0, "rows"))
        motors = len(streams["motor"].quantities)
        notes = (*grid.notes, *(() if timed else ("rows have no time in seconds: their numbers replace it",)),
                 "thrust is what the load cell shows, zero offset included, of "
                 + ("one motor" if motors == 1 else "all motors together"))
        metadata: dict[str, Any] = {"family": None, "speed": None, "reference_speed_m_s": None,
                                    "kind": "stand"}
        if motors > len(set(streams["motor"].columns)):
            metadata["read_as"] = [f"column {streams['motor'].columns[0]} commands {motors} motors, and the load cell "
                                   f"adds up their thrust; a column in % or us commands one"]
        provenance = Provenance(str(path), "", self.name, findings=tuple(faults), notes=notes)
        return Flight(path.name, streams, metadata, provenance)


def _times(grid: Grid, n: int) -> tuple[np.ndarray, bool]:
    """(n,) s of each row from the first, and whether the file has it: in a column of time that names its unit and
    increases. Otherwise the number of the row."""
    for column, values in grid.columns.items():
        match = _HEADER.fullmatch(column)
        unit = unit_as_written(match[2] or "") if match and match[1].lower() in ("time", "t") else None
        if unit in ("s", "ms", "us") and np.isfinite(values).all() and (np.diff(values) > 0.0).all():
            return to_si(values - values[0], unit), True
    return np.arange(n, dtype=float), False


def is_a_stand(names: Sequence[str]) -> bool:
    """Whether the columns are those of a stand file: a command, and a thrust or a rotor speed."""
    known = [h for h in map(heading, names) if h]
    return any(h.stream == "motor" for h in known) and any(h.stream == "rpm" or "thrust" in h.quantities for h in known)


def _of_a_flight(names: list[str]) -> list[str]:
    """Columns of time and pose: a log of a flight may well hold PWM and rotor speed. A table with a time, the command
    of one motor and a force with its unit is a stand file, too."""
    flown = [(n, quantity_of(match[1])[0]) for n in names
             if (match := _HEADER.fullmatch(n)) and quantity_of(match[1])[0] is not None]
    known = [h for h in map(heading, names) if h]
    ramp = {q for h in known if h.stream == "motor" for q in h.quantities} == {"m1"} and any(
        h.stated for h in known if "thrust" in h.quantities)
    return [n for n, quantity in flown if not (ramp and quantity == "time")]


def _streams(grid: Grid, known: list[Heading], row: np.ndarray, place: str) -> tuple[dict[str, Stream], set[str]]:
    """Streams (motor, rpm, battery, stand) and the columns that they come from."""
    chosen: dict[str, dict[str, Heading]] = {}
    for head in known:
        if head.column not in grid.columns:
            continue
        stream = head.stream
        allowed = _ALLOWED.get(stream) or _ALLOWED[head.quantities[0]]
        if not head.unit:
            if stream == "stand":
                raise InputError(f"{place}: column {head.column}", "a thrust without a unit: g or N?",
                                 f"write it behind the name: {head.column} (g), (N) or (kgf)")
            head = replace(head, unit=_share(grid.columns[head.column], head.column, place))
        if stream == "motor" and not head.stated and _pulses(grid.columns[head.column]):
            head = replace(head, unit="pulse_us", quantities=head.quantities[:1])
        if head.unit in LARGEST_COMMAND and stream == "motor":
            _check_command(grid.columns[head.column], head, place)
        if head.unit not in allowed:
            raise InputError(f"{place}: column {head.column}", f"unit {head.unit!r}",
                             f"known here: {', '.join(allowed)}")
        for quantity in head.quantities:
            chosen.setdefault(stream, {}).setdefault(quantity, head)
    if len(rotors := chosen.get("rpm", {})) > 1 and [*chosen.get("motor", {})] == ["m1"]:
        chosen["motor"] = dict.fromkeys(rotors, chosen["motor"]["m1"])  # one command of all that turn
    _check_voltage(chosen.get("battery", {}), grid, place)
    streams = {}
    for stream, heads in chosen.items():
        values = np.stack([to_si(grid.columns[h.column], h.unit) for h in heads.values()], axis=1)
        streams[stream] = make_stream(stream, row, values, tuple(heads), [h.column for h in heads.values()],
                                      samples=len(row))
    _check_power(streams, place)
    if "motor" in streams:
        _check_sign(streams, place)
    return streams, {h.column for heads in chosen.values() for h in heads.values()}


def _check_voltage(heads: Mapping[str, Heading], grid: Grid, place: str) -> None:
    """InputError for a voltage of no battery in a column that states no unit."""
    head = heads.get("vbat")
    top = 0.0 if head is None or head.stated else float(np.nanmax(to_si(grid.columns[head.column], head.unit)))
    if head is not None and top > MOST_V:
        raise InputError(f"{place}: column {head.column}", f"reaches {top:.4g}: no voltage of a battery",
                         f"write its unit behind the name: {head.column} (mV)")


def _check_slow(known: Sequence[Heading], streams: Mapping[str, Stream], place: str) -> None:
    """InputError for speeds under the bare name rpm that may be eRPM/100."""
    columns = [h.column for h in known if h.stream == "rpm" and not h.stated and h.column.lower().startswith("rpm")]
    if "rpm" not in streams or set(streams["rpm"].columns) - set(columns):
        return
    top = float(np.nanmax(streams["rpm"].values, initial=0.0)) / to_si(1.0, "rpm")
    if 0.0 < top < SLOW_RPM:
        raise InputError(f"{place}: column {columns[0]}", f"reaches {top:.4g}: rpm of a large propeller, or eRPM/100 "
                         "of an ESC?", "name it rotation speed (rpm). Or multiply eRPM/100 by 100, and divide by the "
                         "pairs of poles")


def _check_command(values: np.ndarray, head: Heading, place: str) -> None:
    """InputError where the largest command of a series is not possible in its unit."""
    low, high = LARGEST_COMMAND[head.unit]
    top = float(np.nanmax(values, initial=0.0))
    if not low <= top <= high:
        raise InputError(f"{place}: column {head.column}",
                         f"reaches {top:.4g}, and in {head.unit} a series reaches {low:.4g} to {high:.4g}",
                         "write its unit behind the name: throttle (%), (us) or (1)")


def _check_power(streams: dict[str, Stream], place: str) -> None:
    """InputError where thrust, voltage and current are of no propeller: one of them is in another unit."""
    cell, battery = streams.get("stand"), streams.get("battery")
    if cell is None or battery is None or not {"thrust", "current"} <= set(cell.quantities) or "vbat" not in battery:
        return
    thrust, power = cell["thrust"], cell["current"] * battery["vbat"]
    strong = np.isfinite(thrust) & np.isfinite(power) & (power > 0.0) & (
        thrust > 0.5 * np.nanmax(thrust, initial=0.0))
    low, high = THRUST_PER_WATT
    if strong.any() and not low <= (per_watt := float(np.median(thrust[strong] / power[strong]))) <= high:
        columns = [*(cell.columns[cell.quantities.index(q)] for q in ("thrust", "current")), *battery.columns]
        raise InputError(f"{place}: columns {', '.join(columns)}",
                         f"{per_watt:.3g} N per W of electrical power; propellers give {low:g} to {high:g}",
                         "one of them is in another unit: write it behind the name, as in thrust (gf)")


def _check_sign(streams: dict[str, Stream], place: str) -> None:
    """InputError where the load cell counts down as the command grows."""
    cell = streams.get("stand")
    if cell is None or "thrust" not in cell.quantities:
        return
    command, thrust = streams["motor"].values.max(axis=1), cell["thrust"]
    known = np.isfinite(command) & np.isfinite(thrust)
    strong = known & (command > STRONG * np.nanmax(command, initial=0.0))
    weak = known & (command <= 0.1 * np.nanmax(command, initial=0.0))
    rest = float(np.median(thrust[weak])) if weak.any() else 0.0
    if strong.any() and float(np.median(thrust[strong])) < min(rest, 0.0):
        column = cell.columns[cell.quantities.index("thrust")]
        raise InputError(f"{place}: column {column}",
                         f"falls to {np.median(thrust[strong]):.3g} N as the command grows: the load cell counts "
                         "downwards",
                         "write the column with the other sign")


def _check_propeller(streams: dict[str, Stream], place: str) -> None:
    """InputError where no propeller of any size has the thrust at its power and speed: a unit is another one."""
    cell, battery = streams.get("stand"), streams.get("battery")
    speed, column, (fewest, most) = _speed(streams)
    if (speed is None or cell is None or battery is None or not {"thrust", "current"} <= set(cell.quantities)
            or "vbat" not in battery):
        return
    motors = len(streams["motor"].quantities)
    thrust, power = cell["thrust"] / motors, cell["current"] * battery["vbat"] / motors
    rows = np.isfinite(thrust * power * speed) & (power > 0.0) & (speed > 0.0) & (
        thrust > STRONG * np.nanmax(thrust, initial=0.0))
    if not rows.any():
        return
    scale = AIR_KG_M3 * power[rows] ** 4 / speed[rows] ** 2
    low, high = PROPELLERS[0] * fewest ** 2, PROPELLERS[1] * most ** 2
    if not low <= float(np.median(thrust[rows] ** 5 / scale)) <= high:
        columns = [*(cell.columns[cell.quantities.index(q)] for q in ("thrust", "current")), *battery.columns, column]
        ends = (float(np.median((bound * scale) ** 0.2)) for bound in (low, high))
        raise InputError(f"{place}: columns {', '.join(columns)}",
                         f"{np.median(thrust[rows]):.3g} N per motor where propellers with this power and speed give "
                         f"{' to '.join(f'{end:.2g}' for end in ends)} N",
                         "one of them is in another unit: write it behind the name, as in thrust (gf)")


def _check_tips(streams: dict[str, Stream], place: str) -> None:
    """InputError where no propeller of any size has the thrust at its speed: tips too slow, or faster than sound."""
    cell = streams.get("stand")
    if cell is None or "thrust" not in cell.quantities or "rpm" not in streams:
        return
    thrust = cell["thrust"] / len(streams["motor"].quantities)
    speed = np.abs(streams["rpm"].values).mean(axis=1) / (2.0 * np.pi)
    rows = np.isfinite(thrust * speed) & (speed > 0.0) & (thrust > STRONG * np.nanmax(thrust, initial=0.0))
    if not rows.any():
        return
    low, high = (np.pi * float(np.median(thrust[rows] * speed[rows] ** 2 / (AIR_KG_M3 * c))) ** 0.25
                 for c in reversed(THRUST_COEFFICIENT))
    if low > TIP_M_S[1] or high < TIP_M_S[0]:
        columns = [cell.columns[cell.quantities.index("thrust")], *dict.fromkeys(streams["rpm"].columns)]
        raise InputError(f"{place}: columns {', '.join(columns)}",
                         f"propellers with this thrust and speed have tips at {low:.3g} to {high:.3g} m/s, and real "
                         f"ones have {TIP_M_S[0]:g} to {TIP_M_S[1]:g}",
                         "one of them is in another unit: write it behind the name, as in thrust (gf), rpm (rad/s)")


def _speed(streams: dict[str, Stream]) -> tuple[np.ndarray | None, str, tuple[int, int]]:
    """Rotor speed [1/s], its first column, and how many times too high it is (an electrical speed)."""
    if "rpm" in streams:
        return streams["rpm"].values.mean(axis=1) / (2.0 * np.pi), streams["rpm"].columns[0], (1, 1)
    extra = streams.get("extra")
    if extra is None:
        return None, "", (1, 1)
    for i, column in enumerate(extra.columns):
        match = _HEADER.fullmatch(column)
        if match and match[1].lower().endswith("electrical speed") and (match[2] or "").strip().lower() == "rpm":
            return extra.values[:, i] / 60.0, column, POLE_PAIRS
    return None, "", (1, 1)


def _pulses(values: np.ndarray) -> bool:
    """Whether all numbers may be lengths of pulses in us, to the largest."""
    return bool(PULSES[0] <= np.nanmin(values) and np.nanmax(values) <= PULSES[1]
                and np.nanmax(values) > LEAST_FULL_US)


def _share(values: np.ndarray, column: str, place: str) -> str:
    """The unit of a throttle that states none: a share, per cent, or pulses."""
    top, low = float(np.nanmax(values)), float(np.nanmin(values))
    if low >= 0.0 and top <= FULL_SHARE:
        return "1"
    if low >= 0.0 and FULL_SHARE < top <= FULL_PERCENT:
        return "%"
    if _pulses(values):
        return "pulse_us"
    raise InputError(f"{place}: column {column}", f"values from {low:g} to {top:g}: a share, per cent or pulses?",
                     f"write its unit behind the name: {column} (%), (us) or (1)")


def _extra(grid: Grid, taken: set[str], row: np.ndarray) -> dict[str, Stream]:
    rest = [c for c in grid.columns if c not in taken]
    if not rest:
        return {}
    values = np.stack([grid.columns[c] for c in rest], axis=1)
    return {"extra": Stream(row, values, tuple(rest), tuple(rest), ("1",) * len(rest), samples=len(row))}
