"""The cases of ``cases.toml``, and their two simulators: as shipped, and after the makers' correction."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from nanobench_tools.errors import UsageError, did_you_mean
from nanobench_tools.physics import Model, Vehicle

PLACE = Path(__file__).with_name("cases.toml")
OF_VEHICLE = ("mass_kg", "inertia_kg_m2", "motor_positions_m", "spin")
NOMINAL = "nominal"
"""Basis of a case: the simulator fitted to other flights of the vehicle."""
EFFECT, ANOTHER, GEOMETRY, NOT_ASKED = "effect", "another_vehicle", "motor_geometry", "none_asked"


@dataclass(frozen=True)
class ShippedCase:
    """One simulator that shipped wrong; the fields are those of ``cases.toml``, where they are explained."""

    name: str
    number: int
    simulator: str
    threads: tuple[str, ...]
    what: str
    wrong: str
    right: str
    story: str
    answer: str
    vehicle: str = ""
    basis: str = NOMINAL
    known: tuple[tuple[str, ...], ...] = ()
    made: str = ""
    reason: str = ""
    shipped: Mapping[str, Any] | None = None
    corrected: Mapping[str, Any] | None = None
    corrected_basis: str = ""
    after: str = ""

    def simulators(self, nominal: Model) -> tuple[Model, Model]:
        """As shipped, and after the makers' correction, for the vehicle of ``nominal``.

        Raises InputError or UsageError for a value that no vehicle can have.
        """
        return self.as_shipped(nominal), self.as_corrected(nominal)

    def as_shipped(self, nominal: Model) -> Model:
        """The simulator as it was published."""
        return changed(nominal, self.shipped or {}, self.basis)

    def as_corrected(self, nominal: Model) -> Model:
        """The simulator after its makers' correction."""
        return changed(nominal, self.corrected or {}, self.corrected_basis or self.basis)


def shipped_cases(names: Sequence[str] = (), place: Path = PLACE) -> list[ShippedCase]:
    """All cases in their order, or those of these names. UsageError for an unknown name."""
    found = [ShippedCase(**_tuples(entry)) for entry in tomllib.loads(place.read_text(encoding="utf-8"))["cases"]]
    known = [case.name for case in found]
    for name in names:
        if name not in known:
            raise UsageError(f"--case {name} is unknown; {did_you_mean(name, known)}there are {', '.join(known)}")
    return [case for case in found if not names or case.name in names]


def _tuples(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {**entry, "threads": tuple(entry["threads"]), "known": tuple(map(tuple, entry.get("known", ())))}


def changed(nominal: Model, changes: Mapping[str, Any], basis: str = NOMINAL) -> Model:
    """The nominal simulator, or a ``whole`` one for a vehicle of its mass and input, with changes as of ``cases.toml``.
    Terms come last, so that no model is built half."""
    start, given = nominal.vehicle, nominal.as_dict()
    if basis != NOMINAL:
        start, given = Vehicle(mass_kg=start.mass_kg, input=start.input), {}
    vehicle = {key: _tuple(changes[key]) for key in OF_VEHICLE if key in changes}
    terms = {name: values for name, values in given.items() if name not in changes.get("without", ())}
    if "inertia_kg_m2" in changes:
        terms.pop("inertia", None)
    if "mass_kg" in changes:
        terms.pop("mass", None)
    for flat, factor in changes.get("scale", {}).items():
        term, _, key = flat.partition(".")
        terms[term] = {**terms[term], key: factor * terms[term][key]}
    for term, values in changes.get("terms", {}).items():
        terms[term] = {**terms.get(term, {}), **{key: _tuple(value) for key, value in values.items()}}
    return Model(replace(start, **vehicle), terms)


def _tuple(value: Any) -> Any:
    return tuple(_tuple(v) for v in value) if isinstance(value, list) else value
