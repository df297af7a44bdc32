"""Prior knowledge of a vehicle: ``priors.toml``, or a file of the user's in the same form."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.model import find_term
from nanobench_tools.physics.term import Belief, Parameter

SCHEMA = "nanobench-priors/1"
HEAD = {"schema", "vehicle", "thrust_curves", "other_motors"}
ENTRY = {"mean", "sd", "unit", "source"}
SCALED_SD = 0.5
"""Of the mean: least standard deviation of a number that is scaled from another vehicle. A factor of two is likely."""
REFERENCE_THRUST_N = 0.1
"""Thrust per motor at which the curves of the reference vehicle are compared with the hover of another one [N]."""


@dataclass(frozen=True)
class PriorsFile:
    """A user's file: where it is, and its text."""

    place: str
    text: str

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> PriorsFile:
        """InputError where it cannot be read."""
        try:
            return cls(str(path), Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(str(path), f"cannot be read: {error.strerror}") from None
        except UnicodeDecodeError as error:
            raise InputError(str(path), f"is no text: {error}") from None

    def tables(self) -> dict[str, Any]:
        """InputError for what is no TOML of this schema."""
        try:
            given = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(self.place, f"is no TOML: {error}") from None
        if given.get("schema") != SCHEMA:
            raise InputError(f"{self.place}: schema", f"is {given.get('schema')!r}", f'write schema = "{SCHEMA}"')
        return given


@dataclass(frozen=True)
class Priors:
    """``believed``: by name of the parameter (``inertia.inertia_kg_m2[0]``); ``curve`` (K,) N/V^k: mean thrust curve of
    one motor, with ``curve_sd`` (K,) and source; ``note``: empty, or what was scaled from which vehicle; ``others``:
    what replaces ``believed`` for motors of another kind, where the user gave no prior."""

    vehicle: str
    believed: Mapping[str, Belief]
    curve: np.ndarray
    curve_sd: np.ndarray
    curve_source: str
    note: str = ""
    others: Mapping[str, Belief] = field(default_factory=dict)

    def of_other_motors(self) -> Priors:
        """For motors that push far more or less than those behind the shipped priors."""
        return replace(self, believed={**self.believed, **self.others})

    def scaled_to(self, hover_V: float, weight_N: float) -> Priors:
        """The curve so that a motor carries ``weight_N`` at ``hover_V`` volt, with its shape kept.

        For a vehicle of another size; ``thrust_scale`` is then near 1.
        """
        volts = np.linspace(0.5, 4.5, 401)
        usual_V = float(np.interp(REFERENCE_THRUST_N, np.polynomial.polynomial.polyval(volts, self.curve), volts))
        factor = weight_N / REFERENCE_THRUST_N * (usual_V / hover_V) ** np.arange(len(self.curve))
        return replace(self, curve=self.curve * factor, curve_sd=self.curve_sd * factor)


def priors_of(vehicle: Vehicle, given: PriorsFile | None = None) -> Priors:
    """Priors of ``vehicle``; parameters that a user's file lists replace the shipped ones and are never scaled.

    Raises InputError naming file and key for an unknown parameter, a wrong length or an SD that is not positive.
    """
    shipped = tomllib.loads(resources.files("identification.vehicle").joinpath("priors.toml").read_text("utf-8"))
    about = shipped["vehicle"]
    found = _beliefs(shipped, "priors.toml", vehicle.rotors)
    others = _beliefs(shipped["other_motors"], "priors.toml", vehicle.rotors)
    curves = shipped["thrust_curves"]
    lever = float(np.mean(np.abs(vehicle.motor_positions_m)))
    (light, heavy), (short, long) = about["mass_range_kg"], about["lever_range_m"]
    note = ""
    if not (light <= vehicle.mass_kg <= heavy and short <= lever <= long):
        others = {}
        note = (f"priors are scaled from a {about['name']} of {1e3 * about['mass_kg']:g} g to {vehicle.mass_kg:g} kg "
                f"with {1e3 * lever:.3g} mm from motor to axis. Give your own with a priors file")
        found = {name: _scaled(name, belief, vehicle.mass_kg / about["mass_kg"], lever / about["lever_m"])
                 for name, belief in found.items()}
    if given is not None:
        tables = given.tables()
        own = _beliefs(tables, given.place, vehicle.rotors)
        found |= own
        others = {name: belief for name, belief in others.items() if name not in own}
        curves = tables.get("thrust_curves", curves)
    c = _curves(curves, given.place if given is not None else "priors.toml")
    sources = "; ".join(str(entry["source"]) for entry in curves)
    sd = c.std(axis=0, ddof=1) if len(c) > 1 else np.zeros(c.shape[1])
    return Priors(about["name"], found, c.mean(axis=0), sd, f"mean of {len(c)} curves: {sources}", note, others)


def _beliefs(tables: Mapping[str, Any], place: str, rotors: int) -> dict[str, Belief]:
    """{parameter: belief} of the tables [term.parameter]."""
    found: dict[str, Belief] = {}
    for term, entries in tables.items():
        if term in HEAD:
            continue
        try:
            known = {p.name: p for p in find_term(term).parameters}
        except UsageError as error:
            raise InputError(f"{place}: {term}", str(error)) from None
        for name, entry in entries.items() if isinstance(entries, dict) else [(term, None)]:
            where = f"{place}: {term}.{name}"
            if name not in known:
                raise InputError(where, "is no parameter", f"{term} has {', '.join(known) or 'none'}")
            if not isinstance(entry, dict) or set(entry) != ENTRY:
                raise InputError(where, "is no whole entry", f"it needs {', '.join(sorted(ENTRY))}")
            found |= _entry(where, term, known[name], entry, rotors)
    return found


def _entry(where: str, term: str, parameter: Parameter, entry: Mapping[str, Any], rotors: int) -> dict[str, Belief]:
    length = parameter.length_on(rotors)
    try:
        mean, sd = (np.atleast_1d(np.asarray(entry[key], float)) for key in ("mean", "sd"))
    except (TypeError, ValueError):
        raise InputError(where, "mean and sd have to be numbers") from None
    wanted = len(mean) if length is None else max(length, 1)
    if mean.shape != (wanted,) or sd.shape != (wanted,):
        raise InputError(where, f"mean has {mean.size} and sd {sd.size} numbers", f"give {wanted} of each")
    if not (np.isfinite(mean).all() and (sd > 0.0).all()):
        raise InputError(where, "mean has to be finite and sd positive")
    if entry["unit"] != parameter.unit:
        raise InputError(where, f"unit is {entry['unit']!r}", f"give numbers in {parameter.unit}")
    return {f"{term}.{parameter.element_name(i)}": Belief(float(m), float(s), str(entry["source"]))
            for i, (m, s) in enumerate(zip(mean, sd, strict=True))}


def _curves(entries: Any, place: str) -> np.ndarray:
    """(n, K) coefficients."""
    try:
        rows = [np.asarray(entry["c"], float) for entry in entries if isinstance(entry["source"], str)]
        found = np.array([np.pad(row, (0, max(map(len, rows)) - len(row))) for row in rows])
    except (TypeError, KeyError, ValueError):
        found = np.empty((0, 0))
    if not found.size or len(found) != len(entries) or not np.isfinite(found).all():
        raise InputError(f"{place}: thrust_curves", "have to hold c, a list of numbers, and source")
    return found


def _scaled(name: str, belief: Belief, mass: float, lever: float) -> Belief:
    """``belief`` on a vehicle with ``mass`` and ``lever`` times those of the reference."""
    term, _, rest = name.partition(".")
    parameter = next(p for p in find_term(term).parameters if p.name == rest.partition("[")[0])
    factor = mass ** parameter.grows.count("m") * lever ** parameter.grows.count("l")
    mean = factor * belief.mean
    wide = SCALED_SD * abs(mean) if parameter.fixed_mean is None else 0.0
    return Belief(mean, max(factor * belief.sd, wide), f"scaled: {belief.source}")
