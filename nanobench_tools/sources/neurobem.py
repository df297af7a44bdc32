"""NeuroBEM (CSV): flights of a racing quadrotor of 0.77 kg at 400 Hz, already filtered, with rotor speeds and battery.

Rates and accelerations were fused from motion capture and the inertial sensor. They are no measurement apart from the
poses, so the rates belong to ``mocap`` and the acceleration is kept apart. ``mot 1`` to ``mot 4`` are back right, front
right, back left, front left. The velocity is in the body.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Fault, Flight, Stream
from ..units import GRAVITY_M_S2
from .bag_twist import BETTER, error_m_s
from .base import text_fault
from .cells import Grid, read_grid
from .column_map import ColumnMap, Entry
from .header import header_of
from .sheets import Sheet
from .table import flight_of
from .timestamps import not_seconds
from .tum_layout import NORM_TOLERANCE

NEEDED = {"t", "ang vel x", "vel x", "pos x", "pos z", "mot 1", "dmot 1", "vbat"}
QUATERNIONS = ("quat {}", "q{}")
"""Names of the files, and those of the data set's description."""
MOTORS = ("mot 2", "mot 1", "mot 3", "mot 4")
"""Front right, back right, back left, front left."""
ROTOR_RAD_S = (100.0, 6000.0)
"""Median speed of a rotor in flight."""
FITS = 0.25
"""Of the speed: error up to which a velocity is that of the path."""
GRAVITY_SHARE = 0.8
"""Share of gravity along z of the world that shows a specific force, on average; its rest is what shows none."""
VELOCITY, ACC = ("vx", "vy", "vz"), ("ax", "ay", "az")


class NeuroBem:
    """Source ``neurobem``."""

    name = "neurobem"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        if b"dmot 1" not in head or b"\x00" in head[:512]:
            return False
        names = set(header_of(head)[0])
        return names >= NEEDED and _quaternion(names) is not None

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        grid = read_grid(data, place, numeric=NEEDED, time="t")
        if (why := not_seconds(grid.columns.get("t", np.zeros(0)))) is not None:
            raise InputError(f"{place}: column t", why, "the format has seconds; read it with a column map")
        q = _quaternion(set(grid.columns))
        if q is None or "pos x" not in grid.columns:
            raise InputError(place, "has no poses", "take another copy of the file")
        faults = unit_length(grid, q)
        notes = _rotors(grid)
        flight = flight_of(_map(grid, q), grid, path, self.name)
        mocap, note = _velocity(flight["mocap"])
        notes += [note, "mocap has filtered rates: motion capture and the inertial sensor together"]
        streams = {**flight.streams, "mocap": mocap}
        if (acc := [f"acc {a}" for a in "xyz"]) and all(a in grid.columns for a in acc):
            kept = np.isfinite(grid.columns["t"])
            values = np.stack([grid.columns[a][kept] for a in acc], axis=1)
            streams["extra_acceleration"] = Stream(_since(grid, kept), values, tuple(acc), ACC, ("m/s^2",) * 3,
                                                   rate_hz=mocap.rate_hz)
            notes.append("extra_acceleration: body axes, filtered, not independent of the poses; " + _kind(
                grid, q, np.stack([grid.columns[a] for a in acc], axis=1)))
        provenance = replace(flight.provenance, notes=(*flight.provenance.notes, *notes),
                             findings=(*flight.provenance.findings, *faults))
        return replace(flight, streams=streams, provenance=provenance,
                       metadata={**flight.metadata, "read_as": notes})


def unit_length(grid: Grid, names: list[str]) -> list[Fault]:
    """Marks quaternions without unit length as missing, with a finding."""
    length = np.linalg.norm(np.stack([grid.columns[q] for q in names]), axis=0)
    wrong = np.flatnonzero(np.abs(length - 1.0) > NORM_TOLERANCE)
    for q in names:
        grid.columns[q] = np.array(grid.columns[q])
        grid.columns[q][wrong] = np.nan
    if not len(wrong):
        return []
    time_s = _since(grid, np.ones(len(length), dtype=bool))
    span = (float(np.nan_to_num(time_s[wrong[0]])), float(np.nan_to_num(time_s[wrong[-1]])))
    return [text_fault("bad_cell", "", tuple(names), f"{len(wrong)} quaternions without unit length, read as missing, "
                       f"the first in row {wrong[0] + 1}", span, float(len(wrong)), "rows")]


def _quaternion(names: set[str]) -> list[str] | None:
    return next((found for form in QUATERNIONS if set(found := [form.format(a) for a in "xyzw"]) <= names), None)


def _since(grid: Grid, kept: np.ndarray) -> np.ndarray:
    time_s = grid.columns["t"]
    return np.asarray(time_s[kept] - time_s[np.isfinite(time_s)][0])


def _rotors(grid: Grid) -> list[str]:
    """Leaves rotor speeds out that are in another unit."""
    there = [m for m in MOTORS if m in grid.columns]
    middle = float(np.nanmedian(np.concatenate([grid.columns[m] for m in there]))) if there else 0.0
    if not there or ROTOR_RAD_S[0] <= middle <= ROTOR_RAD_S[1]:
        return ["rpm: mot 1 to mot 4 in our order of motors"] * bool(there)
    for name in there:
        del grid.columns[name]
        grid.bad.pop(name, None)
    return [f"rpm left out: a median of {middle:.3g} rad/s is no rotor speed"]


def _map(grid: Grid, q: list[str]) -> ColumnMap:
    entries = [Entry("mocap", f"p{a}", f"pos {a}", unit="m") for a in "xyz"]
    entries += [Entry("mocap", f"q{a}", name) for a, name in zip("xyzw", q, strict=True)]
    entries += [Entry("mocap", f"v{a}", f"vel {a}", unit="m/s") for a in "xyz"]
    entries += [Entry("mocap", f"w{a}", f"ang vel {a}", unit="rad/s") for a in "xyz"]
    entries += [Entry("rpm", f"m{k}", name, unit="rad/s") for k, name in enumerate(MOTORS, start=1)]
    entries += [Entry("battery", "vbat", "vbat", unit="V")]
    return ColumnMap("the format", Entry("", "time", "t", unit="s"),
                     tuple(e for e in entries if e.column in grid.columns), {}, "")


def _velocity(mocap: Stream) -> tuple[Stream, str]:
    """The velocity in the world, and how it was read; without it where the path moves otherwise."""
    if any(v not in mocap for v in VELOCITY):
        return _without_velocity(mocap), "mocap without velocity"
    if any(name not in mocap for name in ("px", "py", "pz", *(f"q{a}" for a in "xyzw"))):
        return _without_velocity(mocap), "velocity left out: without whole poses its axes are not known"
    written, place = mocap[VELOCITY], mocap["px", "py", "pz"]
    turned = so3.rotate(mocap["qx", "qy", "qz", "qw"], written)
    in_world, in_body = (error_m_s(v, place, mocap.time_s) for v in (written, turned))
    speed = float(np.nanquantile(np.linalg.norm(written, axis=1), 0.75))
    if min(in_world, in_body) > FITS * speed:
        return _without_velocity(mocap), (
            "velocity left out: the path does not move by it, neither in the body nor in the world")
    if in_world * BETTER < in_body:
        return mocap, "velocity is in the world, as the path shows"
    values = mocap.values.copy()
    values[:, [mocap.index(v) for v in VELOCITY]] = turned
    return replace(mocap, values=values), "velocity turned from the body into the world"


def _without_velocity(mocap: Stream) -> Stream:
    kept = [k for k, name in enumerate(mocap.quantities) if name not in VELOCITY]
    return replace(mocap, values=mocap.values[:, kept], columns=tuple(mocap.columns[k] for k in kept),
                   quantities=tuple(mocap.quantities[k] for k in kept), unit=tuple(mocap.unit[k] for k in kept))


def _kind(grid: Grid, q: list[str], acc: np.ndarray) -> str:
    turn = np.stack([grid.columns[name] for name in q], axis=1)
    known = np.isfinite(turn).all(axis=1) & np.isfinite(acc).all(axis=1)
    up = float(so3.rotate(turn[known], acc[known]).mean(axis=0)[2]) / GRAVITY_M_S2 if known.any() else float("nan")
    if up > GRAVITY_SHARE:
        return "with gravity (specific force)"
    return "without gravity" if abs(up) < 1.0 - GRAVITY_SHARE else "what gravity does in it is not known"
