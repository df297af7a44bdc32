"""Blackbox logs of Betaflight and INAV, as ``blackbox_decode`` writes them (CSV). The log itself is first converted.

Axes are those of the firmware: x forward, y left, z up; no attitude is logged. Units are those in the names of columns.
Without one, the gyro is compared with the set-point in deg/s, and the accelerometer with gravity before the take-off.
Motors of a quadrotor are back right, front right, back left, front left.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..flight import Flight
from .cells import Grid, read_grid
from .column_map import ColumnMap, Entry
from .header import header_of
from .sheets import Sheet
from .table import flight_of
from .units_as_written import unit_as_written

LOG = b"H Product:Blackbox flight data recorder"
TIME = "time (us)"
LONGEST_S = 1e5
"""No flight lasts a day: larger spans are no microseconds."""
COUNTS_PER_G = (512.0, 2048.0, 4096.0)
"""Accelerometers of these firmwares, at 1 g."""
STANDS_S = 0.3
"""From the first row: logs begin with the arming, on the ground."""
STANDS_SHARE = 0.06
"""Of gravity: how far the mean may be from it, and the standard deviation."""
TURNS_DEG_S = 30.0
"""Set-point from which on the gyro is compared with it."""
FEWEST_ROWS = 50
FOLLOWS = 0.7
"""Correlation of gyro and set-point from which on their ratio is a unit."""
GYRO_UNITS = (("deg/s", 1.0), ("rad/s", np.pi / 180.0), ("counts", 16.4))
"""Unit, and its number in 1 deg/s."""
RATIO = 1.5
"""A gyro follows its set-point to within this factor."""
DSHOT = (48.0, 2047.0)
PWM_US = (1000.0, 2000.0)
IDLE_US = 1200.0
"""Smallest PWM of an armed motor is below it."""
MOTORS = (1, 0, 2, 3)
"""Front right, back right, back left, front left."""
_UNIT = re.compile(r"(.*?)(?:\s*\(([^()]*)\))?")


class Blackbox:
    """Source ``blackbox``."""

    name = "blackbox"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if b"loopIteration" not in head[:4096] or b"\x00" in head[:512] or head.startswith(LOG):
            return False
        names = header_of(head)[0]
        return {"loopIteration", TIME} <= set(names)

    def why_not(self, head: bytes) -> str | None:
        return ("a blackbox log of Betaflight or INAV: convert it with `blackbox_decode --unit-rotation deg/s FILE` "
                "(blackbox-tools) and give the CSV" if head.startswith(LOG) else None)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        grid = read_grid(data, place, numeric={TIME}, time=TIME)
        stamps = grid.columns.get(TIME, np.zeros(0))
        stamps = stamps[np.isfinite(stamps)]
        if len(stamps) < 2 or not 0.0 < 1e-6 * np.ptp(stamps) < LONGEST_S:
            raise InputError(f"{place}: column {TIME}", "holds no microseconds of a flight",
                             "decode the log again with blackbox_decode")
        notes = ["axes of the firmware: x forward, y left, z up; no attitude was logged to check them by"]
        entries: list[Entry] = []
        for part in (_gyro, _acc, _motors):
            found, note = part(grid)
            entries += found
            notes += [note] if note else []
        entries += _battery(grid)
        if not entries:
            raise InputError(place, "a blackbox log without gyro, accelerometer, motors or battery that can be read",
                             "; ".join(notes[1:]) or "log them, too")
        columns = ColumnMap("the format", Entry("", "time", TIME, unit="us"), tuple(entries), {}, "")
        flight = flight_of(columns, grid, path, self.name)
        flight = replace(flight, provenance=replace(flight.provenance, notes=(*flight.provenance.notes, *notes)))
        return replace(flight, metadata={**flight.metadata, "clock": "seconds since boot", "read_as": notes})


def _columns(grid: Grid, stem: str, count: int) -> tuple[list[str], str]:
    """Names of the columns STEM[0] .. and the unit behind them; empty where one is missing."""
    found = {m[1]: (name, m[2] or "") for name in grid.columns if (m := _UNIT.fullmatch(name))}
    names = [found.get(f"{stem}[{k}]") for k in range(count)]
    there = [n for n in names if n is not None]
    return ([n for n, _ in there], there[0][1]) if len(there) == count else ([], "")


def _gyro(grid: Grid) -> tuple[list[Entry], str]:
    names, written = _columns(grid, "gyroADC", 3)
    if not names:
        return [], "no gyroADC"
    unit = unit_as_written(written) if written and written != "raw" else None
    note = ""
    if unit not in ("deg/s", "rad/s"):
        ratio = _follows(grid, names)
        fits = [(u, per) for u, per in GYRO_UNITS if ratio and per / RATIO < ratio < per * RATIO]
        if not fits:
            return [], ("gyro left out: neither its name nor its set-point shows the unit (blackbox_decode "
                        "--unit-rotation deg/s writes it)")
        unit = fits[0][0]
        note = f"gyro in {unit}: it follows its set-point in deg/s with the factor {ratio:.3g}"
    if unit == "counts":
        for name in names:
            grid.columns[name] = grid.columns[name] / GYRO_UNITS[2][1]
        unit = "deg/s"
    return [Entry("imu", f"gyro_{a}", name, unit=unit) for a, name in zip("xyz", names, strict=True)], note


def _follows(grid: Grid, names: list[str]) -> float:
    """Gyro over set-point, of roll and pitch while they turn; 0 where they do not follow it."""
    wanted = _columns(grid, "setpoint", 3)[0] or _columns(grid, "axisRate", 3)[0]
    if not wanted:
        return 0.0
    turn = np.concatenate([grid.columns[n] for n in names[:2]])
    want = np.concatenate([grid.columns[n] for n in wanted[:2]])
    rows = np.isfinite(turn) & np.isfinite(want) & (np.abs(want) > TURNS_DEG_S)
    turn, want = turn[rows], want[rows]
    if len(turn) < FEWEST_ROWS or not (power := float((turn**2).sum())):
        return 0.0
    shared = float((turn * want).sum())
    return shared / float((want**2).sum()) if shared > FOLLOWS * np.sqrt(power * float((want**2).sum())) else 0.0


def _acc(grid: Grid) -> tuple[list[Entry], str]:
    names, written = _columns(grid, "accSmooth", 3)
    if not names:
        return [], "no accSmooth"
    unit = unit_as_written(written) if written and written != "raw" else None
    if unit in ("g", "m/s^2"):
        return [Entry("imu", f"acc_{a}", name, unit=unit) for a, name in zip("xyz", names, strict=True)], ""
    time_s = 1e-6 * (grid.columns[TIME] - grid.columns[TIME][np.isfinite(grid.columns[TIME])][0])
    size = np.linalg.norm(np.stack([grid.columns[n] for n in names]), axis=0)[time_s < STANDS_S]
    size = size[np.isfinite(size)]
    per_g = next((c for c in COUNTS_PER_G if len(size) and abs(size.mean() / c - 1.0) < STANDS_SHARE
                  and size.std() < STANDS_SHARE * c), None)
    if per_g is None:
        return [], ("accelerometer left out: neither its name nor the first rows at rest show the unit "
                    "(blackbox_decode --unit-acceleration m/s2 writes it)")
    for name in names:
        grid.columns[name] = grid.columns[name] / per_g
    return [Entry("imu", f"acc_{a}", name, unit="g") for a, name in zip("xyz", names, strict=True)], (
        f"accelerometer with {per_g:.0f} counts per g: {size.mean():.0f} at rest before the take-off")


def _motors(grid: Grid) -> tuple[list[Entry], str]:
    names, _ = _columns(grid, "motor", 4)
    if not names or _columns(grid, "motor", 5)[0]:
        return [], "motors left out: no quadrotor" if names else "no motors"
    values = np.concatenate([grid.columns[n] for n in names])
    values = values[values > 0.0]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    if DSHOT[0] <= low < 0.9 * PWM_US[0] and high <= DSHOT[1]:
        span, kind = DSHOT, "DShot"
    elif 0.9 * PWM_US[0] <= low <= IDLE_US and high <= PWM_US[1] + 1.0:
        span, kind = PWM_US, "PWM in us"
    else:
        return [], f"motors left out: {low:.4g} to {high:.4g} is neither DShot nor PWM in us"
    for name in names:
        grid.columns[name] = np.clip((grid.columns[name] - span[0]) / (span[1] - span[0]), 0.0, 1.0)
    return [Entry("motor", f"m{k}", names[at]) for k, at in enumerate(MOTORS, start=1)], (
        f"motors: {kind} as a share of its range; their numbers are taken for those of a quadrotor X of the firmware")


def _battery(grid: Grid) -> list[Entry]:
    found = {m[1]: (name, unit_as_written(m[2] or "")) for name in grid.columns if (m := _UNIT.fullmatch(name))}
    entries = []
    for quantity, names, units in (("vbat", ("vbatLatest", "vbat"), ("V", "mV")),
                                   ("current", ("amperageLatest", "amperage"), ("A", "mA"))):
        name, unit = next((found[n] for n in names if n in found), ("", None))
        if unit in units:
            entries.append(Entry("battery", quantity, name, unit=str(unit)))
    return entries if entries and entries[0].quantity == "vbat" else []
